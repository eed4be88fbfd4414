"""Ranges of single frames, proved; fits of many frames; the choice among techniques."""

import numpy as np

import hybridtof
from tests.extreme.certified import FAMILIES, tally
from tests.extreme.functions.held import Held
from tests.extreme.functions.light import draw_light
from tests.extreme.optima import CASES, SNRS, excess_of, fit_miss
from tests.extreme.waves import WAVES, tally_waves

__all__ = ["ROOTS"]

_FRAMES = 8
_KINDS = ("pulsed", "sine_wave")
_TECHNIQUES = (*FAMILIES, *(f"{name}, sine wave" for name in WAVES))


def _counted(number: int) -> float | None:
    """All ranges of frames of one scene; a count that is not the proved one is beyond all units."""
    rng = np.random.default_rng([47, number])
    technique = _TECHNIQUES[number % len(_TECHNIQUES)]
    name = technique.removesuffix(", sine wave")
    counted = tally if technique == name else tally_waves
    found = counted(name, 1, _FRAMES, rng)
    if found.wrong:
        return float("inf")
    return found.worst if found.roots else None


def _fitted(number: int) -> float | None:
    """A joint fit beside its optimum in 50 digits."""
    turn, snr = divmod(number, len(SNRS))
    turn, kind = divmod(turn, len(_KINDS))
    seed, case = divmod(turn, len(CASES))
    miss = fit_miss(_KINDS[kind], tuple(CASES)[case], SNRS[snr], seed=1 + seed)
    if miss.refused:
        return None
    # a reference that leaves the ranges that are allowed is none
    return float(np.nan_to_num(excess_of(miss)))


def _chosen(number: int) -> float:
    """Techniques that a scene allows, in units of readings 2^-40 to 2^40 times as large."""
    rng = np.random.default_rng([48, number])
    light = draw_light(rng, rng.uniform(-12, 2))
    unit = float(2.0 ** rng.integers(-40, 41))
    plans = []
    for times in (1.0, unit):
        noise = [times * x for x in light.sensor["noise"]["read"]]
        sensor = {**light.sensor, "gain": times * light.sensor["gain"], "noise": {"read": noise}}
        scene = dict(light.scene)
        if "crosstalk" in scene:
            scene["crosstalk"] = [times * x for x in scene["crosstalk"]]
        if "background" in scene:
            wall = scene["background"]
            scene["background"] = {**wall, "strength": times * wall["strength"]}
        frames = hybridtof.Frames(times * np.ones((3, 2)), time_s=np.arange(3.0))
        told = hybridtof.parse_scene(scene)
        plans.append(hybridtof.plan(hybridtof.parse_sensor(sensor), told, frames))
    return 0.0 if plans[0] == plans[1] else float("inf")


ROOTS = (
    Held(
        "all_roots",
        "proved numbers of roots, exact equations",
        "relative changes of the equation's terms",
        440,
        _counted,
    ),
    Held(
        "estimate, many frames",
        "the optimum in 50 digits",
        "1e-3 of chi-square, where a climb may stop, and 8 roundings of the readings",
        144,
        _fitted,
    ),
    Held("plan", "itself in other units of readings", "1: nothing is computed", 1_000, _chosen),
)
