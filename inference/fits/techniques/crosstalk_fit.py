"""Crosstalk and c2 by linear least squares on ranges from derivatives (5.13).

Ranges come from differential time of flight, which crosstalk does not reach; given them, readings
are linear in both crosstalks and c2. Errors of the ranges enter the weights as a rank-one part of
each frame's covariance along the direction in which its readings move with the range. Where the
derivatives are differences of the readings themselves, the result is but a start for the
likelihood of all frames.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.counts import too_few
from inference.fits.likelihood.unknowns import unknowns_of
from inference.fits.linear.equations import without_warnings
from inference.fits.linear.least_squares import LinearFit, solve_weighted
from inference.fits.linear.light import object_light
from inference.frame.arguments import instrument_of
from inference.frame.noise import whiteners
from inference.known import Known
from inference.realtime.net import SATURATED, rule_out
from inference.realtime.techniques.differential import ranges_by_derivatives
from inference.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["CROSSTALK_FIT", "noisier"]

Array = NDArray[np.float64]

_PASSES = 50
_NARROW = 0.1  # relative standard deviation of a range up to which first order describes it


def noisier(whitener: Array, along: Array) -> Array:
    """Return whiteners of covariances to which one more error is added.

    Parameters
    ----------
    whitener : ndarray, shape (n, 2, 2)
        W with W^T W the inverse of a covariance V.
    along : ndarray, shape (n, 2)
        Standard deviations a of a common error: it may be a million times the rest, and is never
        added to it.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Of V + a a^T.
    """
    w = np.einsum("nij,nj->ni", whitener, along)
    root = np.hypot(1.0, np.hypot(w[:, 0], w[:, 1]))
    # (I + w w^T)^(-1/2) = I - w w^T / (root (1 + root))
    shrunk = w / root[:, None] / (1.0 + root)[:, None]
    across = np.einsum("nj,nji->ni", w, whitener)
    return np.asarray(whitener - shrunk[:, :, None] * across[:, None, :])


def _unit_signal(task: Task, r: Array) -> tuple[Array, Array]:
    """Return the object's readings for c2 = 1, and their derivative along log r; each (n, 2)."""
    c0, c1 = task.known.get("object.c0"), task.known.get("object.c1")
    return object_light(task.sensor, (c0, c1, 1.0), r, task.frames)


def _paths(task: Task) -> tuple[str, str, str]:
    """Scene paths of what readings are linear in: both crosstalks and c2."""
    first, second = task.sensor.columns
    return f"crosstalk.{first}", f"crosstalk.{second}", "object.c2"


def _fit(
    task: Task, roots: Array, sds: Array, chosen: NDArray[np.intp], unknown: tuple[str, ...]
) -> LinearFit:
    """Fit on chosen roots; choose and weigh anew until nothing changes."""
    sensor, readings, instrument = task.sensor, task.frames.readings, instrument_of(task.sensor)
    n = len(task.frames)
    usable = rule_out(sensor, task.frames) != SATURATED
    empty = usable & ~task.frames.present
    paths = _paths(task)
    free = np.array([path in unknown for path in paths])
    x = np.where(free, 0.0, [_known(task, path) for path in paths])
    none = np.empty(0)
    fit = LinearFit(none, np.empty((0, 0)), 0, none, usable, np.full(n, np.nan), none)
    rows, index = np.arange(n), chosen
    shift = np.zeros(n)  # log r of the fit less that of the derivatives
    for _ in range(_PASSES):
        spread = sds[rows, index] / roots[rows, index]
        r = roots[rows, index] * np.exp(shift)
        unit, slope = _unit_signal(task, r)
        unit[empty], slope[empty], spread[empty] = 0.0, 0.0, 0.0
        used = usable & np.isfinite(unit).all(axis=1) & (spread < _NARROW)
        if int((used & ~empty).sum()) <= int(free.sum()):
            return dataclasses.replace(fit, rank=0)
        *_, size = x
        signal, error = size * unit, size * spread[:, None] * slope
        used &= (np.isfinite(readings) & np.isfinite(signal) & np.isfinite(error)).all(axis=1)
        # linear in the range about the fitted one
        expected = unit - shift[:, None] * slope
        design = np.zeros((n, 2, 3))
        design[:, 0, 0] = design[:, 1, 1] = 1.0
        design[:, :, 2] = expected
        whitener = noisier(whiteners(instrument, readings[used], signal[used]), error[used])
        matrix = np.einsum("nij,njk->nik", whitener, design[used])
        target = np.einsum("nij,nj->ni", whitener, readings[used])
        target = target - matrix[:, :, ~free] @ x[~free]
        flat = matrix[:, :, free].reshape(-1, int(free.sum()))
        solution, factor, rank = solve_weighted(flat, target.ravel())
        residuals = flat @ solution - target.ravel()
        last, last_shift = x.copy(), shift
        x[free] = solution
        light = np.abs(x[2] * matrix[:, :, 2]).ravel()
        at = np.where(used & ~empty, r, np.nan)
        fit = LinearFit(solution, factor, rank, residuals, used, at, light)
        if rank < solution.size:
            break
        *crosstalk, size = x
        miss = readings - crosstalk - size * expected
        pull = np.zeros((n, 2))
        white = np.einsum("nij,nj->ni", whitener, miss[used])
        pull[used] = np.einsum("nji,nj->ni", whitener, white)
        gain = size * spread**2 * np.einsum("ni,ni->n", slope, pull)
        shift = np.where(used, np.clip(gain, -3 * _NARROW, 3 * _NARROW), 0.0)
        better = _best_roots(task, roots, x)
        if not np.array_equal(better, index):
            index, shift = better, np.zeros(n)
        elif np.allclose(last, x, rtol=1e-10, atol=0.0) and np.allclose(
            last_shift, shift, rtol=0.0, atol=1e-9
        ):
            break
    return fit


