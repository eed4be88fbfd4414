"""The verdict on the tables: chi-square p-values of every quantity of every cell."""

import dataclasses
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration.cells import Cell
from benchmarks.calibration.ranks import DRAWS, quantities_of
from benchmarks.calibration.uniformity import chi_square_p

__all__ = ["ALARM", "CellRanks", "cell_ranks", "report"]

ALARM = 0.05  # of the whole study
_MISFIT = 1e-3  # `fit.p_value` below which a misfit is said
_LEVELS = (_MISFIT, 0.01, 0.05)


@dataclasses.dataclass(frozen=True, eq=False)
class CellRanks:
    """What a table holds.

    Attributes
    ----------
    cell : Cell
        The cell.
    ranks : dict of str to ndarray, shape (sets,)
        By quantity; data sets that were refused are missing.
    converged, refused : int
        How many data sets converged; how many were refused an answer.
    fit_p : ndarray
        ``fit.p_value`` of the converged ones.
    least_ess : int
        Fewest effective draws among converged data sets.
    reasons : tuple of str
        Why data sets did not converge, the most frequent first.
    versions : tuple of str
        Of the code.
    """

    cell: Cell
    ranks: dict[str, NDArray[np.int64]]
    converged: int
    refused: int
    fit_p: NDArray[np.float64]
    least_ess: int
    reasons: tuple[str, ...]
    versions: tuple[str, ...]

    @property
    def sets(self) -> int:
        """Number of data sets that have ranks."""
        return len(next(iter(self.ranks.values())))

    @property
    def misfits(self) -> int:
        """Number of converged data sets whose posterior says that the model does not fit."""
        return int(np.sum(self.fit_p < _MISFIT))

    @property
    def p_values(self) -> dict[str, float]:
        """Chi-square p-value of every quantity."""
        return {name: chi_square_p(ranks) for name, ranks in self.ranks.items()}

    @property
    def coverage(self) -> float:
        """Share of the 90 % intervals of the ranked ranges that hold the truth."""
        inside = [
            (ranks >= 0.05 * (DRAWS + 1)) & (ranks < 0.95 * (DRAWS + 1))
            for name, ranks in self.ranks.items()
            if name.startswith("range ")
        ]
        return float(np.mean(inside))


def cell_ranks(cell: Cell, rows: Sequence[dict[str, str]]) -> CellRanks:
    """Read the rows of a cell's table."""
    names = quantities_of(cell)
    ranked = [row for row in rows if row[names[0]]]
    settled = [row for row in ranked if row["converged"] == "1"]
    reasons = Counter(row["reason"].split(" / ")[0] for row in rows if row["converged"] != "1")
    return CellRanks(
        cell,
        {name: np.array([int(row[name]) for row in ranked], dtype=np.int64) for name in names},
        len(settled),
        len(rows) - len(ranked),
        np.array([float(row["fit_p"]) for row in settled]),
        min((int(row["ess"]) for row in settled), default=0),
        tuple(f"{reason} ({count})" for reason, count in reasons.most_common()),
        tuple(sorted({row["version"] for row in rows})),
    )


def report(found: Sequence[CellRanks]) -> str:
    """Return the table of all cells in Markdown, and the verdict."""
    found = [cell for cell in found if cell.sets]
    if not found:
        return "no data set is done"
    tests = sum(len(cell.ranks) for cell in found)
    lines = [
        "| cell | sets | converged | refused | least ESS | misfit said | 90 % intervals of r hold "
        "the truth | least p | of |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    failed = []
    for each in found:
        values = each.p_values
        worst = min(values, key=lambda name: values[name])
        failed += [
            f"{each.cell.name}: {name}, p = {p:.2g}"
            for name, p in values.items()
            if p < ALARM / tests
        ]
        lines.append(
            f"| {each.cell.name} | {each.sets} of {each.cell.sets} | {each.converged} "
            f"| {each.refused} | {each.least_ess} | {each.misfits} | {each.coverage:.1%} "
            f"| {values[worst]:.2g} | {worst} |"
        )
    limit = f"0.05 / {tests} tests = {ALARM / tests:.2g}"
    verdict = "no p-value" if not failed else f"{len(failed)} p-values"
    lines += ["", f"{verdict} below {limit}", *failed]
    fit_p = np.concatenate([cell.fit_p for cell in found])
    shares = ", ".join(
        f"{level:g} in {np.sum(fit_p < level)} ({level * fit_p.size:.3g} if it were even)"
        for level in _LEVELS
    )
    lines += ["", f"fit.p_value of {fit_p.size} posteriors of healthy data is below {shares}"]
    open_sets = [f"{c.cell.name}: {reason}" for c in found for reason in c.reasons]
    lines += ["", "not converged:" if open_sets else "every data set converged", *open_sets]
    versions = sorted({version for cell in found for version in cell.versions})
    lines += ["", f"code: {', '.join(versions)}"]
    return "\n".join(lines)
