"""What follows where data pull an answer beyond a prior: the model is wrong, its draws are not.

A posterior that piles up at the end of a prior is exactly what the scene states. That the data are
far from believing it is a finding of the model, of which the prior is a part.
"""

import dataclasses

from inference.identifiability.status import Identifiability, weak_at_best
from inference.posterior.answer.fit import Fit

__all__ = ["contradicted"]


def contradicted(
    fit: Fit, rows: tuple[Identifiability, ...], conflicts: tuple[str, ...]
) -> tuple[Fit, tuple[Identifiability, ...]]:
    """Take conflicts with priors into the account of the model.

    Parameters
    ----------
    fit : Fit
        As checked against replicates.
    rows : tuple of Identifiability
        As judged by the draws.
    conflicts : tuple of str
        From `prior_conflicts`: false in at most 2.2e-5 of runs for each unknown.

    Returns
    -------
    (Fit, tuple of Identifiability)
        With a conflict a misfit, and rows that are `weak` at best: every unknown is pulled by the
        one that cannot go where the data want it.
    """
    if not conflicts:
        return fit, rows
    fit = dataclasses.replace(fit, misfit=True, reasons=(*fit.reasons, *conflicts))
    because = f"but the data contradict a prior ({conflicts[0]})"
    return fit, weak_at_best(rows, because)
