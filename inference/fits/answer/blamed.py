"""What a fit that does not explain its frames puts that down to: single frames, an unknown."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.answer.model_checks import basis, rows_of, without_size
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import deviations_of
from inference.fits.likelihood.problem import FitProblem
from simulator.errors import listed

__all__ = ["blamed", "frames_alone"]

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
    if alone := frames_alone(problem, top):
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
    m, n = rows.frames.size, len(problem.frames)
    named: list[int] = []
    for _ in range(min(_NAMED, max(int(_SHARE * n), 1)) + 1):
        left = rows.target
        for _ in range(2):  # the second time takes off what rounding left
            left = left - followed @ (followed.T @ left)
        share = 1.0 - np.square(followed[:m]).sum(axis=1)
        loss = np.where(share > _FREE, np.square(left[:m]) / np.maximum(share, _FREE), 0.0)
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
