"""The command ``hybridtof report``."""

import argparse
import itertools
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from service.commands.command import Subparsers, add_command, can_draw, note

if TYPE_CHECKING:
    from service.report.row import Row

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "report",
        _run,
        brief="measure error against run time of every method on a catalogue of scenes",
        description="Measure error, honesty and cost of every technique, fit, tracker and "
        "posterior on a catalogue of scenes: lines on standard output as they come, and in a "
        "directory report.html (one page that needs nothing else), report.md, report.json and "
        "report.png. A run that was killed goes on where it was.",
        examples="""
            hybridtof report --quick
            hybridtof report --out measured
        """,
    )
    parser.add_argument(
        "--quick", action="store_true", help="seven scenes and small batches: minutes, not an hour"
    )
    parser.add_argument("--seed", type=int, default=1, help="of everything random (%(default)s)")
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="(%(default)s)"
    )


def _run(args: argparse.Namespace) -> int:
    from simulator.compiled import compiling_at_once

    drawing = can_draw(args)
    # else the first of its calls might be timed while the interpreter answers them
    with compiling_at_once():
        return _report(args, drawing)


def _report(args: argparse.Namespace, drawing: bool) -> int:
    args.out.mkdir(parents=True, exist_ok=True)
    from service.report.cells import FULL, QUICK
    from service.report.light import light_rows
    from service.report.pace import Spent
    from service.report.page import markdown_page, page
    from service.report.run import measured, report_of
    from service.report.scenes import SCENES
    from service.report.table import LEGEND, heading, line

    scenes = [scene for scene in SCENES if scene.quick or not args.quick]
    kept = args.out / "report.part.ndjson"
    rows = []
    scene = ""
    effort = QUICK if args.quick else FULL
    spent = Spent()

    def counted() -> Iterator["Row"]:
        nonlocal spent
        for one in measured(scenes, effort, args.seed, kept, lambda text: note(args, text)):
            spent = spent.plus(one.seconds, one.compiling_s)
            yield one.row

    for row in itertools.chain(counted(), light_rows(effort)):
        if row.scene != scene:
            scene = row.scene
            sys.stdout.write(heading(scene) + "\n")
        if row.scores is not None:
            sys.stdout.write(line(row) + "\n")
            sys.stdout.flush()
        rows.append(row)
    note(args, "what each term costs")
    report = report_of(rows, scenes, args.seed, spent)
    sys.stdout.write(f"\n{LEGEND}\n")
    pictures: dict[str, str] = {}
    terms, snr = "", None
    if drawing:
        from service.report.picture import draw_scene, draw_snr, draw_summary, draw_terms, svg

        pictures = {name: svg(draw_scene(report, name)) for name in report.scenes}
        terms = svg(draw_terms(report.terms))
        alike = [x for x in SCENES if x.name.startswith(("Bare", "Signal"))]
        kinds = {"Pulse": "pulsed", "Sine wave": "sine_wave"}
        ratios = {
            title: {x.name: x.snr for x in alike if x.sensor.kind == kind}
            for title, kind in kinds.items()
        }
        drawn = draw_snr(report, ratios)
        snr = None if drawn is None else svg(drawn)
        draw_summary(report, args.out / "report.png")
    written = {
        "report.html": page(report, pictures, terms, snr),
        "report.md": markdown_page(report),
        "report.json": json.dumps(report.to_json(), indent=1) + "\n",
    }
    for name, text in written.items():
        (args.out / name).write_text(text, encoding="utf-8")
    kept.unlink()
    names = [*written, *(["report.png"] if drawing else [])]
    sys.stdout.write(", ".join(str(args.out / name) for name in names) + "\n")
    return 0
