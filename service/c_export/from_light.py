"""Ranges from a known object's light in C: by a bracket, or from a table."""

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

from inference.realtime.assemble import END_BAND
from inference.realtime.from_curve import curve_parameters
from inference.realtime.registry import TECHNIQUES
from inference.realtime.solving.curves import cancelling_ratio, intensity, intensity_w1
from inference.realtime.solving.monotone_intervals import monotone_intervals
from service.c_export.flux_curve import FluxCurve, table
from service.c_export.source import Asked, Bound, Exported, noise_lines
from service.messages.measured import limits_of
from simulator.errors import RefusedError
from simulator.range_prior import range_prior
from simulator.sensor import PulsedSensor

__all__ = ["background_cancelling", "from_late_light", "from_light"]

# where the light is as much as this, between the ends
_BRACKET = """
static real range_of(real light)
{
    real low = LOW, high = HIGH;
    int turns;
    for (turns = 0; turns < 200; turns++) {
        const real middle = low + (high - low) / 2;
        if (!(middle > low && middle < high))
            break;
        if (light * (middle * middle) * (middle * (middle + C1) + C0) <= STRENGTH)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static int between(real light)
{
    const real low = LOW, high = HIGH;
    return light > 0 && light * (low * low) * (low * (low + C1) + C0) <= STRENGTH
        && light * (high * high) * (high * (high + C1) + C0) >= STRENGTH;
}
"""
_TABLE = """
static real range_of(real light)
{
    int low = 0, high = NODES - 1;
    while (high - low > 1) {
        const int middle = (low + high) / 2;
        if (light <= readings[middle])
            low = middle;
        else
            high = middle;
    }
    return ranges[low] + (light - readings[low])
           * ((ranges[high] - ranges[low]) / (readings[high] - readings[low]));
}

static int between(real light)
{
    return light > 0 && light <= readings[0] && light >= readings[NODES - 1];
}
"""
# what is common to all: how far noise moves a range, along the curve where it is bent, and how far
# errors of the model do
_LIGHT = """
static int solved(real light, real variance, real whole, @_answer *out)
{
    if (!between(light))
        return @_NONE;
    const real range = range_of(light);
    const real q = range * (range + C1) + C0;
    const real bare = STRENGTH / (range * @POWER * q);
    const real slope = bare * (NEARNESS + (1 - range * NEARNESS)
                               * (@P + range * (2 * range + C1) / q) / range);
    const real late = @LATE;
    const real shadow = @HIDDEN;
    const real noise = SQRT(variance + light * light * RELATIVE * RELATIVE);
    const real model = SQRT(light * light * FLUX * FLUX + late * late + shadow * shadow) / slope;
    real sd = noise / slope;
    (void)whole;
    out->range_m = range;
    out->sd_m = -1;
    if (sd > range / 200) { /* noise leads it away from its tangent */
        const real more = light + 3 * noise, less = light - 3 * noise;
        const real near = between(more) ? range_of(more) : LOW;
        const real far = between(less) ? range_of(less) : HIGH;
        if (GOES_ON > 0 && !between(less)) {
            out->near_fold = NEARNESS > 0;
            return @_UNIQUE; /* at any farther range */
        }
        sd = LARGER(sd, LARGER(far - range, range - near) / 3);
    }
    /* noise moves it up to the wall, or may be all that is free of the wall's light */
    out->near_fold = NEARNESS > 0 && ((range + 3 * sd) * NEARNESS >= 1 - R(1e-9)
                                      || light < BAND * SQRT(variance));
    out->sd_m = SQRT(sd * sd + model * model);
    return @_UNIQUE;
}
"""
_HEAD = """
static int answer(real first, real second, @_answer *out)
{
@NOISE"""
_WHOLE = """    (void)own1;
    return solved(second - CROSSTALK2, own2 + shared, R(0.0), out);
}
"""
_MODULUS = """    const real x = first - CROSSTALK1, y = second - CROSSTALK2;
    const real size = LARGER(x, y), a = x / size, b = y / size, square = a * a + b * b;
    if (!(size > 0))
        return @_NONE;
    return solved(size * SQRT(square),
                  (a * a * (own1 + shared) + b * b * (own2 + shared)) / square, R(0.0), out);
}
"""
_LATE = """    (void)own2;
    return solved(first - CROSSTALK1, own1 + shared, R(0.0), out);
}
"""
_FREE = """    const real share = R0 * NEARNESS;
    const real whole = second - CROSSTALK2;
    const real light = whole - share * (first - CROSSTALK1);
    return solved(light, share * share * own1 + own2 + (1 - share) * (1 - share) * shared, whole,
                  out);
}
"""


