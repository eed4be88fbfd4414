"""Maxima of the likelihood of all frames where the model itself errs (docs/model.md, fit-response).

A model that errs by percents, fitted to readings as if it were exact, ends far from the truth: a
noise of 1e-4 asks the unknowns to follow what only the errors explain, which they do in far corners
of the object model, and what is linear there says nothing of the truth. So errors are unknowns here
as the others, with their law, and so is what the scene's priors say of the unknowns, without which
errors leave many of them open. What errors are followed by leaves a share of their size, frame by
frame, which bounds how sharp the likelihood is, whatever the noise.
"""

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.erring_point import (
    Point,
    columns_of,
    left_of_frames,
    linearised,
    point_at,
    slopes_of_priors,
    standard,
    whitened_of,
)
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.model_error import errors_of_readings
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information

__all__ = ["Erring", "erring_maxima", "softened"]

Array = NDArray[np.float64]

_RELATIVE = 0.03  # independent error of the signal that stands for a smooth one in a search
_OF_LIGHT = (1e-2, 1e-3)  # of the light of a middling frame, for an error of its direction
_FEW, _STEPS = 6, 60  # steps of every climb, and of the best of them
_KEPT = 4
_INWARD = 1.5  # standard deviations of the priors that a second start is held within
_LONGEST = 0.7  # change of a logarithm in a step
_TURNS = 2  # in which ranges and errors settle at given unknowns
_ENOUGH = 1e-3  # of what is gained by a step


