"""What a fit that does not explain its frames puts that down to: single frames, an unknown."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.answer.model_checks import Rows, basis, model_checks, rows_of, without_size
from inference.fits.answer.report import fit_report
from inference.fits.likelihood.erring import Erring, erring_maxima
from inference.fits.likelihood.erring_point import deviations_of
from inference.fits.likelihood.places import places_of
from inference.fits.likelihood.prior_maxima import prior_maxima
from inference.fits.likelihood.problem import FitProblem
from simulator.errors import listed

__all__ = ["blamed", "frames_alone"]

Array = NDArray[np.float64]

_FALSE_ALARM = 1e-3  # of chi-square without the frames that are named
# of a healthy frame: that it is named where others are
_HEALTHY = 1e-6
# no more of them are named; as many as that are no exceptions
_NAMED, _SHARE = 5, 0.1
_FREE = 1e-9  # least variance that the fit leaves of a frame that is looked at
_OF_GAIN = (
    ", and has the sensor's gain in it: where nobody measured that, state that nothing is known of "
    "c2, by a lognormal prior of sigma 4 about the reading of a near object times the square of "
    "its range"
)
_FAR = 3.0  # standard deviations of its prior, from where on an unknown is named


def blamed(problem: FitProblem, top: Erring, sent: NDArray[np.intp]) -> list[str]:
    """Name what alone makes a fit a misfit, for a person.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Erring
        Its best maximum.
    sent : ndarray of int, shape (n,)
        Place of each frame of the problem among those that were sent.

    Returns
    -------
    list of str
        Empty where neither a few frames nor an unknown far off its prior is to blame.
    """
    said = []
    if alone := frames_alone(problem, top) or _fitted_without(problem, top):
        of = sorted(int(sent[frame]) for frame in alone)
        word, verb = ("frame", "alone makes") if len(of) == 1 else ("frames", "alone make")
        said.append(
            f"{word} {listed([str(n) for n in of])} (counted from 0) {verb} the readings unlike "
            "the model, the others fit: leave out what is of something else"
        )
    off = deviations_of(dataclasses.replace(problem, mode=top.clean.mode), top.x)
    for far in np.argsort(-np.abs(off), kind="stable"):
        if not abs(off[far]) >= _FAR:
            break
        name = problem.names[far]
        text = f"{name} lies {abs(off[far]):.2g} standard deviations of its prior off"
        said.append(text + (_OF_GAIN if name == "object.c2" else ""))
    return said


def frames_alone(problem: FitProblem, top: Erring) -> Sequence[int]:
    """Return the few frames without which the fit would explain all others.

    What is left of a row over what the fit leaves of its variance is what chi-square would lose
    without it, errors and unknowns fitted anew, where all is linear (studentised residuals: Cook
    and Weisberg 1982, 2.2). The worst frame is taken out, and the rest asked again.

    Returns
    -------
    sequence of int
        Of the problem, the worst first; none where a tenth of all, five at most, is not enough.
    """
    rows = rows_of(dataclasses.replace(problem, mode=top.clean.mode), top)
    followed = basis(without_size(rows.followed))
    m = rows.frames.size
    named: list[int] = []
    for _ in range(_most(problem) + 1):
        left, loss = _losses(rows, followed)
        if scipy.special.chdtrc(1, float(loss.max())) * m >= _HEALTHY:
            freedom = max(left.size - followed.shape[1], 1)
            fits = scipy.special.chdtrc(freedom, float(left @ left)) >= _FALSE_ALARM
            return named if fits else ()
        worst = int(rows.frames[np.argmax(loss)])
        named.append(worst)
        own = np.zeros((left.size, np.count_nonzero(rows.frames == worst)))
        own[np.flatnonzero(rows.frames == worst), np.arange(own.shape[1])] = 1.0
        followed = basis(np.hstack([followed, own]))
    return ()


def _most(problem: FitProblem) -> int:
    """Return how many frames may be exceptions."""
    return min(_NAMED, max(int(_SHARE * len(problem.frames)), 1))


def _losses(rows: Rows, followed: Array) -> tuple[Array, Array]:
    """Return what a fit leaves of its rows, and what chi-square would lose without each."""
    left, m = rows.target, rows.frames.size
    for _ in range(2):  # the second time takes off what rounding left
        left = left - followed @ (followed.T @ left)
    share = 1.0 - np.square(followed[:m]).sum(axis=1)
    loss = np.where(share > _FREE, np.square(left[:m]) / np.maximum(share, _FREE), 0.0)
    return left, loss


def _fitted_without(problem: FitProblem, top: Erring) -> Sequence[int]:
    """Return frames without which a fit that is made anew explains the others.

    Frames that are far off bend a fit so much that nothing is linear. So the worst is left out of a
    new one; and, since several of them hide one another, all that read zero, which were as a rule
    not measured.
    """
    rows = rows_of(dataclasses.replace(problem, mode=top.clean.mode), top)
    _, loss = _losses(rows, basis(without_size(rows.followed)))
    zero = np.flatnonzero((problem.frames[:, :2] == 0.0).all(axis=1))
    for out in (rows.frames[[np.argmax(loss)]], zero):
        if not 0 < out.size <= _most(problem):
            continue
        rest = _without(problem, top, out)
        climb = prior_maxima if problem.priors else erring_maxima
        start = dataclasses.replace(top, positions=np.delete(top.positions, out))
        ends = climb(rest, [start])
        if any(_fits(rest, end) for end in ends):
            return [int(frame) for frame in out]
    return ()


def _fits(problem: FitProblem, end: Erring) -> bool:
    """Return whether a fit passes all checks: of one that fails another, no frame is to blame."""
    checks = model_checks(problem, end)
    return not fit_report(problem, [end], end.chi_square, 0, 1.0, checks)["misfit"]


def _without(problem: FitProblem, top: Erring, out: NDArray[np.intp]) -> FitProblem:
    """Return the problem of all other frames."""
    kept = np.delete(np.arange(len(problem.frames)), out)
    frames, present = problem.frames[kept], problem.present[kept]
    known = None if problem.known is None else problem.known.select(kept)
    places = None
    if problem.places is not None:
        places = places_of(frames, present, problem.instrument)
    return dataclasses.replace(
        problem,
        frames=frames,
        present=present,
        known=known,
        places=places,
        mode=top.clean.mode,
    )
