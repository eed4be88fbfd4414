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
from numpy.typing import NDArray

from inference.fits.likelihood.erring_climb import (
    FEW,
    begun,
    climbed,
    held_within_priors,
    with_other_ranges,
)
from inference.fits.likelihood.erring_point import (
    Point,
    brighter_by,
    left_of_frames,
    linearised,
    own_change,
    point_at,
    slopes_of_priors,
    whitened_of,
)
from inference.fits.likelihood.known_modes import with_known
from inference.fits.likelihood.lacking_light import moved_by_light, share_of_light
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.other_starts import apart, larger, of_law, other_crosstalk
from inference.fits.likelihood.pairs import solved
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import (
    Told,
    contradictions,
    eliminated,
    improbable,
    told_at,
    unsettled,
)
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information

__all__ = ["Erring", "contradicting", "end_from", "end_of", "erring_maxima", "softened"]

Array = NDArray[np.float64]

_RELATIVE = 0.03  # independent error of the signal that stands for a smooth one in a search
_OF_LIGHT = (1e-2, 1e-3)  # of the light of a middling frame, for an error of its direction
_STEPS = 60  # of the best climbs
_KEPT = 4
_BEHIND = 2  # of the climbs that begin behind other crosstalk
_SAME = 1e-3  # in log r and deviance
_NAMED = 5  # frames that contradict are named, at most


@dataclasses.dataclass(frozen=True, eq=False)
class Erring(Maximum):
    """A maximum over unknowns, ranges and errors of the model.

    Attributes
    ----------
    deviance : float
        Of readings, errors and unknowns together.
    a : ndarray, shape (k,)
        The errors.
    chi_square : float
        Of readings, errors and what is known beside them.
    read : FitProblem
        The problem, with the readings that there are.
    clean : FitProblem
        With readings less what the errors do to them.
    bare : FitProblem
        With readings less, besides, what is left of errors and each frame's own, at its likeliest:
        of these each frame by itself has the range that it has at the maximum.
    facts : Information
        What those readings and the priors tell, the errors known.
    whole : Information
        The same, the errors unknown.
    """

    a: Array
    chi_square: float
    read: FitProblem
    clean: FitProblem
    bare: FitProblem
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
        residual, jacobian, along, errors, _ = linearised(problem, self.x, u, self.a)
        change = own_change(problem, u, residual, errors)
        along = along * brighter_by(problem, u, self.a, change)[:, None]
        told = told_at(problem.known, u, self.a)
        own = _errors_known(problem, jacobian, along, told)
        of_x, of_errors = self.whole.factors
        parts = np.concatenate([jacobian, along[:, :, None], errors], axis=2)
        white, d = whitened_of(problem, u, errors, parts), self.x.size
        seen = eliminated(
            problem.names, white[:, :, :d], white[:, :, d], white[:, :, d + 1 :], told
        )
        shared = np.linalg.norm(seen.response @ of_x + seen.error_response @ of_errors, axis=1)
        # no more than the light that came may err by
        unknowns, of_light = moved_by_light(problem)
        share = share_of_light(problem, self.x, u)[:, None, None]
        errors = errors * np.where(of_light, share, 1.0)
        free = (jacobian * np.where(unknowns, share, 1.0)) @ of_x + errors @ of_errors
        left = left_of_frames(problem, u, residual, along, errors, free)
        of_x, of_offset = self.facts.factors
        if told is not None:
            off, move, more = self._beside(u)
            left = left + contradictions(told, off, move, more) + unsettled(told, off, move)
        return (
            np.sqrt(own.own_variance),
            np.linalg.norm(own.response @ of_x + own.error_response @ of_offset, axis=1),
            np.sqrt(seen.own_variance + np.square(shared)),
            left,
        )

    def contradictions(self, u: Array) -> Array:
        """Return by how much readings and what is known beside them tell other ranges, (n,)."""
        told = told_at(self.clean.known, u, self.a)
        if told is None:
            return np.zeros(u.size)
        return contradictions(told, *self._beside(u))

    def _beside(self, u: Array) -> tuple[Array, Array, Array]:
        """Return residuals, derivatives along log r and what else moves readings, whitened."""
        problem = self.read
        residual, jacobian, along, errors, _ = linearised(problem, self.x, u, self.a)
        of_x, of_errors = self.whole.factors
        free = jacobian @ of_x + errors @ of_errors
        parts = [(residual - errors @ self.a)[:, :, None], along[:, :, None], free]
        white = whitened_of(problem, u, errors, np.concatenate(parts, axis=2))
        return white[:, :, 0], white[:, :, 1], white[:, :, 2:]

    def with_known(self, u: Array) -> Array:
        """Return ranges that readings prefer, moved to where what is known beside them counts."""
        return with_known(self.read, self.x, self.a, u)


