"""The command ``hybridtof report``."""

import argparse
import dataclasses
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from service.report.measure import Row

from service.commands.command import Subparsers, add_command, can_draw, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "report",
        _run,
        brief="measure error against run time of every technique and of the posterior",
        description="Measure error against run time on four simulated scenes: a table on standard "
        "output, report.json and report.png in a directory.",
        examples="""
            hybridtof report --quick
            hybridtof report --out measured
        """,
    )
    parser.add_argument(
        "--quick", action="store_true", help="small batches: seconds instead of minutes"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="(%(default)s)"
    )


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.2%}" if value < 10 else f"{value:.0f}x"


def table(rows: "Iterable[Row]") -> str:
    """Return the report as text; a blank line divides scenes."""
    header = (
        f"{'technique':<36}{'frames':>8}{'single':>8}{'holds':>8}{'median':>9}{'90 %':>9}"
        f"{'us/frame':>12}  remark"
    )
    lines: list[str] = []
    scene = None
    for row in rows:
        if row.scene != scene:
            scene = row.scene
            lines += ["", f"scene: {scene}", header]
        lines.append(
            f"{row.technique:<36}{row.frames:>8}{row.answered:>8.0%}{row.holds_truth:>8.0%}"
            f"{_percent(row.median_error):>9}{_percent(row.p90_error):>9}"
            f"{row.frame_s * 1e6:>12.3g}  {row.remark}".rstrip()
        )
    legend = (
        "single: share of frames with one range; holds: share in which a root within two standard "
        "deviations,\nor the posterior's 90 % interval, has the truth; median, 90 %: quantiles of "
        "the relative error of single ranges"
    )
    return "\n".join([*lines, "", legend, ""])


def _run(args: argparse.Namespace) -> int:
    from service.report.measure import FULL, QUICK, measure
    from service.report.scenes import SCENES

    drawing = can_draw(args)
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for scene in SCENES:
        note(args, scene.name)
        rows += list(measure(scene, QUICK if args.quick else FULL))
    sys.stdout.write(table(rows))
    path = args.out / "report.json"
    path.write_text(json.dumps([dataclasses.asdict(row) for row in rows], indent=1) + "\n")
    if not drawing:
        return 0
    from service.report.picture import draw

    draw(rows, args.out / "report.png")
    sys.stdout.write(f"{path}, {args.out / 'report.png'}\n")
    return 0