def _best_roots(task: Task, roots: Array, x: Array) -> NDArray[np.intp]:
    """Return the index of the root of each frame whose readings lie nearest to the fit."""
    misses = []
    *crosstalk, size = x
    for k in range(roots.shape[1]):
        there = crosstalk + size * _unit_signal(task, roots[:, k])[0]
        miss = np.abs(task.frames.readings - there).sum(axis=1)
        misses.append(np.where(np.isnan(miss), np.inf, miss))
    return np.asarray(np.argmin(np.stack(misses, axis=1), axis=1))


def _known(task: Task, path: str) -> float:
    if path == "object.c2":
        return task.known.numbers.get(path, 0.0)
    crosstalk = task.scene.crosstalk_values
    if crosstalk is None:
        return 0.0
    value = crosstalk[0] if path.endswith(("w1", ".i")) else crosstalk[1]
    return float(value) if isinstance(value, float | int) else 0.0


def _fitted(task: Task, unknown: tuple[str, ...]) -> tuple[LinearFit, TechniqueResult]:
    """Return the best fit, and the ranges by derivatives that it started from."""
    # a start: what jumps is followed by the likelihood
    single = ranges_by_derivatives(dataclasses.replace(task, exact=True), uneven_too=True)
    solved = int(np.count_nonzero(single.root_count))
    if solved < len(unknown) + 1:
        raise RefusedError(
            f"needs at least {len(unknown) + 1} frames whose derivatives give a range for "
            f"{', '.join(unknown)}, and has {solved}; move the object faster, or take joint_fit"
        )
    last = np.maximum(single.root_count - 1, 0)
    with np.errstate(all="ignore"):
        fits = [
            _fit(task, single.roots_m, single.roots_sd_m, start, unknown)
            for start in {tuple(start): start for start in (np.zeros_like(last), last)}.values()
        ]
    good = [fit for fit in fits if fit.rank == len(unknown)]
    if not good:
        raise RefusedError(
            f"the frames do not tell {', '.join(unknown)} apart, or fewer than {len(unknown) + 1} "
            "have derivatives that fix the range to 10 %: move the object nearer and farther, or "
            "take joint_fit"
        )
    return min(good, key=lambda one: one.chi_square), single


def _solve(task: Task) -> TechniqueResult:
    # imported where a fit is asked for: plans of single frames go without
    from inference.fits.answer.likelihood_answer import likelihood_answer
    from inference.fits.linear.follow import Follow
    from inference.fits.linear.linear_answer import linear_answer

    unknown = unknowns_of(task.sensor, task.scene)
    fit, single = _fitted(task, unknown)
    order = [path for path in _paths(task) if path in unknown]
    values = dict(zip(order, fit.x.tolist(), strict=True))
    if values.get("object.c2", 1.0) <= 0.0:
        raise RefusedError(
            "the best fit has a negative c2: the readings do not fall with range as the object's "
            "c0 and c1 say; check them, or take joint_fit"
        )
    if task.frames.derivatives is None:
        # differences of the readings tell nothing that the readings do not, and their errors are
        # neither small nor independent: they serve to find where the likelihood is climbed from
        answer = likelihood_answer("crosstalk_fit", task, values)
        if answer.fit is not None and answer.fit["misfit"]:
            raise RefusedError(
                "the ranges by differences in time lead to values that do not explain the "
                "readings; take joint_fit, which starts from everywhere"
            )
        return answer
    natural = {path: (values[path], np.eye(len(order))[k]) for k, path in enumerate(order)}

    def again(moved: Task) -> tuple[Array, Array]:
        found, _ = _fitted(moved, unknown)
        return found.x, found.residuals

    light = [
        values.get("object.c2", _known(task, "object.c2")) * part
        for part in _unit_signal(task, fit.ranges)
    ]
    follow = Follow(again, fit.ranges, *light)
    return linear_answer("crosstalk_fit", task, fit, natural, single, {}, follow)


def _obstacle(sensor: Sensor, scene: Scene, _known: Known, frames: Frames | None) -> str | None:
    if scene.motion != "radial":
        return f"needs radial motion, and the scene's is {scene.motion}"
    if scene.optional_terms:
        return "keeps crosstalk, and the scene leaves it to the data; use a posterior"
    unknown = unknowns_of(sensor, scene)
    if not any(path.startswith("crosstalk.") for path in unknown):
        return "fits crosstalk, and the scene's is known"
    return too_few(frames, unknown)


CROSSTALK_FIT = Technique(
    name="crosstalk_fit",
    kinds=("pulsed", "sine_wave"),
    observables="both readings and their derivatives in time, of all frames",
    needs=("object.c0", "object.c1"),
    immune_to=("crosstalk",),
    uses_background=False,
    differential=True,
    cost=8e4,
    equations="5.13: readings linear in crosstalk and c2 on ranges by `differential`",
    roots="as `differential`; the fit decides between several",
    solve=without_warnings(_solve),
    obstacle=_obstacle,
)