def softened(problem: FitProblem) -> tuple[FitProblem, ...]:
    """Return problems of more noise, whose optima too are where to look for those of a problem."""
    return tuple(_softened(problem, share) for share in _OF_LIGHT)


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
        From optima of the problem and of `softened` ones.

    Returns
    -------
    list of Erring
        Ends of the best climbs, the best first.
    """
    first = apart(_first_climbs(problem, (*starts, *of_law(problem))))[:_KEPT]
    behind = other_crosstalk(problem, _softened(problem, _OF_LIGHT[0]))
    first += _first_climbs(problem, behind)[:_BEHIND]
    ends: list[tuple[Point, float]] = []
    for at in first:
        if not any(_same(at, end) for end, _ in ends):
            ends.append(climbed(problem, at, _STEPS))
    ends.sort(key=lambda end: end[0].deviance)
    if ends:
        ends += [climbed(problem, at, _STEPS) for at in larger(problem, ends[0][0])]
        ends.sort(key=lambda end: end[0].deviance)
    return [end_of(problem, at, remaining) for at, remaining in ends]


def end_from(problem: FitProblem, start: Erring) -> Erring:
    """Return the end of a climb from that of another, of a mode of its own or stopped early."""
    begin = point_at(problem, start.x, start.positions, start.a)
    return end_of(problem, *climbed(problem, begin, _STEPS))


def _first_climbs(problem: FitProblem, starts: Iterable[Maximum]) -> list[Point]:
    """Climb a little from starts and from each held within the priors; the best first."""
    first = []
    for start in starts:
        if not (np.isfinite(start.x).all() and np.isfinite(start.deviance)):
            continue
        inward = held_within_priors(problem, start.x)
        # a start within the priors is its own
        for x in (start.x, inward) if not np.allclose(inward, start.x) else (start.x,):
            at, _ = climbed(problem, begun(problem, x, start.positions), FEW)
            if math.isfinite(at.deviance):
                first.append(with_other_ranges(problem, at, x, start.positions))
    return sorted(first, key=lambda at: at.deviance)


def contradicting(top: Erring, problem: FitProblem) -> list[int]:
    """Return the frames whose readings and known ranges contradict one another.

    One wrong range bends everything else towards itself: the worst is left out, and the rest asked
    again.

    Parameters
    ----------
    top : Erring
        The best maximum.
    """
    named: list[int] = []
    known = problem.known
    while known is not None and len(named) < _NAMED:
        worst = improbable(top.contradictions(top.positions))
        if not worst.size:
            break
        named.append(int(worst[0]))
        known = known.without(named[-1])
        rest = dataclasses.replace(problem, known=known, mode=top.clean.mode)
        begin = point_at(rest, top.x, top.positions, top.a)
        top = end_of(rest, *climbed(rest, begin, _STEPS))
    return sorted(named)


def _same(at: Point, end: Point) -> bool:
    """Return whether a climb has come where another has ended."""
    near = np.allclose(at.u, end.u, rtol=0.0, atol=_SAME, equal_nan=True)
    return near and abs(at.deviance - end.deviance) < _SAME


def _with_priors(facts: Information, slopes: Array) -> Information:
    d, k = slopes.shape[0], facts.errors.shape[1]
    return dataclasses.replace(
        facts,
        jacobian=np.vstack([facts.jacobian, slopes]),
        before=np.vstack([facts.before, np.abs(slopes)]),
        errors=np.vstack([facts.errors, np.zeros((d, k))]),
    )


def _errors_known(
    problem: FitProblem, jacobian: Array, along: Array, told: Told | None
) -> Information:
    """Eliminate the ranges, the errors of the model known, the offset of displacements not."""
    if told is None or problem.known is None:
        return eliminate(problem.names, jacobian, along)
    count = 1 if problem.known.offset_sd > 0.0 else 0
    errors = np.zeros((*along.shape, count))
    told = told._replace(errors=told.errors[:, :, told.errors.shape[2] - count :])
    return eliminated(problem.names, jacobian, along, errors, told)


def _less(problem: FitProblem, change: Array) -> FitProblem:
    """Return the problem with readings less a change, shape (n, 2, 1)."""
    frames = problem.frames.copy()
    frames[:, :2] -= change[:, :, 0]
    return dataclasses.replace(problem, frames=frames)


def end_of(problem: FitProblem, at: Point, remaining: float) -> Erring:
    """Return what is told at the end of a climb; `remaining` is what a step would still gain."""
    _, jacobian, along, errors, whitener = linearised(problem, at.x, at.u, at.a)
    slopes = slopes_of_priors(problem, at.x)
    facts = _with_priors(_errors_known(problem, jacobian, along, at.told), slopes)
    seen = eliminated(problem.names, at.jacobian, at.along, at.errors, at.told)
    whole = _with_priors(seen, slopes)
    chi_square = float(np.square(at.residual).sum() + at.a @ at.a)
    if at.told is not None:
        chi_square += float(np.square(at.told.residual).sum())
    if problem.law:
        chi_square += float(at.z @ at.z)
    moved = (errors @ at.a)[:, :, None]
    clean = _less(problem, solved(whitener, moved))
    if errors.shape[2] > 0:
        off = (at.root @ at.residual[:, :, None])[:, :, 0]
        moved = moved + errors @ own_change(problem, at.u, off, errors)[:, :, None]
    return Erring(
        x=at.x,
        deviance=at.deviance,
        remaining=remaining,
        positions=at.u,
        a=at.a,
        chi_square=chi_square,
        read=problem,
        clean=clean,
        bare=_less(problem, solved(whitener, moved)),
        facts=facts,
        whole=whole,
    )
