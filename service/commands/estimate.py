"""``hybridtof estimate``: deterministic estimates of the frames in a file."""

import argparse
from pathlib import Path

__all__ = ["add_parser"]


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "estimate",
        help="estimate the range of every frame, at once",
        description="Estimate the range of every frame and print the results as JSON.",
    )
    parser.add_argument("frames", type=Path, help="frames as .csv, .ndjson or .json")
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument(
        "--technique",
        action="append",
        metavar="NAME",
        help="technique to use, may be repeated; left out: the cheapest that fits the scene",
    )
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from inference.estimate import estimate
    from service.checks import system_with_frames
    from service.commands.files import naming, read_columns, read_document
    from service.commands.output import write_result
    from service.estimate_json import encode_estimates
    from service.schemas import SystemDescription

    system = read_document(SystemDescription, args.scene)
    columns = read_columns(args.frames)
    sources = {"/frames": str(args.frames), "/techniques": "--technique", "": str(args.scene)}
    with naming(sources):
        sensor, scene, frames = system_with_frames(system.sensor, system.scene, columns)
        estimates = estimate(sensor, scene, frames, args.technique)
    write_result(encode_estimates(estimates))
    # why none serves stands in what is left out
    return 0 if estimates.results else 3
