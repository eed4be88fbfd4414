"""Notebooks over many seeds: do their intervals hold the truth as often as they say.

    python -m benchmarks.notebook_truth --out DIR [--seeds 20] [--only NAME...]

A notebook's cells are run as they stand but for the seeds of noise, draws and samplers, which are
moved on by the number of the run; of `frames.csv` the command that made it is repeated. Run 0 is
the notebook as it lies there. Every finished run is a line of DIR/notebooks.ndjson, and is not done
again. Prints for every notebook how often its own check passed, and for everything that it states
an interval of the share of 90 % intervals that hold the truth: the mean over runs, since intervals
of one run err together, its standard error, and by how many of these it is off. The exit code is 1
where a share lies more than 3 standard errors below 90 %.
"""

import argparse
import ast
import contextlib
import io
import itertools
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import hybridtof
from benchmarks.resumable import objects_of

__all__ = ["HELD", "NOTEBOOKS", "executed", "held_by", "with_seeds"]

NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
_Z = 1.6448536269514722  # of a 90 % interval
_LEAST = 0.02  # of the spread between runs: few runs that agree are no proof
_BAR = 3.0  # standard errors: below by as much once in 700 tables of one row

Array = NDArray[np.float64]
Names = Mapping[str, Any]
Flags = dict[str, NDArray[np.bool_]]


def _normal(found: Any, truth: Array) -> NDArray[np.bool_]:
    """Of ranges with standard deviations: which intervals hold the truth, where there is one."""
    there = np.isfinite(found.range_m)
    off = np.abs(found.range_m - truth)[there]
    return np.asarray(off < _Z * found.sd_m[there])


def _drawn(ranges: Any, truth: Array) -> NDArray[np.bool_]:
    return np.asarray((ranges.q05 <= truth) & (truth <= ranges.q95))


def _first_ranges(names: Names) -> Flags:
    truth = names["truth"]
    return {
        "each frame alone": _normal(names["found"], truth),
        "posterior": _drawn(names["ranges"], truth),
    }


def _cover_glass(names: Names) -> Flags:
    truth = names["truth"]
    return {
        f"posterior {label}": (low <= truth) & (truth <= high)
        for label, (_, low, _, high) in names["answers"].items()
    }


def _wall_behind(names: Names) -> Flags:
    truth = names["truth"]
    found = {label: _normal(one, truth) for label, one in names["found"].items()}
    return found | {"posterior": _drawn(names["ranges"], truth)}


def _two_roots(names: Names) -> Flags:
    return {"tracker": _normal(names["track"], names["truth"])}


def _diagnostics(names: Names) -> Flags:
    return {
        "posterior": _drawn(names["found"], names["truth"]),
        "common error": np.abs([names["away"]]) < _Z,
    }


def _field(names: Names) -> Flags:
    away, truth = names["away"], names["truth"]
    return {
        "window and phase": np.abs(list(away.values())) < _Z,
        "calibrated, frame by frame": _normal(names["alone"], truth),
        "calibrated, tracker": _normal(names["track"], truth),
    }


def _stream(names: Names) -> Flags:
    return {"stream": names["off"] < _Z}


def _checked(names: Names) -> Flags:
    return {"ranges": _drawn(names["right"][0].range_m, names["truth"])}


def _cannot_be_known(names: Names) -> Flags:
    return {"fit by the priors": _normal(names["fit"], names["way"])}


def _none(_names: Names) -> Flags:
    return {}


# what each states an interval of; one has a truth but no intervals
HELD: dict[str, Callable[[Names], Flags]] = {
    "cannot_be_known.ipynb": _cannot_be_known,
    "cover_glass.ipynb": _cover_glass,
    "error_against_run_time.ipynb": _none,
    "field_calibration.ipynb": _field,
    "first_ranges.ipynb": _first_ranges,
    "intervals_checked.ipynb": _checked,
    "posterior_diagnostics.ipynb": _diagnostics,
    "stream.ipynb": _stream,
    "two_roots.ipynb": _two_roots,
    "wall_behind.ipynb": _wall_behind,
}


class _Moved(ast.NodeTransformer):
    """Moves all seeds on by a number, and has frames from a file simulated anew."""

    def __init__(self, run: int) -> None:
        self.run = run

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        function = node.func
        name = function.attr if isinstance(function, ast.Attribute) else ast.unparse(function)
        if name == "read_frames" and self.run:
            node.func = ast.Name("simulated_anew", ast.Load())
        seeds = [word.value for word in node.keywords if word.arg == "seed"]
        if name in ("simulate", "default_rng"):
            seeds += node.args[-1:]
        for seed in seeds:
            if isinstance(seed, ast.Constant) and isinstance(seed.value, int):
                seed.value += 1000 * self.run
        return node


