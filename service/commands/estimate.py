"""``hybridtof estimate``: deterministic estimates of the frames in a file."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inference.estimates import LeftOut

from service.commands.command import FRAMES_HELP, Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "estimate",
        _run,
        brief="estimate the range of every frame, at once",
        description="Estimate the range of every frame and print the results as JSON, with the "
        "technique that the scene's plan chose (`chosen`) and why each other one cannot serve or "
        "costs more (`left_out`). A row of a file that cannot be read is a frame of status "
        '"none", with the reason.',
        examples="""
            hybridtof estimate frames.csv --scene scene.json
            hybridtof estimate frames.csv --scene scene.json --output ranges.csv
            hybridtof estimate - --scene scene.json --technique conventional < frames.ndjson
        """,
    )
    parser.add_argument("frames", type=Path, help=FRAMES_HELP)
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument(
        "--technique",
        action="append",
        metavar="NAME",
        help="technique to use, may be repeated; left out: the cheapest that fits the scene",
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="write the results here instead, as .csv, .ndjson (a row or line a frame) or .json",
    )


def _run(args: argparse.Namespace) -> int:
    import json

    from inference.estimate import estimate
    from service.answers.encoding import encode_estimates
    from service.bad_rows import insert_answers
    from service.commands.files import check_folder, naming
    from service.commands.frames import checked
    from service.commands.output import write_result
    from service.estimate_files import check_estimate_suffix, estimates_as
    from service.plausibility import doubts

    if args.output is not None:
        check_estimate_suffix(args.output)
        check_folder("--output", args.output)
    sensor, scene, frames, table = checked(args)
    sources = {"/frames": str(args.frames), "/techniques": "--technique", "": str(args.scene)}
    with naming(sources):
        estimates = estimate(sensor, scene, frames, args.technique)
    encoded = encode_estimates(estimates)
    if table.bad or args.output is not None:
        document = json.loads(encoded)
        insert_answers(document, table.bad)
        if args.output is None:
            encoded = json.dumps(document, allow_nan=False).encode("ascii")
        else:
            args.output.write_text(estimates_as(args.output.suffix, document), encoding="utf-8")
    if args.output is None:
        write_result(encoded)
    if estimates.do_first is not None:
        note(args, f"no ranges; do this first: {estimates.do_first}")
    for result in estimates.results:
        if result.fit is not None and result.fit["misfit"]:
            note(
                args,
                f"note: {result.technique} gives no ranges: its fit does not explain the frames "
                f"(misfit, p value {result.fit['p_value']:.2g}): "
                f"{'; '.join(result.fit['reasons'])}",
            )
    doubted = doubts(sensor, frames)  # said already
    for supposed in estimates.assumptions:
        if supposed not in doubted:
            note(args, f"note: {supposed}")
    if not estimates.results and args.output is not None and args.output.suffix.lower() != ".json":
        for line in _why(estimates.left_out):
            note(args, f"note: {line}")
    return 0 if estimates.results else 3


def _why(left_out: "tuple[LeftOut, ...]") -> list[str]:
    """Return a line for each reason, with all the techniques that it is the reason of."""
    of_reason: dict[str, list[str]] = {}
    for item in left_out:
        of_reason.setdefault(item.reason, []).append(item.name)
    return [f"{', '.join(names)}: {reason}" for reason, names in of_reason.items()]
