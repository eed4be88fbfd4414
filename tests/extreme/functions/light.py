"""What light an object sends, what it tells, and how sure a single range is: held to balls."""

import math
from typing import Any, NamedTuple

import numpy as np
from flint import arb

import hybridtof
from simulator.sensor import Sensor
from tests.extreme.functions.held import Held
from tests.extreme.functions.units import Numbers, between, slope, units

__all__ = ["LIGHT", "Light", "draw_light", "information", "mean"]

_LIGHT_M_S = 299792458
_ROUNDINGS = "relative changes of all that goes in"


class Light(NamedTuple):
    """A scene in numbers, as documents and by name, and the object's range [m]."""

    sensor: dict[str, Any]
    scene: dict[str, Any]
    range_m: float
    numbers: dict[str, float]

    @property
    def parsed(self) -> Sensor:
        """The sensor."""
        return hybridtof.parse_sensor(self.sensor)


def draw_light(rng: np.random.Generator, read: float = -30.0, terms: bool = True) -> Light:
    """Draw a scene: 1 ps to 1 s, 1 Hz to 1 THz, c1 to 1e-15 of its pole.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    read : float
        Logarithm to ten of the first reading's noise over it.
    terms : bool
        Whether crosstalk and a wall may be there.

    Returns
    -------
    Light
    """
    pulsed = rng.random() < 0.5
    if pulsed:
        width = between(rng, -12, 0)
        about: dict[str, Any] = {"kind": "pulsed", "pulse_width_s": width}
        reach = _LIGHT_M_S * width / 2
    else:
        frequency = between(rng, 0, 12)
        about = {"kind": "sine_wave", "frequency_hz": frequency}
        reach = _LIGHT_M_S / frequency / 2
    r = reach * between(rng, -4, -0.01)
    size = r * between(rng, -4, 4)
    c0, which = size * size, rng.random()
    c1 = size * float(-2 * (1 - between(rng, -15, 0)) if which < 0.4 else rng.uniform(-1.9, 2))
    c2, light = between(rng, -3, 3), between(rng, -12, 12)
    q = (r + c1 / 2) ** 2 + max(c0 - c1 * c1 / 4, 1e-16 * c0)
    gain = light * r * r * (q / (c0 * c2))
    late = r / reach if pulsed else 1.0
    noise = [late * light * 10**read, light * 10**read * between(rng, -1, 1)]
    numbers = {"c0": c0, "c1": c1, "c2": c2, "gain": gain, "r": r}
    numbers |= {"read1": noise[0], "read2": noise[1]}
    scene: dict[str, Any] = {"object": {"c0": c0, "c1": c1, "c2": c2}, "discrepancy": 0}
    if terms and rng.random() < 0.5:
        crosstalk = [light * between(rng, -6, 6), -light * between(rng, -6, 6)]
        numbers |= {"x1": crosstalk[0], "x2": crosstalk[1]}
        scene["crosstalk"] = crosstalk
    if terms and rng.random() < 0.5:
        wall = {"b": light * between(rng, -6, 6), "far": r + (reach - r) * between(rng, -6, -0.01)}
        shadow = {"s0": r * r * between(rng, -6, 6), "s1": r * between(rng, -6, 6)}
        numbers |= wall | shadow
        scene["background"] = {
            "strength": wall["b"],
            "distance_m": wall["far"],
            "shadow": {"c0": shadow["s0"], "c1": shadow["s1"]},
        }
    sensor = {**about, "gain": gain, "noise": {"read": noise}}
    parsed = hybridtof.parse_sensor(sensor)
    length = {"r0": parsed.r0} if parsed.kind == "pulsed" else {"wave": parsed.wave_number}
    return Light(sensor, scene, r, numbers | length)


def mean(of: Numbers) -> tuple[Any, Any]:
    """Return the mean readings."""
    r = of["r"]
    flux = of["gain"] * of["c0"] * of["c2"] / (r * r * (r * (r + of["c1"]) + of["c0"]))
    found = [flux * share for share in _shares(of, r)]
    if "b" in of:
        visible = r * (r + of["s1"])
        visible = of["b"] * visible / (visible + of["s0"])
        far = _shares(of, of["far"])
        found = [m + visible * share for m, share in zip(found, far, strict=True)]
    if "x1" in of:
        found = [found[0] + of["x1"], found[1] + of["x2"]]
    return found[0], found[1]


