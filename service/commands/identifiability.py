"""``hybridtof identifiability``: what frames would tell of a scene, before they are taken."""

import argparse
from pathlib import Path

from service.commands.command import Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "identifiability",
        _run,
        brief="what frames at given ranges would tell of a scene",
        description="Rank, Cramer-Rao bounds and, for every unknown, whether it would be "
        "identified and why not, before any frame is taken, as JSON. All of it is of noise, "
        "unknowns and what the scene's `discrepancy` allows object and clock to be off the model; "
        "left out that is the default, as in the answers, and 0 states none. Which technique "
        "serves a scene, and why the others do not, is in the answer of `hybridtof estimate`.",
        examples="""
            hybridtof identifiability --scene scene.json --ranges 0.3 0.6 1.2
            hybridtof identifiability --scene scene.json --ranges 0.3 0.6 --at object.c0=0.08
        """,
    )
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument(
        "--ranges",
        type=float,
        nargs="+",
        required=True,
        metavar="R",
        help="range of the object in every frame [m]",
    )
    parser.add_argument(
        "--empty", type=int, default=0, metavar="N", help="frames without the object besides"
    )
    parser.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="value of an unknown at which the bounds are computed, may be repeated; left out: "
        "the medians of the priors",
    )


def _values(options: list[str]) -> dict[str, float]:
    """Read PATH=VALUE."""
    from simulator.errors import InvalidInputError

    values = {}
    for option in options:
        path, _, value = option.partition("=")
        try:
            values[path] = float(value)
        except ValueError:
            raise InvalidInputError.at("--at", f"{option!r} is not PATH=VALUE") from None
    return values


def _run(args: argparse.Namespace) -> int:
    import dataclasses

    import pydantic_core

    from service.answers.identifiability import identifiability_of
    from service.commands.files import naming, read_document
    from service.commands.output import write_result
    from service.plausibility import doubts
    from service.requests import IdentifiabilityRequest
    from service.system_description import SystemDescription
    from simulator.errors import InvalidInputError
    from simulator.validated import parse

    if args.empty < 0:
        raise InvalidInputError.at("--empty", "must not be negative")
    system = read_document(SystemDescription, args.scene)
    for doubt in doubts(system.sensor):
        note(args, f"note: {doubt}")
    # a frame without the object has a range that plays no part
    data = {
        "sensor": system.sensor,
        "scene": system.scene,
        "ranges_m": args.ranges + args.ranges[:1] * args.empty,
        "object_present": [True] * len(args.ranges) + [False] * args.empty,
        "at": _values(args.at),
    }
    sources = {"/ranges_m": "--ranges", "/object_present": "--empty", "/at": "--at"}
    with naming(sources | {"": str(args.scene)}):
        result = identifiability_of(parse(IdentifiabilityRequest, data))
    write_result(pydantic_core.to_json(dataclasses.asdict(result)))
    for row in result.identifiability:
        if row.parameter == "range_m" and row.status != "identified":
            note(args, f"range_m, the scale of all ranges, would be {row.status}: {row.reason}")
    return 0