@dataclasses.dataclass(frozen=True, slots=True)
class _Form:
    """One technique: its curve, what its light is, and what errors of the model do to it."""

    curve: FluxCurve
    head: str
    late: str
    crosstalk: float
    readings: tuple[float, float] = (0.0, 0.0)
    hidden: str = "R(0.0)"
    constants: Mapping[str, float] = dataclasses.field(default_factory=dict)


def _strength(asked: Asked) -> float:
    return float(
        asked.sensor.known_gain * asked.known.get("object.c2") * asked.known.get("object.c0")
    )


def _crosstalk(asked: Asked) -> tuple[float, float]:
    assert asked.known.crosstalk is not None  # noqa: S101  # what the plan leaves out
    return asked.known.crosstalk


class _Limits(NamedTuple):
    """Between which ranges is looked, and whether an object may be farther."""

    low: float
    high: float
    goes_on: bool


def _limits(asked: Asked, kind: int) -> _Limits:
    """Return between which ranges is looked; refuse a curve that turns, whatever its ranges."""
    prior = range_prior(asked.sensor, asked.scene)
    technique = TECHNIQUES[asked.technique]
    _, reach = limits_of(technique, asked.sensor, asked.known)
    low, high = max(prior.low, 0.0), min(prior.high, reach)
    curves = {c.CURVE.kind: c.CURVE for c in (intensity, intensity_w1, cancelling_ratio)}
    parameters = curve_parameters(asked.known, asked.sensor)
    if monotone_intervals(curves[kind], parameters, 0.0, reach / asked.known.unit).low.size > 1:
        raise RefusedError(
            "the light of this object does not fall everywhere: several ranges can explain a "
            "frame, which this export does not tell apart"
        )
    if not 0 < low < high < math.inf:
        raise RefusedError("state a range_m with two ends: a table or a bracket needs both")
    return _Limits(low, high, reach > high)


def _exported(asked: Asked, form: _Form, limits: _Limits, bracket: bool) -> Exported:
    curve, read = form.curve, asked.sensor.noise.read
    crosstalk = _crosstalk(asked)
    low, high = limits.low, limits.high
    constants = {
        "CROSSTALK1": crosstalk[0],
        "CROSSTALK2": crosstalk[1],
        "LOW": low,
        "HIGH": high,
        "READ1": read[0],
        "READ2": read[1],
        "SHOT": asked.sensor.noise.shot,
        "RELATIVE": asked.sensor.noise.relative,
        "FLUX": asked.error.flux,
        "MODEL": asked.error.range_m,
        "STRENGTH": curve.strength,
        "C0": curve.c0,
        "C1": curve.c1,
        "NEARNESS": curve.nearness,
        "BAND": END_BAND,
        "GOES_ON": float(limits.goes_on),
        **form.constants,
    }
    slope = curve.least_slope(low, high)
    tables: dict[str, tuple[float, ...]] = {}
    if bracket:
        # Q, the products and K, and the reading; then the last step of the bracket
        method, relative = 0.0, (4 * curve.condition + 9) / slope + 2
        proof = (
            f"the last step of a bracket of a falling curve: its value is rounded by at most "
            f"{4 * curve.condition + 9:.3g} units, and -d log(light) / d log(r) >= {slope:.4g}"
        )
        body = _BRACKET
    else:
        nodes = table(curve, low, high, asked.tolerance)
        if nodes is None:
            raise RefusedError(
                f"no table of 65536 cells has an error of {asked.tolerance:g}: allow more, or "
                "state a narrower range_m"
            )
        tables = {"ranges": tuple(nodes.range_m), "readings": tuple(nodes.reading)}
        method, relative = nodes.error_m, 6 / slope + 4
        proof = (
            f"linear between {nodes.range_m.size} nodes, {nodes.relative:.2g} of the range or "
            "less: on each of 16 pieces of a cell the larger error of its ends, plus half the "
            "piece times the largest difference of the slopes, which monotone bounds hold"
        )
        body = _TABLE
    light = _LIGHT.replace("@POWER", "range" if curve.power == 2 else "R(1.0)")
    light = light.replace("@P ", f"{curve.power} ").replace("@LATE", form.late)
    light = light.replace("@HIDDEN", form.hidden)
    head = _HEAD.replace("@NOISE", noise_lines(asked.sensor)) + form.head
    if "R0" in form.head:
        assert isinstance(asked.sensor, PulsedSensor)  # noqa: S101  # what has late light
        constants["R0"] = asked.sensor.r0
    bound = Bound(method, relative, 0.0, form.crosstalk, form.readings, read)
    return Exported(constants, tables, body + light + head, bound, proof, (low, high))


