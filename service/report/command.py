"""The command ``hybridtof report``."""

import argparse
import dataclasses
import json
import sys
from pathlib import Path

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


def _run(args: argparse.Namespace) -> int:
    from service.report.measure import FULL, QUICK, measure
    from service.report.scenes import SCENES
    from service.report.table import table

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
