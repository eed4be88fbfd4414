"""The whole report, cell by cell; what was measured is kept, and a killed run goes on from it."""

import dataclasses
import json
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

from service.report.cells import Cell, Effort, cells_of
from service.report.clock import timed
from service.report.floors import division_s, least_error
from service.report.measure import measure
from service.report.pace import Pace, Spent
from service.report.row import Row, row_from
from service.report.sampled import POSTERIORS, not_tried
from service.report.scenes import ReportScene
from service.report.sources import sources_digest
from service.report.terms import TermCost, term_costs
from simulator.processor_time import compiling_s

__all__ = ["Measured", "Report", "machine", "measured", "report_of"]

Told = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Report:
    """Everything that was measured.

    Attributes
    ----------
    machine : dict of str to str
        What it was measured on.
    seed : int
        Of everything random.
    rows : tuple of Row
        What was measured and what was left out.
    least_errors : dict of str to float or None
        By scene, the median relative error that noise alone leaves.
    division_s : float
        Time of one division a frame [s].
    terms : tuple of TermCost
        What each term costs.
    spent : Spent
        What the measurements took, be they of several runs.
    """

    machine: dict[str, str]
    seed: int
    rows: tuple[Row, ...]
    least_errors: dict[str, float | None]
    division_s: float
    terms: tuple[TermCost, ...]
    spent: Spent

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of the scenes in their order."""
        return tuple(dict.fromkeys(row.scene for row in self.rows))

    def of(self, scene: str) -> list[Row]:
        """Return the rows of one scene."""
        return [row for row in self.rows if row.scene == scene]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "machine": self.machine,
            "seed": self.seed,
            "spent": dataclasses.asdict(self.spent),
            "division_s": self.division_s,
            "least_errors": self.least_errors,
            "terms": [dataclasses.asdict(term) for term in self.terms],
            "rows": [row.to_json() for row in self.rows],
        }


def machine() -> dict[str, str]:
    """Describe the machine and what runs on it."""
    model = platform.processor() or platform.machine()
    told = Path("/proc/cpuinfo")
    if told.exists():
        names = [
            line.partition(":")[2].strip()
            for line in told.read_text(errors="replace").splitlines()
            if line.startswith("model name")
        ]
        model = names[0] if names else model
    return {
        "processor": model,
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "python": platform.python_version(),
        **{name: version(name) for name in ("hybridtof", "numpy", "scipy", "numba", "emcee")},
        "sources": sources_digest(),
    }


class Measured(NamedTuple):
    """One measurement, and the processor time that it took [s], compiling apart and alone."""

    row: Row
    seconds: float
    compiling_s: float


def measured(
    scenes: Sequence[ReportScene],
    effort: Effort,
    seed: int,
    kept: Path,
    tell: Told = lambda _: None,
) -> Iterator[Measured]:
    """Measure what is not measured yet.

    Parameters
    ----------
    scenes : sequence of ReportScene
        The scenes.
    effort : Effort
        How much to measure.
    seed : int
        Of everything random.
    kept : Path
        Where finished cells are kept. What other sources, another effort or another seed measured
        is said, and measured anew.
    tell : callable
        Is told how far it is.

    Yields
    ------
    Measured
        In the order of the scenes, as each is measured or read.
    """
    heading = {
        "sources": sources_digest(),
        "seed": seed,
        "effort": json.loads(json.dumps(dataclasses.asdict(effort))),
    }
    done, reason = _read(kept, heading)
    cells = [cell for scene in scenes for cell in cells_of(scene, effort)]
    if reason:
        tell(f"begins anew: {reason}")
    if not done:
        kept.write_text(json.dumps(heading) + "\n")
    else:
        tell(f"goes on after {len(done)} of {len(cells)} measurements that are in {kept}")
    pace = Pace()
    for cell in cells:
        if cell.key in done:
            pace.learn(cell, done[cell.key].seconds)
    scene, rows = "", list[Row]()
    for number, cell in enumerate(cells):
        if cell.scene.name != scene:
            scene, rows = cell.scene.name, []
            ahead = pace.left_s(c for c in cells[number:] if c.key not in done)
            left = f"about {_minutes(ahead)} of processor time left"
            tell(f"{scene}: measurement {number + 1} of {len(cells)}, {left}")
        one = done.get(cell.key)
        if one is None:
            one = _measured(cell, seed, rows)
            pace.learn(cell, one.seconds)
            _keep(kept, cell, one)
        rows.append(one.row)
        yield one


def _measured(cell: Cell, seed: int, rows: Sequence[Row]) -> Measured:
    """Measure a cell, if what was measured of its scene leaves hope."""
    if cell.family in POSTERIORS:
        for row in rows:
            skipped = not_tried(cell, row)
            if skipped is not None:
                return Measured(skipped, 0.0, 0.0)
    before = compiling_s()
    row, seconds = timed(lambda: measure(cell, seed))
    return Measured(row, seconds, compiling_s() - before)


def _keep(kept: Path, cell: Cell, one: Measured) -> None:
    entry = one._asdict() | {"key": cell.key, "row": one.row.to_json()}
    with kept.open("a") as file:
        file.write(json.dumps(entry) + "\n")


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


_APART = {"sources": "other sources", "seed": "another seed", "effort": "another effort"}


def _read(kept: Path, heading: dict[str, Any]) -> tuple[dict[str, Measured], str]:
    """Return finished cells, or none and why those that are there are of no use.

    A last line that was cut short is no finished cell.
    """
    if not kept.exists():
        return {}, ""
    first, *lines = kept.read_text().splitlines() or [""]
    try:
        found = json.loads(first)
    except ValueError:
        return {}, f"{kept} has no heading that can be read"
    if found != heading:
        apart = [said for name, said in _APART.items() if found.get(name) != heading[name]]
        return {}, f"what {kept} holds was measured with {' and '.join(apart)}"
    done: dict[str, Measured] = {}
    for line in lines:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        row = row_from(entry["row"])
        done[entry["key"]] = Measured(row, entry["seconds"], entry["compiling_s"])
    return done, ""


def report_of(
    rows: Sequence[Row], scenes: Sequence[ReportScene], seed: int, spent: Spent
) -> Report:
    """Put rows together with what no method can do better, and what each term costs."""
    return Report(
        machine(),
        seed,
        tuple(rows),
        {scene.name: least_error(scene) for scene in scenes},
        division_s(),
        tuple(term_costs()),
        spent,
    )
