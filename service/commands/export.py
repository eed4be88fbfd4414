"""``hybridtof export``: a technique as source code for a microcontroller."""

import argparse
from pathlib import Path

from service.commands.command import Subparsers, add_command

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "export",
        _run,
        brief="a technique as C99, with its proven error",
        description="Write a technique for one sensor and scene as a file of C99, in float or "
        "double, whose head says how far its ranges may lie from the exact ones.",
        examples="""
            hybridtof export c --scene scene.json --technique conventional --output ranges.c
            hybridtof export c --scene scene.json --technique intensity_w1 --tolerance 1e-3
        """,
    )
    parser.add_argument("language", choices=("c",), help="what is written")
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument(
        "--technique",
        required=True,
        help="conventional, intensity, intensity_w1 or background_cancelling",
    )
    parser.add_argument("--name", default="hybridtof", help="with which names in C begin")
    parser.add_argument(
        "--tolerance", type=float, default=1e-4, help="largest relative error of a table (1e-4)"
    )
    parser.add_argument("--output", type=Path, help="left out: standard output")


def _run(args: argparse.Namespace) -> int:
    from service.c_export import c_text, export_c
    from service.commands.files import check_folder, naming, read_document
    from service.commands.output import write_result
    from service.system_description import SystemDescription

    if args.output is not None:
        check_folder("--output", args.output)
    system = read_document(SystemDescription, args.scene)
    sensor, scene = system.sensor, system.scene
    sources = {f"/{name}": f"--{name}" for name in ("technique", "name", "tolerance")}
    with naming(sources):
        exported = export_c(args.technique, sensor, scene, args.tolerance)
        text = c_text(exported, args.technique, sensor, scene, args.name)
    if args.output is not None:
        args.output.write_text(text, encoding="ascii")
    else:
        write_result(text.rstrip("\n").encode("ascii"))
    return 0
