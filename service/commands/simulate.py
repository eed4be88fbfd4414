"""``hybridtof simulate``: frames with their truth."""

import argparse
from pathlib import Path
from typing import Any

from service.commands.command import Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "simulate",
        _run,
        brief="simulate frames of a scene",
        description="Simulate frames of an object that moves along a line, and print them with "
        "the truth as JSON. Unknowns of the scene are drawn from their priors, once.",
        examples="""
            hybridtof simulate --scene scene.json --from-m 0.2 --to-m 2 --frames 20 --seed 1
            hybridtof simulate --scene scene.json --trajectory path.json --output frames.csv
        """,
    )
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument("--trajectory", type=Path, help="JSON file, instead of the options below")
    parser.add_argument("--from-m", type=float, help="first range [m]")
    parser.add_argument("--to-m", type=float, help="last range [m]")
    parser.add_argument("--frames", type=int, help="number of frames")
    parser.add_argument("--spacing", choices=("linear", "log"), help="of the ranges (linear)")
    parser.add_argument("--duration-s", type=float, help="from the first to the last frame [s]")
    parser.add_argument(
        "--known-range-sd-m", type=float, help="have frames tell their range to this sd [m]"
    )
    parser.add_argument(
        "--temperature-k",
        type=float,
        nargs="+",
        metavar="K",
        help="of a sensor with coefficients [K]: one of all frames, or those of the first and the "
        "last, between which it changes evenly",
    )
    parser.add_argument("--seed", type=int, help="left out: drawn and printed")
    parser.add_argument(
        "--output", type=Path, help="write the frames here too, as .csv, .ndjson or .json"
    )


def _radial(args: argparse.Namespace) -> dict[str, Any]:
    """Trajectory from the options that were given."""
    names = (
        "from_m",
        "to_m",
        "frames",
        "spacing",
        "duration_s",
        "known_range_sd_m",
        "temperature_k",
    )
    given = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    return {"kind": "radial"} | given


def _run(args: argparse.Namespace) -> int:
    import pydantic_core

    from service.answers.simulations import simulation_of
    from service.commands.files import check_folder, naming, read_data, read_document
    from service.commands.output import write_result
    from service.frame_files import check_suffix, write_frames
    from service.plausibility import doubts
    from service.requests import SimulationRequest
    from service.system_description import SystemDescription
    from simulator.errors import InvalidInputError
    from simulator.validated import parse

    if args.output is not None:
        check_suffix(args.output.suffix, "written to")
        check_folder("--output", args.output)
    system = read_document(SystemDescription, args.scene)
    radial = _radial(args)
    data: dict[str, Any] = {} if args.seed is None else {"seed": args.seed}
    if args.trajectory is None:
        data["trajectory"] = radial
        source = "options of the trajectory"
    elif len(radial) > 1:
        raise InvalidInputError.at("--trajectory", "comes with options that it replaces")
    else:
        data["trajectory"] = read_data(args.trajectory)
        source = str(args.trajectory)
    for doubt in doubts(system.sensor):
        note(args, f"note: {doubt}")
    with naming({"/trajectory": source, "/seed": "--seed", "": str(args.scene)}):
        request = parse(SimulationRequest, {"sensor": system.sensor, "scene": system.scene} | data)
        result = simulation_of(request)
    if args.output is not None:
        write_frames(args.output, result["frames"])
    write_result(pydantic_core.to_json(result))
    return 0
