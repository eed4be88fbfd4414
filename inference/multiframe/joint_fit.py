"""One fit of everything unknown over all frames, and the iterative techniques as settings of it."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.estimates import TechniqueResult
from inference.identifiability.information import Information
from inference.multiframe.counts import joint_obstacle
from inference.multiframe.information import residuals_and_information
from inference.multiframe.multistart import Optimum, find_optima
from inference.multiframe.problem import FitProblem, fit_problem, unknowns_of
from inference.multiframe.ranges import DECIDED, Answer, frame_ranges
from inference.realtime.known import Known
from inference.realtime.net import SATURATED, rule_out
from inference.realtime.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = [
    "ITERATIVE_BACKGROUND_CANCELLING",
    "ITERATIVE_DIFFERENTIAL",
    "JOINT_FIT",
    "describe",
]

Array = NDArray[np.float64]

LIMIT = 0.1  # relative standard deviation of the ranges that the unknowns share out
_IDENTIFIED, _WEAK = 0.1, 1.0
_FALSE_ALARM = 1e-3
_CROSSTALK = (3, 4)


def _words(paths: Sequence[str]) -> str:
    return paths[0] if len(paths) == 1 else ", ".join(paths[:-1]) + " and " + paths[-1]


def _typical_light(problem: FitProblem, x: Array) -> float:
    """Median modulus of the readings net of crosstalk, in the problem's unit."""
    net = problem.frames[:, :2] - problem.values(x)[3:5]
    return float(np.median(np.abs(net).max(axis=1)))


def describe(problem: FitProblem, x: Array, facts: Information) -> dict[str, Any]:
    """Return value, standard deviation and status of every unknown.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Coordinates.
    facts : Information
        There.

    Returns
    -------
    dict
        By scene path: ``value`` and ``sd`` (Cramer-Rao bound, ranges eliminated) in SI or reading
        units, and ``status``: identified (sd below a tenth), weak, not_identified (above 1), of
        the logarithm of what is positive, of crosstalk against the light of the scene.
    """
    functionals = problem.chain(x)[problem.slots] * problem.units[:, None]
    sds = facts.sd_of(functionals)
    values = problem.natural(x)
    relative = facts.sd / np.where(
        np.isin(problem.slots, _CROSSTALK), max(_typical_light(problem, x), 1e-300), 1.0
    )
    found: dict[str, Any] = {}
    for name, value, sd, size in zip(problem.names, values, sds, relative, strict=True):
        status = "identified" if size < _IDENTIFIED else "weak"
        found[name] = {
            "value": float(value),
            "sd": float(sd) if math.isfinite(sd) else None,
            "status": status if size < _WEAK else "not_identified",
        }
    return found


def _still(problem: FitProblem) -> bool:
    """Tell whether all frames with an object read the same but for noise."""
    shown = problem.frames[problem.present]
    if np.ptp(shown[:, 2]) > 0:
        return False
    read, shot, relative = np.asarray(problem.instrument[2]), *problem.instrument[3:]
    middle = shown[:, :2].mean(axis=0)
    variance = read**2 + (shot or 0.0) * np.abs(middle) + ((relative or 0.0) * middle) ** 2
    spread = float((((shown[:, :2] - middle) ** 2) / variance).sum())
    return bool(spread < special.chdtri(2 * max(len(shown) - 1, 1), _FALSE_ALARM))


def _refuse_if_open(problem: FitProblem, top: Optimum, facts: Information) -> None:
    """Refuse what the frames do not determine."""
    present = problem.present & np.isfinite(top.positions)
    still = _still(problem)
    if facts.rank < len(problem):
        weights = np.abs(facts.null_space).max(axis=1)
        names = [name for name, w in zip(problem.names, weights, strict=True) if w > 0.05]
        cause = (
            "the object does not move: all frames read the same but for noise"
            if still
            else "the frames do not tell them apart"
        )
        raise RefusedError(
            f"{_words(names or list(problem.names))} cannot be determined (rank {facts.rank} of "
            f"{len(problem)}): {cause}; move the object nearer and farther, add frames of the "
            "empty scene (object_present false), or state one of them as known"
        )
    shared = facts.sd_of(facts.response[present])
    typical = float(np.median(shared)) if shared.size else math.inf
    if not typical <= LIMIT:
        open_ones = [
            name
            for name, item in describe(problem, top.x, facts).items()
            if item["status"] != "identified"
        ]
        cause = (
            "the object does not move: all frames read the same but for noise"
            if still
            else (f"{_words(open_ones or list(problem.names))} are too uncertain")
        )
        raise RefusedError(
            f"the ranges would have a common relative standard deviation of {typical:.2g}, more "
            f"than {LIMIT:g}: {cause}; move the object nearer and farther, add frames of the "
            "empty scene (object_present false), lower the noise, state a number as known, or use "
            "a posterior with priors"
        )


