"""Whether the frames ask for a larger error of the model than its default (docs/model.md, larger).

The default is the size that errors have of most objects, and known to a factor. Where crosstalk is
unknown, a scene of another size explains the frames nearly as well, and how large the error may be
decides between them: a fit whose best values are improbable says that it is larger.
"""

import dataclasses

from inference.fits.likelihood.problem import FitProblem

__all__ = ["DOUBLINGS", "is_default", "twice_as_large"]

DOUBLINGS = 2  # of the default, at most
_FACTOR = 2.0


def is_default(problem: FitProblem) -> bool:
    """Return whether the flux's error is that of the default, and no law has it otherwise."""
    return not (problem.law or problem.error.integrated) and problem.error.flux > 0.0


def twice_as_large(problem: FitProblem) -> FitProblem:
    """Return the problem with twice the error of the flux."""
    error = dataclasses.replace(problem.error, flux=_FACTOR * problem.error.flux)
    return dataclasses.replace(problem, error=error)