def _shares(of: Numbers, distance: Any) -> tuple[Any, Any]:
    if "wave" in of:
        phase = of["wave"] * distance
        return phase.cos(), phase.sin()
    late = distance / of["r0"]
    number = late if isinstance(late, arb) else late[0]
    return (late if number < 1 else late * 0 + 1), arb(1)


def information(of: Numbers) -> arb:
    """Return the information of one frame on the logarithm of its range."""
    total = arb(0)
    for j in range(2):
        along = of["r"] * slope(lambda at, j=j: mean(at)[j], of, "r")  # type: ignore[misc]
        total += (along / of[f"read{j + 1}"]) ** 2
    return total


def _simulated(number: int) -> float:
    light = draw_light(np.random.default_rng([44, number]))
    path = hybridtof.SampledTrajectory(range_m=[light.range_m])
    scene = hybridtof.parse_scene(light.scene)
    # noise of 1e-30 of the light is no digit of it
    (found,) = hybridtof.simulate(light.parsed, scene, path, number).frames.readings
    return max(
        units(lambda of, j=j: mean(of)[j], light.numbers, float(found[j]))  # type: ignore[misc]
        for j in range(2)
    )


def _foreseen(number: int) -> float | None:
    rng = np.random.default_rng([45, number])
    light = draw_light(rng, rng.uniform(-12, 2))
    scene = dict(light.scene)
    if scene.get("background", {}).get("distance_m", math.inf) <= light.range_m:
        return None
    law = {"prior": "loguniform", "low": light.range_m / 2, "high": light.range_m * 1.01}
    parsed = hybridtof.parse_scene({**scene, "range_m": law})
    found = hybridtof.identifiability(light.parsed, parsed, [light.range_m])
    bound = float(found.range_sd[0])
    return units(lambda of: of["r"] / information(of).sqrt(), light.numbers, bound)


_SURE = ("conventional", "intensity", "intensity_w1")


def _sure(number: int) -> float | None:
    """Standard deviations of single ranges of a pulse, along the tangent of the curve."""
    technique = _SURE[number % 3]
    rng = np.random.default_rng([46, number])
    light = draw_light(rng, rng.uniform(-6, -3), terms=False)
    sensor = light.parsed
    if sensor.kind != "pulsed":
        return None
    scene = hybridtof.parse_scene(light.scene)
    path = hybridtof.SampledTrajectory(range_m=[light.range_m])
    # noise of its own might leave an object at the top of its light without a range
    silent = {**light.sensor, "noise": {"read": [1e-20 * x for x in sensor.noise.read]}}
    frames = hybridtof.simulate(hybridtof.parse_sensor(silent), scene, path, number).frames
    (result,) = hybridtof.estimate(sensor, scene, frames, [technique]).results
    if not result.root_count[0]:
        return None
    near = int(np.nanargmin(np.abs(result.roots_m[0] - light.range_m)))
    root, sd = float(result.roots_m[0, near]), float(result.roots_sd_m[0, near])
    if not math.isfinite(sd):
        return 0.0 if result.near_fold[0] else math.inf
    w1, w2 = frames.readings[0].tolist()
    numbers = light.numbers | {"r": root, "w1": w1, "w2": w2}

    def exact_sd(of: Numbers) -> arb:
        if technique == "conventional":
            share = of["w1"] / of["w2"]
            return of["r0"] / of["w2"] * (of["read1"] ** 2 + (share * of["read2"]) ** 2).sqrt()
        j = 0 if technique == "intensity_w1" else 1
        return of[f"read{j + 1}"] / abs(slope(lambda at: mean(at)[j], of, "r"))

    return units(exact_sd, numbers, sd)


LIGHT = (
    Held("simulate", "mean readings in balls", _ROUNDINGS, 2_000, _simulated),
    Held("identifiability", "the bound of a range in balls", _ROUNDINGS, 2_000, _foreseen),
    Held("estimate", "standard deviations in balls", _ROUNDINGS, 2_000, _sure),
)