def _fit_report(
    problem: FitProblem, optima: Sequence[Optimum], facts: Information
) -> dict[str, Any]:
    residual, _ = residuals_and_information(problem, optima[0].x, optima[0].positions)
    chi_square = float(np.einsum("ni,ni->", residual, residual))
    freedom = 2 * problem.present.size - int(problem.present.sum()) - len(problem)
    p_value = float(special.chdtrc(freedom, chi_square))
    return {
        "chi_square": chi_square,
        "degrees_of_freedom": freedom,
        "p_value": p_value,
        "misfit": p_value < _FALSE_ALARM,
        "rank": facts.rank,
        "optima": [
            {
                "excess_deviance": optimum.deviance - optima[0].deviance,
                "parameters": dict(
                    zip(problem.names, problem.natural(optimum.x).tolist(), strict=True)
                ),
            }
            for optimum in optima
        ],
    }


def _solve_as(name: str, task: Task) -> TechniqueResult:
    state = rule_out(task.sensor, task.frames)
    used = np.flatnonzero(state != SATURATED)
    problem = fit_problem(task.sensor, task.scene, task.frames.select(used))
    optima = find_optima(problem)
    if not optima:
        raise RefusedError(
            "no values of the unknowns give the readings a likelihood that can be computed; check "
            "gain, noise and range_m"
        )
    top = optima[0]
    _, facts = residuals_and_information(problem, top.x, top.positions)
    _refuse_if_open(problem, top, facts)
    undecided = [
        Answer(optimum.x, optimum.deviance - top.deviance)
        for optimum in optima
        if optimum.deviance - top.deviance <= DECIDED
    ]
    return frame_ranges(
        name,
        problem,
        undecided,
        state,
        describe(problem, top.x, facts),
        _fit_report(problem, optima, facts),
    )


def _differential_obstacle(
    sensor: Sensor, scene: Scene, known: Known, frames: Frames | None
) -> str | None:
    if not any(path.startswith("crosstalk.") for path in unknowns_of(sensor, scene)):
        return "is made for unknown crosstalk, and the scene's is known or absent: take joint_fit"
    return joint_obstacle(sensor, scene, known, frames)


def _cancelling_obstacle(
    sensor: Sensor, scene: Scene, known: Known, frames: Frames | None
) -> str | None:
    if not scene.shadow_is_object:
        return 'takes the object\'s parameters for its shadow ("shadow": "object"): take joint_fit'
    return joint_obstacle(sensor, scene, known, frames)


JOINT_FIT = Technique(
    name="joint_fit",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=(),
    immune_to=("crosstalk", "background"),
    uses_background=False,
    differential=False,
    cost=1e5,
    equations="5.9-5.16: one least squares over all unknowns, ranges eliminated",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("joint_fit", task),
    obstacle=joint_obstacle,
)

ITERATIVE_DIFFERENTIAL = Technique(
    name="iterative_differential",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=(),
    immune_to=("crosstalk",),
    uses_background=False,
    differential=False,
    cost=1.1e5,
    equations="5.9-5.13: joint_fit of c0, c1, c2 and crosstalk",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("iterative_differential", task),
    obstacle=_differential_obstacle,
)

ITERATIVE_BACKGROUND_CANCELLING = Technique(
    name="iterative_background_cancelling",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=("background.distance_m",),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=1.1e5,
    equations="5.14-5.16: joint_fit of c0, c1, c2 and the background's strength, c' = c",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("iterative_background_cancelling", task),
    obstacle=_cancelling_obstacle,
)
