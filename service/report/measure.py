"""Error and cost of one cell of the report."""

import dataclasses
from collections.abc import Callable

from service.report.cells import Cell
from service.report.fit import measure_fit
from service.report.row import Row
from service.report.said import in_words
from service.report.sampled import measure_posterior
from service.report.single import measure_single
from service.report.tracked import measure_tracker

__all__ = ["measure"]

_BY: dict[str, Callable[[Cell, int], Row]] = {
    "single": measure_single,
    "fit": measure_fit,
    "tracker": measure_tracker,
    "importance": measure_posterior,
    "emcee": measure_posterior,
}


def measure(cell: Cell, seed: int) -> Row:
    """Measure one cell.

    Parameters
    ----------
    seed : int
        Of everything random: figures of error depend on it alone.

    Returns
    -------
    Row
        Without scores, and with the reason, where the method cannot serve the scene.
    """
    row = _BY[cell.family](cell, seed)
    return dataclasses.replace(row, remark=in_words(row.remark))