@dataclasses.dataclass(frozen=True, eq=False)
class Erring(Maximum):
    """A maximum over unknowns, ranges and errors of the model.

    Attributes
    ----------
    deviance : float
        Of readings, errors and unknowns together.
    chi_square : float
        Of readings and errors.
    clean : FitProblem
        With readings less what the errors do to them.
    facts : Information
        What those readings and the priors tell, the errors known.
    whole : Information
        The same, the errors unknown.
    """

    chi_square: float
    clean: FitProblem
    facts: Information
    whole: Information

    def at_ranges(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Return what each frame says of a range, all other frames as they are.

        Parameters
        ----------
        u : ndarray, shape (n,)
            log r.

        Returns
        -------
        four ndarray, each of shape (n,)
            Standard deviations of log r by the frame's noise, by what frames share if the errors
            are known, and by all; chi-square of the frame, errors and unknowns free as far as all
            frames leave them.
        """
        problem = self.clean
        residual, jacobian, along, errors, _ = linearised(problem, self.x, u)
        own = eliminate(problem.names, jacobian, along)
        of_x, of_errors = self.whole.factors
        free = jacobian @ of_x + errors @ of_errors
        parts = np.concatenate([jacobian, along[:, :, None], errors], axis=2)
        white, d = whitened_of(problem, u, errors, parts), self.x.size
        seen = eliminate(problem.names, white[:, :, :d], white[:, :, d], white[:, :, d + 1 :])
        shared = np.linalg.norm(seen.response @ of_x + seen.error_response @ of_errors, axis=1)
        return (
            np.sqrt(own.own_variance),
            np.linalg.norm(own.response @ self.facts.factor, axis=1),
            np.sqrt(seen.own_variance + np.square(shared)),
            left_of_frames(problem, u, residual, along, errors, free),
        )


def softened(problem: FitProblem) -> tuple[FitProblem, ...]:
    """Return problems whose optima are where to look for those of a model that errs, itself too.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    """
    return *(_softened(problem, share) for share in _OF_LIGHT), problem


def _softened(problem: FitProblem, share: float) -> FitProblem:
    at = problem.instrument
    relative = math.hypot(_RELATIVE, at.relative or 0.0)
    readings = problem.frames[:, :2]
    light = float(np.median(np.abs(readings - np.median(readings, axis=0)).max(axis=1)))
    read = math.hypot(at.read[0], share * light), math.hypot(at.read[1], share * light)
    softer = at._replace(read=read, shot=at.shot or 0.0, relative=relative)
    return dataclasses.replace(problem, instrument=softer)


def erring_maxima(problem: FitProblem, starts: Iterable[Maximum]) -> list[Erring]:
    """Climb from starting points, and from each held within the priors.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    starts : iterable of Maximum
        From optima of `softened` problems.

    Returns
    -------
    list of Erring
        Ends of the best climbs, the best first.
    """
    begun = [
        _climbed(problem, _begun(problem, x, start.positions), _FEW)
        for start in starts
        for x in (start.x, _held_within_priors(problem, start.x))
        if np.isfinite(x).all() and np.isfinite(start.deviance)
    ]
    begun.sort(key=lambda end: end[0].deviance)
    ends = [_climbed(problem, at, _STEPS) for at, _ in begun[:_KEPT] if math.isfinite(at.deviance)]
    ends.sort(key=lambda end: end[0].deviance)
    return [_told(problem, at, remaining) for at, remaining in ends]


def _held_within_priors(problem: FitProblem, x: Array) -> Array:
    columns = columns_of(problem)
    z = np.zeros((1, len(columns)))
    z[0, columns] = np.clip(standard(problem, x[None]), -_INWARD, _INWARD)
    return np.asarray(problem.coordinates(problem.parameters.natural(z)[:, columns])[0])


def _eliminated(problem: FitProblem, at: Point) -> Information:
    """Return rows across the ranges; of the errors, and last of the residuals."""
    errors = np.concatenate([at.errors, at.residual[:, :, None]], axis=2)
    return eliminate(problem.names, at.jacobian, at.along, errors)


def _ranges(problem: FitProblem, at: Point, seen: Information, dx: Array, da: Array) -> Array:
    """Return ranges that follow a step."""
    step = seen.response @ dx + seen.error_response @ np.append(da, -1.0)
    with np.errstate(invalid="ignore"):
        step = np.clip(step / (1.0 + seen.own_variance), -0.5, 0.5)
    step[~np.isfinite(step)] = 0.0
    return np.where(np.isfinite(at.u), np.clip(at.u + step, *np.log(problem.support)), np.nan)


def _settled(problem: FitProblem, at: Point) -> Point:
    """Let ranges and errors follow the unknowns, which stay."""
    k = at.a.size
    for _ in range(_TURNS):
        if not math.isfinite(at.deviance):
            break
        seen = _eliminated(problem, at)
        rows = np.vstack([seen.errors[:, :-1], np.eye(k)])
        da = np.linalg.lstsq(rows, np.concatenate([seen.errors[:, -1], -at.a]), rcond=None)[0]
        u = _ranges(problem, at, seen, np.zeros(at.x.size), da)
        at = point_at(problem, at.x, u, at.a + da)
    return at


def _begun(problem: FitProblem, x: Array, positions: Array) -> Point:
    u = np.where(problem.present & np.isnan(positions), math.log(problem.support[1]), positions)
    k = errors_of_readings(problem, np.ones((u.size, 2)), u).shape[2]
    return _settled(problem, _settled(problem, point_at(problem, x, u, np.zeros(k))))


def _climbed(problem: FitProblem, at: Point, steps: int) -> tuple[Point, float]:
    """Climb by Levenberg-Marquardt steps of the unknowns, ranges and errors following.

    Returns also the deviance that a whole step would still gain.
    """
    k, damping, remaining = at.a.size, 1e-3, math.inf
    for _ in range(steps if math.isfinite(at.deviance) else 0):
        seen, bounds = _eliminated(problem, at), problem.bounds(at.x)
        errors, seen_residual = seen.errors[:, :-1], seen.errors[:, -1]
        d = at.x.size
        rows = np.block(
            [
                [errors, seen.jacobian, seen_residual[:, None]],
                [np.eye(k), np.zeros((k, d)), -at.a[:, None]],
                [np.zeros((d, k)), slopes_of_priors(problem, at.x), -at.z[:, None]],
            ]
        )
        triangle = scipy.linalg.qr(rows, mode="r")[0]
        of_x, wanted = triangle[k : k + d, k:-1], triangle[k : k + d, -1]
        size = np.linalg.norm(of_x, axis=0)
        size = np.where(size > 0, size, 1.0)
        remaining = float(wanted @ wanted)
        better = None
        for _ in range(8):
            damped = np.vstack([of_x / size, math.sqrt(damping) * np.eye(d)])
            step = np.linalg.lstsq(damped, np.append(wanted, np.zeros(d)), rcond=None)[0] / size
            longest = float(np.abs(step[problem.logarithms]).max(initial=0.0))
            new = np.clip(at.x + step * min(1.0, _LONGEST / max(longest, 1e-300)), *bounds)
            dx = new - at.x
            left = triangle[:k, -1] - triangle[:k, k:-1] @ dx
            da = np.linalg.lstsq(triangle[:k, :k], left, rcond=None)[0]
            there = point_at(problem, new, _ranges(problem, at, seen, dx, da), at.a + da)
            there = _settled(problem, there)
            if there.deviance < at.deviance:
                better = there
                break
            damping *= 6.0
        if better is None:
            break
        gained, at, damping = at.deviance - better.deviance, better, max(damping / 4.0, 1e-9)
        if gained < _ENOUGH:
            break
    return at, remaining


def _with_priors(facts: Information, slopes: Array) -> Information:
    d, k = slopes.shape[0], facts.errors.shape[1]
    return dataclasses.replace(
        facts,
        jacobian=np.vstack([facts.jacobian, slopes]),
        before=np.vstack([facts.before, np.abs(slopes)]),
        errors=np.vstack([facts.errors, np.zeros((d, k))]),
    )


def _told(problem: FitProblem, at: Point, remaining: float) -> Erring:
    """Return what is told at the end of a climb."""
    _, jacobian, along, errors, whitener = linearised(problem, at.x, at.u)
    slopes = slopes_of_priors(problem, at.x)
    facts = _with_priors(eliminate(problem.names, jacobian, along), slopes)
    whole = _with_priors(eliminate(problem.names, at.jacobian, at.along, at.errors), slopes)
    frames = problem.frames.copy()
    frames[:, :2] -= np.linalg.solve(whitener, (errors @ at.a)[:, :, None])[:, :, 0]
    return Erring(
        x=at.x,
        deviance=at.deviance,
        remaining=remaining,
        positions=at.u,
        chi_square=float(np.square(at.residual).sum() + at.a @ at.a),
        clean=dataclasses.replace(problem, frames=frames),
        facts=facts,
        whole=whole,
    )
