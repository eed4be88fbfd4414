"""What the best fit of a model that errs owes to errors that a scene cannot have.

Errors of the model and unknowns follow light that the scene leaves out, and chi-square stays small.
Where they are linear, readings less the model, errors and unknowns in units of their laws are
together normal noise with what the fit took up projected out (docs/model.md, fit-checks). So it is
known how far unknowns may be off their priors, and how much of the rest may look like crosstalk.
"""

import dataclasses
import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.answer.stated_facts import (
    FREE,
    along_brightness,
    off_their_own,
    weights_of_told,
)
from inference.fits.answer.succession import goes_on
from inference.fits.likelihood.arguments import CROSSTALK
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import (
    deviations_of,
    linearised,
    point_at,
    slopes_of_priors,
)
from inference.fits.likelihood.model_error import share_left
from inference.fits.likelihood.pairs import solved_by_root
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import eliminated
from inference.identifiability.elimination import moving

__all__ = [
    "REASONS",
    "Check",
    "Rows",
    "basis",
    "free_of",
    "model_checks",
    "rows_of",
    "without_size",
]

Array = NDArray[np.float64]

_SMOOTH = 0.03  # share that is left of errors of the flux by a sixth of it
SUCCESSION = "succession"
BRIGHTNESS, TOLD = "brightness", "known_ranges"
_APART = 1e-6  # of a column, below which the fit can make it itself

REASONS: Mapping[str, str] = {
    "chi_square": "readings lie farther off the model than noise and its errors allow",
    "crosstalk": (
        "light that is the same in all frames, as crosstalk, would explain the readings better: "
        "state crosstalk as unknown, or give empty frames"
    ),
    "priors": (
        "the unknowns lie where their priors have next to no mass: something is not as the scene "
        "states it, or the object is unlike those of its priors"
    ),
    SUCCESSION: (
        "what the fit leaves of the readings goes on from frame to frame, as noise does not: a "
        "sensor or its driver smooths them (a low-pass, a running mean), and ranges are late, or "
        "something else changes slowly; send readings that are not smoothed, with their own noise"
    ),
    BRIGHTNESS: (
        "an object that is brighter or darker than the number c2 makes it would explain the "
        "readings better: the numbers of `object` are of another one, or its light has changed; "
        "state what is not sure as a prior, or leave it out"
    ),
    TOLD: (
        "what is told of ranges beside the readings lies farther off than its standard deviations "
        "allow: state what it is right to in known_range_sd_m or displacement_sd_m"
    ),
}
"""What it means that a check fails, by its name."""


class Check(NamedTuple):
    """A sum of squares, and how many independent standard normal numbers it is of."""

    statistic: float
    freedom: int

    @property
    def p_value(self) -> float:
        """How often noise and errors within their laws make it larger."""
        return float(scipy.special.chdtrc(self.freedom, self.statistic)) if self.freedom else 1.0


class Rows(NamedTuple):
    """What is standard normal before a fit: readings across their ranges, errors, unknowns.

    Attributes
    ----------
    target : ndarray, shape (m,)
        At the best fit.
    followed : ndarray, shape (m, k + d)
        Derivatives along all that was fitted.
    crosstalk : ndarray, shape (m, c)
        Along the crosstalk that is no unknown.
    brightness : ndarray, shape (m, 0 or 1)
        Along the light of an object whose c2 is no unknown.
    told : ndarray, shape (m - k - d,)
        How much of the first rows is what is told of ranges; none where nothing is.
    dense : ndarray, shape (d,)
        How much nearer than in the target unknowns are to where their priors are densest.
    frames : ndarray of int, shape (m - k - d,)
        Of which frame of the problem the first rows are.
    """

    target: Array
    followed: Array
    crosstalk: Array
    brightness: Array
    told: Array
    dense: Array
    frames: NDArray[np.intp]


