"""Posteriors: the density that is drawn from, chunks that are stored, scenes made of draws."""

import functools
import math
from fractions import Fraction
from typing import Any

import numpy as np

import hybridtof
from benchmarks.inner_integral import adaptive, precise_case
from inference.posterior.job import Job
from inference.posterior.stages.checkpoint import Checkpoint
from simulator.parameters import parameters_of
from tests.density.reference import FEW_TERMS, random_case
from tests.extreme.functions.held import Held
from tests.extreme.functions.units import EPSILON
from tests.extreme.integrals import certified_log_integral, condition_of

__all__ = ["FOLDS"]

_OBJECT = {"c0": 0.0769, "c1": -0.123}
_FRAMES = 8
_QUADRATURE = 1e-6  # nat: of a frame whose digits tell less than that


def _density(number: int) -> float | None:
    """The log density of one frame, its range integrated out."""
    rng = np.random.default_rng([50, number])
    case = precise_case(rng) if number % 2 else random_case(rng, FEW_TERMS)
    certified = certified_log_integral(case)
    if certified is None:
        return None
    right = float(certified.mid())
    unit = condition_of(case, right) * EPSILON
    return abs(adaptive(case) - right) / max(unit, _QUADRATURE)


def _given(number: int) -> tuple[Any, Any, hybridtof.Frames, hybridtof.SamplerSettings]:
    """Frames in a unit of readings over 24 decades, and what is to be drawn of them."""
    rng = np.random.default_rng([51, number])
    unit = float(2.0 ** rng.integers(-40, 41))
    noise = {"read": [1e-6 * unit, 1e-5 * unit]}
    sensor = hybridtof.parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "gain": unit, "noise": noise}
    )
    c2 = {"prior": "lognormal", "median": 0.1, "sigma": 1.0}
    scene = {"object": {**_OBJECT, "c2": c2}, "discrepancy": 0}
    known = {"object": {**_OBJECT, "c2": float(rng.lognormal(math.log(0.1), 1.0))}}
    path = hybridtof.SampledTrajectory(range_m=np.geomspace(0.2, 2.0, _FRAMES).tolist())
    frames = hybridtof.simulate(sensor, hybridtof.parse_scene(known), path, number).frames
    settings = hybridtof.SamplerSettings(
        method="emcee" if number % 2 else "importance", seed=number, target_ess=50
    )
    return sensor, hybridtof.parse_scene(scene), frames, settings


@functools.lru_cache(maxsize=16)
def _whole(number: int) -> Any:
    return hybridtof.infer(*_given(number))


@functools.lru_cache(maxsize=16)
def _in_chunks(number: int) -> tuple[Any, bool]:
    """Run a posterior whose job and checkpoint are stored and read again at every step."""
    fold = hybridtof.fold
    job = fold.prepare(*_given(number))
    same = job.to_bytes() == fold.prepare(*_given(number)).to_bytes()
    checkpoint = fold.start(job)
    same &= checkpoint.to_bytes() == fold.start(Job.from_bytes(job.to_bytes())).to_bytes()
    while tasks := fold.tasks(job, checkpoint, 0.0):
        again = Checkpoint.from_bytes(checkpoint.to_bytes())
        pieces = [fold.run(task) for task in fold.tasks(job, again, 0.0)]
        others = [fold.run(task) for task in tasks]
        merged, other = fold.merge(job, checkpoint, pieces), fold.merge(job, again, others)
        same &= merged.to_bytes() == other.to_bytes()
        same &= fold.progress(job, merged) == fold.progress(job, other)
        checkpoint = merged
    answer = fold.summarise(job, checkpoint, 0.0, 0.0)
    same &= np.array_equal(fold.draw(job, checkpoint)[1].parameters, answer.draws.parameters)
    return answer, same


def _folded(number: int) -> float:
    (found, same), whole = _in_chunks(number), _whole(number)
    drawn = np.array_equal(found.draws.parameters, whole.draws.parameters)
    ranges = np.array_equal(found.draws.range_m, whole.draws.range_m, equal_nan=True)
    return 0.0 if same and drawn and ranges else math.inf


def _carried(number: int) -> float:
    """Mean and covariance of the draws in the coordinates of the prior, summed as fractions."""
    sensor, scene, frames, _ = _given(number)
    whole = _whole(number)
    law = hybridtof.calibrated_scene(sensor, scene, frames, whole).joint
    assert law is not None
    parameters = parameters_of(sensor, scene)
    natural = whole.draws.parameters.reshape(-1, len(parameters))
    z: list[float] = parameters.standard(natural)[:, 0].tolist()
    count = len(z)
    exact = [Fraction(x) for x in z]
    mean = sum(exact, Fraction(0)) / count
    off = [x - mean for x in exact]
    variance = sum((x * x for x in off), Fraction(0)) / count
    size = sum((abs(x) for x in exact), Fraction(0)) / count
    (mode,) = law.modes
    first = abs(Fraction(mode.mean[0]) - mean) / (size * Fraction(EPSILON))
    # a difference of z is known to a rounding of z, and a part in 1e9 is added to every variance
    moved = variance + 2 * size * sum((abs(x) for x in off), Fraction(0)) / count
    ridge = variance * (1 + Fraction(1e-9))
    second = abs(Fraction(mode.covariance[0][0]) - ridge) / (moved * Fraction(EPSILON))
    return float(max(first, second))


_BITS = "1: the same bits, or none"
_CHUNKED = ("prepare", "start", "tasks", "run", "merge", "progress", "summarise", "draw")
_STORED = "the same, stored and read again; `infer`"
FOLDS = (
    Held(
        "infer",
        "its log density of a frame in balls",
        "roundings of the readings, and the quadrature's 1e-6 nat",
        400,
        _density,
    ),
    *(Held(f"fold.{name}", _STORED, _BITS, 12, _folded) for name in _CHUNKED),
    Held(
        "calibrated_scene",
        "mean and covariance of the draws in fractions",
        "sizes of the terms of the sums",
        12,
        _carried,
    ),
)
