"""What noise that every frame's range follows has made of a fit: the ranges integrated out."""

import math
from collections.abc import Sequence

import numpy as np

from inference.density.frame_integrals import fill_log_likelihoods
from inference.fits.likelihood.deviance import open_values
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import standard
from inference.fits.likelihood.maximum import DECIDED

__all__ = ["integrated_deviance", "with_integrated_first"]


def integrated_deviance(end: Erring) -> float:
    """Return -2 log of the posterior of the unknowns, every range integrated out.

    Ranges have the reference prior of posteriors, to which those in the dark are together one
    state of the readings (docs/model.md, reference-prior).

    Parameters
    ----------
    end : Erring
        Where; the errors of the model are what they are there.

    Returns
    -------
    float
        Up to a constant of the frames; inf where the unknowns have no likelihood.
    """
    problem = end.clean
    fit = problem.kernel_fit()
    open_values(problem.values(end.x), fit)
    fit = fit._replace(rows=fit.rows._replace(resolves=True))
    each = np.empty((1, problem.present.size))
    fill_log_likelihoods(each, fit.rows, fit.data, fit.instrument)
    z = standard(problem, end.x[None])[0]
    total = float(z @ z + end.a @ end.a - 2.0 * each.sum())
    return total if math.isfinite(total) else math.inf


def with_integrated_first(
    found: Sequence[Erring], along: Sequence[Erring]
) -> tuple[list[Erring], list[Erring]]:
    """Put what is best with the ranges integrated out first, where the best fit is not.

    Where readings lie along a line within their noise, the ranges of frames in the dark follow
    their noise, and many of them together outweigh what the others tell. The best fit stays among
    what is not decided against.

    Parameters
    ----------
    found : sequence of Erring
        Maxima, the best first.
    along : sequence of Erring
        Points beside them.

    Returns
    -------
    (list of Erring, list of Erring)
        The same; the first may be one of the points.
    """
    points = [*found, *along]
    each = [integrated_deviance(point) for point in points]
    best = int(np.argmin(each))
    if not each[best] < each[0] - DECIDED:
        return list(found), list(along)
    return [points[best], *(one for one in found if one is not points[best])], list(along)