def rows_of(problem: FitProblem, top: Erring) -> Rows:
    """Linearise a fit at its maximum, the laws of errors and unknowns as rows of their own."""
    at = point_at(problem, top.x, top.positions, top.a)
    whitener = linearised(problem, top.x, top.positions)[-1]
    # crosstalk moves the readings themselves
    known = [i for i, slot in enumerate(CROSSTALK) if slot not in problem.slots]
    bright = along_brightness(problem, at.x, at.u)
    facts = np.concatenate([whitener[:, :, known], bright], axis=2)
    columns = [at.errors, at.residual[:, :, None], solved_by_root(at.root, facts)]
    told, (k, d, c) = at.told, (at.a.size, at.x.size, len(known))
    weights = np.empty((0, 2))
    if told is not None:
        weights = weights_of_told(at.along, told)
        none = np.zeros((at.u.size, 2, facts.shape[2]))
        told = told._replace(
            errors=np.concatenate([told.errors, told.residual[:, :, None], none], axis=2)
        )
    seen = eliminated(problem.names, at.jacobian, at.along, np.concatenate(columns, axis=2), told)
    errors, residual, crosstalk, bright = np.split(seen.errors, [k, k + 1, k + 1 + c], axis=1)
    slopes = slopes_of_priors(problem, at.x)
    before = np.zeros(len(errors) - weights.size if weights.size else 0)
    return Rows(
        np.concatenate([residual[:, 0], -at.a, -at.z]),
        np.block([[errors, seen.jacobian], [np.eye(k, k + d)], [np.zeros((d, k)), slopes]]),
        np.vstack([crosstalk, np.zeros((k + d, c))]),
        np.vstack([bright, np.zeros((k + d, bright.shape[1]))]),
        np.concatenate([before, weights.ravel()]),
        at.z - deviations_of(problem, at.x),
        _frames_of_rows(at.along, told is not None),
    )


def _frames_of_rows(along: Array, told: bool) -> NDArray[np.intp]:
    """Return of which frame each row is, in the order of `eliminate`."""
    moves = moving(along)
    still = np.repeat(np.flatnonzero(~moves), 2)
    beside = np.repeat(np.arange(len(along) if told else 0), 2)
    return np.concatenate([np.flatnonzero(moves), still, beside])


def without_size(columns: Array) -> Array:
    """Return columns of length 1, and those of none as they are."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(columns / np.where(size > 0.0, size, 1.0))


def basis(columns: Array) -> Array:
    """Return an orthonormal basis of what columns span, those that are next to nothing left out."""
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > _APART])


def model_checks(problem: FitProblem, top: Erring) -> dict[str, Check]:
    """Look at what a fit whose model errs had to suppose.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Erring
        Its best maximum.

    Returns
    -------
    dict of str to Check
        ``crosstalk``: a score test (Rao 1948) of constant light that the scene says to be another,
        or none at all; ``priors``: the unknowns against their laws. Each is chi-square distributed
        where the scene is as stated, up to what is not linear. ``succession``: whether what is left
        goes on from frame to frame (`succession.goes_on`). Only where a scene states such:
        ``brightness``, a score test of another light of an object whose c2 is a number; and
        ``known_ranges``, what is told of ranges against their own standard deviations.
    """
    rows = rows_of(dataclasses.replace(problem, mode=top.clean.mode), top)
    followed = basis(without_size(rows.followed))

    def left(part: Array) -> Array:
        for _ in range(2):  # the second time takes off what rounding left
            part = part - followed @ (followed.T @ part)
        return part

    target = left(rows.target)
    light = basis(left(without_size(rows.crosstalk)))
    d = top.x.size
    of_priors = followed[rows.target.size - d :]
    share, turn = np.linalg.eigh(np.eye(d) - of_priors @ of_priors.T)
    share = np.minimum(share, 1.0)  # rounding makes more of it where frames tell all
    free = share > FREE
    share, turn = share[free], turn[:, free]
    off = turn.T @ target[rows.target.size - d :]
    # where the unknowns lie, and what pulls them beyond: of a prior that is densest at its end the
    # latter alone says that an unknown should not be there
    place, pull = off + turn.T @ rows.dense, off * np.sqrt((1.0 - share) / share)
    priors = Check(_check(place).statistic + _check(pull).statistic, off.size)
    readings = rows.frames.size
    often = 1.0
    # what large errors leave of each frame is smooth, and no noise
    if share_left(problem, top.positions) < _SMOOTH:
        often = goes_on(target[:readings], followed[:readings], rows.frames)
    checks = {
        "crosstalk": _check(light.T @ target),
        "priors": priors,
        SUCCESSION: Check(float(scipy.special.chdtri(1, often)), 1),
    }
    if rows.brightness.size:
        bright = basis(left(without_size(rows.brightness)))
        checks[BRIGHTNESS] = _check(bright.T @ target)
    if rows.told.size:
        checks[TOLD] = Check(*off_their_own(target[:readings], followed[:readings], rows.told))
    return checks


def free_of(problem: FitProblem, top: Erring) -> float:
    """Return how much of the rows of readings a fit leaves free, of as many degrees of freedom."""
    rows = rows_of(dataclasses.replace(problem, mode=top.clean.mode), top)
    followed = basis(without_size(rows.followed))
    return rows.frames.size - float(np.square(followed[: rows.frames.size]).sum())


def _check(off: Array) -> Check:
    statistic = float(off @ off)
    return Check(statistic if math.isfinite(statistic) else math.inf, off.size)
