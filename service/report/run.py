"""The whole report, cell by cell; what was measured is kept, and a killed run goes on from it."""

import dataclasses
import json
import os
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from service.report.cells import Effort, cells_of
from service.report.floors import division_s, least_error
from service.report.measure import measure
from service.report.row import Row, row_from
from service.report.scenes import ReportScene
from service.report.terms import TermCost, term_costs

__all__ = ["Report", "machine", "report_of", "rows_of"]

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
    """

    machine: dict[str, str]
    seed: int
    rows: tuple[Row, ...]
    least_errors: dict[str, float | None]
    division_s: float
    terms: tuple[TermCost, ...]

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
    }


def rows_of(
    scenes: Sequence[ReportScene],
    effort: Effort,
    seed: int,
    kept: Path,
    tell: Told = lambda _: None,
) -> Iterator[Row]:
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
        Where finished cells are kept. One of another version, effort or seed is begun anew.
    tell : callable
        Is told how far it is.

    Yields
    ------
    Row
        In the order of the scenes, as each is measured or read.
    """
    heading = {
        "version": version("hybridtof"),
        "seed": seed,
        "effort": json.loads(json.dumps(dataclasses.asdict(effort))),
    }
    done = _read(kept, heading)
    cells = [cell for scene in scenes for cell in cells_of(scene, effort)]
    if not done:
        kept.write_text(json.dumps(heading) + "\n")
    else:
        tell(f"goes on after {len(done)} of {len(cells)} measurements that are in {kept}")
    spent = foreseen = 0.0
    ahead = sum(cell.seconds for cell in cells if cell.key not in done)
    scene = ""
    for number, cell in enumerate(cells):
        if cell.scene.name != scene:
            scene = cell.scene.name
            pace = spent / foreseen if foreseen > 5 else 1.0
            left = _minutes(ahead * pace)
            tell(f"{scene}: measurement {number + 1} of {len(cells)}, about {left} left")
        if cell.key in done:
            yield done[cell.key]
            continue
        began = time.process_time()
        row = measure(cell, seed)
        used = time.process_time() - began
        spent, foreseen, ahead = spent + used, foreseen + cell.seconds, ahead - cell.seconds
        with kept.open("a") as file:
            file.write(json.dumps({"key": cell.key, "row": row.to_json()}) + "\n")
        yield row


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _read(kept: Path, heading: dict[str, Any]) -> dict[str, Row]:
    """Return finished cells; a last line that was cut short is no finished cell."""
    try:
        first, *lines = kept.read_text().splitlines()
        if json.loads(first) != heading:
            return {}
    except (OSError, ValueError):
        return {}
    done: dict[str, Row] = {}
    for line in lines:
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        done[entry["key"]] = row_from(entry["row"])
    return done


def report_of(rows: Sequence[Row], scenes: Sequence[ReportScene], seed: int) -> Report:
    """Put rows together with what no method can do better, and what each term costs."""
    return Report(
        machine(),
        seed,
        tuple(rows),
        {scene.name: least_error(scene) for scene in scenes},
        division_s(),
        tuple(term_costs()),
    )
