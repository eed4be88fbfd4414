"""The conventional range in C: one division, or one arctangent."""

import math

from inference.realtime.assemble import END_BAND
from inference.realtime.solving.ratio_reach import FEW
from inference.realtime.turns import several_turns
from service.c_export.source import Asked, Bound, Exported, noise_lines
from simulator.errors import Problem, RefusedError
from simulator.sensor import PulsedSensor

__all__ = ["conventional"]

# 8 roundings beyond its ends, as everywhere (inference.realtime.assemble)
_PULSE = """
static int answer(real first, real second, @_answer *out)
{
    const real late = first - CROSSTALK1, whole = second - CROSSTALK2;
    real share, range, variance, noise;
    if (!(whole > 0) || !(late > 0) || !(late <= whole))
        return @_NONE;
    share = late / whole;
    range = R0 * share;
    if (!(range >= LOW * (1 - 8 * EPSILON)) || !(range <= HIGH * (1 + 8 * EPSILON)))
        return @_NONE;
    {
@NOISE        variance = own1 + share * share * own2 + (1 - share) * (1 - share) * shared;
        noise = R0 / whole * SQRT(variance);
        out->near_fold = END >= 1 - 8 * EPSILON && whole - late < BAND * SQRT(own1 + own2);
        if (FEW * (own2 + shared) > whole * whole) { /* noise leads it away from its tangent */
            const real v1 = own1 / whole / whole, v2 = own2 / whole / whole;
            const real both = shared / whole / whole, middle = share - 9 * both;
            const real left = 1 - 9 * (v2 + both), rest = share * share - 9 * (v1 + both);
            const real square = 9 * (variance / whole / whole - 9 * (v1 * v2 + both * (v1 + v2)));
            real high = END, low = 0;
            if (square > 0) {
                const real root = SQRT(square), total = middle < 0 ? middle - root : middle + root;
                const real one = rest / total, none = middle < 0 ? END : R(-1.0);
                const real other = left > 0 || left < 0 ? total / left : none;
                const real less = one < other ? one : other, more = one < other ? other : one;
                if (left > 0) {
                    high = more < END ? more : END;
                    low = less > 0 ? less : 0;
                } else if (share <= less) { /* all but what lies between them */
                    high = more > END && less < END ? less : END;
                } else
                    low = less < 0 && more > 0 ? more : 0;
            }
            high = high - share > share - low ? high - share : share - low;
            if (R0 * high / 3 > noise)
                noise = R0 * high / 3;
        }
    }
    if (noise < EPSILON * range)
        noise = EPSILON * range;
    out->range_m = range;
    out->sd_m = SQRT(noise * noise + MODEL * MODEL);
    return @_UNIQUE;
}
"""
_WAVE = """
static int answer(real first, real second, @_answer *out)
{
    const real x = first - CROSSTALK1, y = second - CROSSTALK2;
    const real size = LARGER(x, y), a = x / size, b = y / size, square = a * a + b * b;
    real phase, range, sd, along, across, var1, var2;
    int beside;
    if (!(size > 0))
        return @_NONE;
    phase = ATAN2(y, x) - OFFSET;
    if (phase < 0)
        phase += TURN;
    if (phase >= TURN)
        phase -= TURN;
    {
@NOISE        var1 = (own1 + shared) / size / size;
        var2 = (own2 + shared) / size / size;
    }
    sd = SQRT(b * b * var1 + a * a * var2) / square;
    along = COSINE * a + SINE * b;
    across = COSINE * b - SINE * a;
    beside = along > 0 && SIZE(across) < BAND * SQRT(SINE * SINE * var1 + COSINE * COSINE * var2);
    if (!(phase > 0) || (phase > TURN / 2 && beside))
        return @_NONE;
    range = phase / WAVE_NUMBER;
    if (!(range >= LOW * (1 - 8 * EPSILON)) || !(range <= HIGH * (1 + 8 * EPSILON)))
        return @_NONE;
    if (400 * LARGER(var1, var2) > square) { /* noise turns it by more than its tangent */
        const real most = 3 * sd, both = 9 * SIZE(a * b * (var2 - var1)) / square / square;
        const real left = 1 - 9 * (a * a * var1 + b * b * var2) / square / square;
        if (most > 1 || !(left > 0))
            sd = (phase > TURN - phase ? phase : TURN - phase) / 3;
        else {
            const real bent = ATAN2(both + SQRT(both * both + left * most * most), left);
            const real even = ATAN2(most, SQRT((1 - most) * (1 + most)));
            sd = (bent > even ? bent : even) / 3;
        }
    }
    sd = sd / WAVE_NUMBER;
    if (sd < EPSILON * range)
        sd = EPSILON * range;
    out->range_m = range;
    out->sd_m = SQRT(sd * sd + MODEL * MODEL);
    return @_UNIQUE;
}
"""


def conventional(asked: Asked) -> Exported:
    """Write the conventional range; see `service.c_export.export_c`."""
    sensor, (low, high) = asked.sensor, asked.known.support
    if several_turns(sensor, asked.known, sensor.max_range_m):
        raise RefusedError(
            f"conventional: the stated range_m goes on beyond {sensor.max_range_m:.4g} m, where "
            "the phase begins anew, and the export gives one range a frame; narrow it",
            Problem("/scene/range_m", "holds several turns of phase"),
        )
    assert asked.known.crosstalk is not None  # noqa: S101  # what the plan leaves out
    first, second = asked.known.crosstalk
    read = sensor.noise.read
    limits = (low, min(high, sensor.max_range_m))
    constants = {
        "CROSSTALK1": first,
        "CROSSTALK2": second,
        "LOW": limits[0],
        "HIGH": limits[1],
        "READ1": read[0],
        "READ2": read[1],
        "SHOT": sensor.noise.shot,
        "MODEL": asked.error.range_m,
    }
    crosstalk = abs(first) / read[0] + abs(second) / read[1]
    # the noise is scoped, since C99 declares where it likes but not twice
    noise = noise_lines(sensor).replace("    const", "        const")
    if isinstance(sensor, PulsedSensor):
        return Exported(
            constants
            | {"R0": sensor.r0, "END": min(limits[1] / sensor.r0, 1.0)}
            | {"BAND": END_BAND, "FEW": FEW},
            {},
            _PULSE.replace("@NOISE", noise),
            Bound(0.0, 6.0, 0.0, crosstalk, (0.0, 0.0), read),
            "r0 (w1 - x1) / (w2 - x2): five roundings of the range, and those of the crosstalk x, "
            "which are small beside the noise of the same reading",
            limits,
        )
    k, offset = sensor.wave_number, math.remainder(sensor.known_phase_rad, 2 * math.pi)
    return Exported(
        constants
        | {"OFFSET": offset, "WAVE_NUMBER": k, "TURN": 2 * math.pi, "BAND": END_BAND}
        | {"COSINE": math.cos(offset + k * low), "SINE": math.sin(offset + k * low)},
        {},
        _WAVE.replace("@NOISE", noise),
        # arctangent 4 pi, offset and its difference 4 pi, turn and its sum 4 pi, readings 1
        Bound(0.0, 3.0, (1 + 12 * math.pi) / k, crosstalk, (0.0, 0.0), read),
        "the phase over k, given an atan2 within 2 units in the last place; whatever range of the "
        "phase is used, its roundings are those of a whole turn",
        limits,
    )