def with_seeds(code: str, run: int) -> str:
    """Return code whose seeds are moved on by thousands.

    Parameters
    ----------
    code : str
        Of a cell. Seeds are numbers: the last argument of ``simulate`` and of ``default_rng``, and
        whatever is named ``seed``.
    run : int
        By how many thousands.
    """
    return ast.unparse(_Moved(run).visit(ast.parse(code)))


def executed(name: str, run: int = 0) -> tuple[dict[str, Any], str, bool]:
    """Run a notebook's cells in this process.

    Parameters
    ----------
    name : str
        Of its file.
    run : int
        By how many thousands its seeds are moved on.

    Returns
    -------
    (dict, str, bool)
        Its names, what it printed, and whether its own check passed.
    """

    def simulated_anew(_sensor: Any, _path: str) -> Any:
        given = json.loads(Path("simulated.json").read_text(encoding="utf-8"))
        sensor = hybridtof.parse_sensor(given["sensor"])
        way = hybridtof.RadialTrajectory(from_m=0.15, to_m=1.2, frames=30, spacing="log")
        scene = hybridtof.parse_scene(given["scene"])
        return hybridtof.simulate(sensor, scene, way, 7 + 1000 * run).frames

    names: dict[str, Any] = {"simulated_anew": simulated_anew}
    said, passed = io.StringIO(), True
    with _in_folder(), mpl.rc_context(), contextlib.redirect_stdout(said):
        try:
            for code in _cells(name):
                exec(compile(with_seeds(code, run), name, "exec"), names)  # noqa: S102  # our own
        except AssertionError:
            passed = False
        finally:
            plt.close("all")
    return names, said.getvalue(), passed


def _cells(name: str) -> list[str]:
    notebook = json.loads((NOTEBOOKS / name).read_text(encoding="utf-8"))
    return ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]


@contextlib.contextmanager
def _in_folder() -> Iterator[None]:
    """Stand where the notebooks lie, and draw pictures for nobody."""
    with contextlib.chdir(NOTEBOOKS), patch.object(plt, "show", lambda: plt.close("all")):
        yield


def held_by(name: str, names: Names) -> Flags:
    """Return which of a notebook's 90 % intervals hold the truth, by what they are of."""
    return HELD[name](names)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", nargs="+", choices=sorted(HELD), default=sorted(HELD))
    options = parser.parse_args()
    mpl.use("Agg")
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "notebooks.ndjson"
    done = {(row["notebook"], row["run"]): row for row in objects_of(path)}
    with path.open("a", encoding="utf-8") as lines:
        # run by run, so that a table of fewer runs has all notebooks
        for run, name in itertools.product(range(options.seeds), options.only):
            if (name, run) in done:
                continue
            names, _, passed = executed(name, run)
            held = {label: flags.tolist() for label, flags in held_by(name, names).items()}
            done[name, run] = {"notebook": name, "run": run, "passed": passed, "held": held}
            lines.write(json.dumps(done[name, run]) + "\n")
            lines.flush()
    rows = [
        [done[name, run] for run in range(options.seeds) if (name, run) in done]
        for name in options.only
    ]
    print("| notebook | runs | its check passed | 90 % intervals of | hold the truth | off |")
    print("|---|---|---|---|---|---|")
    low = [_printed(runs) for runs in rows]
    sys.exit(1 if any(low) else 0)


def _printed(runs: list[dict[str, Any]]) -> bool:
    """Print the rows of a notebook; say whether a share is too low."""
    name, passed = runs[0]["notebook"], sum(run["passed"] for run in runs)
    low = False
    for label in runs[0]["held"] or [""]:
        row = f"| `{name}` | {len(runs)} | {passed} | {label or '-'} |"
        if not label:
            print(f"{row} - | - |")
            continue
        shares = np.array([np.mean(run["held"][label]) for run in runs if run["held"][label]])
        error = max(float(np.std(shares, ddof=1)), _LEAST) / math.sqrt(len(shares))
        off = (float(shares.mean()) - 0.9) / error
        print(f"{row} {100 * shares.mean():.0f} +- {100 * error:.0f} % | {off:+.1f} |")
        low |= off < -_BAR
    return low


if __name__ == "__main__":
    main()
