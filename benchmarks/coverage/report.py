"""Tables of coverage: by class of scene with a bootstrap over data sets, and cell by cell."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["GOAL", "SETS", "Coverage", "confidently_wrong", "coverage", "recorded_report", "report"]

GOAL = (0.85, 0.95)  # of what stands by default, in every class
SETS = 50  # that make a class complete
_RESAMPLES = 4000
_LEAST_INSIDE = 0.8


@dataclasses.dataclass(frozen=True)
class Coverage:
    """What the rows of a class say.

    Attributes
    ----------
    name, term : str
        Class of scenes; what inference is told, a key of `TERMS`.
    sets : int
        Data sets, refused ones included; those hold nothing.
    inside, low, high : float
        Share of intervals that hold the truth, and its 95 % interval by bootstrap over data sets.
    width : float
        Median over data sets of the relative width.
    error : float
        Median over data sets of the modulus of the relative error.
    warned : int
        Data sets that say that the model does not fit, or that the scale is not identified.
    inside_unwarned : float
        Share of intervals that hold the truth among the others; nan where there are none.
    converged, refused : int
        Data sets.
    seconds : float
        Median over data sets of the processor time.
    """

    name: str
    term: str
    sets: int
    inside: float
    low: float
    high: float
    width: float
    error: float
    warned: int
    inside_unwarned: float
    converged: int
    refused: int
    seconds: float

    @property
    def reached(self) -> bool:
        """Whether the share is within the goal."""
        return GOAL[0] <= self.inside <= GOAL[1]


def _bootstrap(shares: NDArray[np.float64]) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    means = rng.choice(shares, size=(_RESAMPLES, shares.size)).mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(low), float(high)


def _warned(row: dict[str, str]) -> bool:
    return row["misfit"] == "1" or row["scale"] == "not_identified"


def coverage(name: str, term: str, rows: Sequence[dict[str, str]]) -> Coverage:
    """Sum up the rows of a class, at least one."""
    shares = np.array([float(row["inside"] or 0.0) for row in rows])
    answered = [row for row in rows if row["inside"]]
    unwarned = [float(row["inside"]) for row in answered if not _warned(row)]
    low, high = _bootstrap(shares)
    return Coverage(
        name,
        term,
        len(rows),
        float(shares.mean()),
        low,
        high,
        float(np.median([float(row["width"]) for row in answered] or [np.nan])),
        float(np.median([abs(float(row["error"])) for row in answered] or [np.nan])),
        sum(_warned(row) for row in answered),
        float(np.mean(unwarned)) if unwarned else float("nan"),
        sum(row["converged"] == "1" for row in rows),
        len(rows) - len(answered),
        float(np.median([float(row["seconds"]) for row in answered] or [np.nan])),
    )


def report(found: Sequence[Coverage]) -> str:
    """Return the table of all classes in Markdown, and which miss the goal."""
    lines = [
        "| class | term | sets | inside | 95 % by bootstrap | relative width | error | say misfit "
        "or not identified | inside, others | converged | refused | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {c.name} | {c.term} | {c.sets} | {c.inside:.0%} | {c.low:.0%}-{c.high:.0%} "
        f"| {c.width:.2%} | {c.error:.2%} | {c.warned} "
        f"| {'' if np.isnan(c.inside_unwarned) else f'{c.inside_unwarned:.0%}'} "
        f"| {c.converged} | {c.refused} | {c.seconds:.1f} |"
        for c in found
    ]
    told = [c for c in found if c.term == "default" and not c.reached]
    missed = [f"{c.name}: {c.inside:.1%} ({c.low:.0%}-{c.high:.0%})" for c in told]
    goal = f"{GOAL[0]:.0%} to {GOAL[1]:.0%} by default"
    lines += ["", f"outside {goal}: {'; '.join(missed) or 'none that was run'}"]
    few = [f"{c.name}, {c.term}: {c.sets}" for c in found if c.sets < SETS]
    lines += [f"fewer than {SETS} data sets: {'; '.join(few) or 'none'}"]
    return "\n".join(lines)


def confidently_wrong(row: dict[str, str]) -> bool:
    """Whether a cell holds the truth in too few positions without a word of warning."""
    return bool(row["inside"]) and float(row["inside"]) < _LEAST_INSIDE and not _warned(row)


def recorded_report(rows: Sequence[tuple[str, dict[str, str]]]) -> str:
    """Return the table of the recorded cells in Markdown: pairs of term and row."""
    lines = [
        "| cell | term | inside | relative width | error | says | converged | confidently wrong |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for term, row in rows:
        if not row["inside"]:
            lines.append(f"| {row['scene']} | {term} | | | | {row['reason']} | 0 | |")
            continue
        says = ["misfit"] if row["misfit"] == "1" else []
        says.append(f"scale {row['scale'].replace('_', ' ')}")
        lines.append(
            f"| {row['scene']} | {term} | {float(row['inside']):.0%} | {float(row['width']):.2%} "
            f"| {float(row['error']):+.1%} | {', '.join(says)} | {row['converged']} "
            f"| {'YES' if confidently_wrong(row) else 'no'} |"
        )
    for name in dict.fromkeys(term for term, _ in rows):
        wrong = sum(confidently_wrong(row) for term, row in rows if term == name)
        lines += ["", f"{name}: {wrong} of {sum(t == name for t, _ in rows)} confidently wrong"]
    return "\n".join(lines)