def from_light(asked: Asked) -> Exported:
    """Write `intensity`; see `service.c_export.export_c`."""
    c0, c1 = asked.known.get("object.c0"), asked.known.get("object.c1")
    curve = FluxCurve(_strength(asked), 2, c0, c1)
    shares = [abs(x) / s for x, s in zip(_crosstalk(asked), asked.sensor.noise.read, strict=True)]
    pulsed = isinstance(asked.sensor, PulsedSensor)
    head, crosstalk = (_WHOLE, shares[1]) if pulsed else (_MODULUS, sum(shares))
    form = _Form(curve, head, "R(0.0) * MODEL", crosstalk)
    return _exported(asked, form, _limits(asked, intensity.KIND), bracket=True)


def from_late_light(asked: Asked) -> Exported:
    """Write `intensity_w1`; see `service.c_export.export_c`."""
    assert isinstance(asked.sensor, PulsedSensor)  # noqa: S101  # the registry's `kinds`
    c0, c1 = asked.known.get("object.c0"), asked.known.get("object.c1")
    curve = FluxCurve(_strength(asked) / asked.sensor.r0, 1, c0, c1)
    crosstalk = abs(_crosstalk(asked)[0]) / asked.sensor.noise.read[0]
    form = _Form(curve, _LATE, "light / range * MODEL", crosstalk)
    return _exported(asked, form, _limits(asked, intensity_w1.KIND), bracket=False)


def background_cancelling(asked: Asked) -> Exported:
    """Write `background_cancelling` of a pulse; see `service.c_export.export_c`."""
    if not isinstance(asked.sensor, PulsedSensor):
        raise RefusedError("background_cancelling is exported for pulsed sensors alone")
    if asked.known.has("background.strength"):
        raise RefusedError(
            "with a known strength of the background ranges are filtered by it, which this export "
            "does not: give the strength as a prior"
        )
    c0, c1 = asked.known.get("object.c0"), asked.known.get("object.c1")
    distance = asked.known.get("background.distance_m")
    curve = FluxCurve(_strength(asked), 2, c0, c1, 1 / distance)
    shares = [abs(x) / s for x, s in zip(_crosstalk(asked), asked.sensor.noise.read, strict=True)]
    if asked.known.has("background.shadow.c0", "background.shadow.c1"):
        c0, c1 = asked.known.get("background.shadow.c0"), asked.known.get("background.shadow.c1")
    form = _Form(
        curve,
        _FREE,
        "bare * NEARNESS * MODEL",
        2 * sum(shares),
        (4.0, 2.0),
        "(whole - bare) * SHADOW * (SHADOW0 / (range * (range + SHADOW1) + SHADOW0))",
        {"SHADOW": asked.error.shadow, "SHADOW0": c0, "SHADOW1": c1},
    )
    return _exported(asked, form, _limits(asked, cancelling_ratio.KIND), bracket=False)
