"""``hybridtof schema``: JSON schemas of what the commands and the service read."""

import argparse

from service.commands.command import Subparsers, add_command

__all__ = ["add_parser"]

_DOCUMENTS = ("file", "sensor", "scene", "frames")


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "schema",
        _run,
        brief="print the JSON schema of a scene file, a sensor, a scene or frames",
        description="Print a JSON schema (draft 2020-12), for editors that check and complete.",
        examples="""
            hybridtof schema > scene-file.schema.json
            hybridtof schema frames
        """,
    )
    parser.add_argument(
        "document",
        nargs="?",
        choices=_DOCUMENTS,
        default="file",
        help="file: what --scene reads, with members sensor and scene (default)",
    )


def _run(args: argparse.Namespace) -> int:
    import json
    from typing import Any

    import pydantic

    from service.commands.output import write_result
    from service.system_description import AnySensor, SystemDescription
    from simulator.frames import FrameColumns
    from simulator.scene import Scene

    types: dict[str, Any] = {
        "file": SystemDescription,
        "sensor": AnySensor,
        "scene": Scene,
        "frames": FrameColumns,
    }
    schema = pydantic.TypeAdapter(types[args.document]).json_schema()
    document = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema
    write_result(json.dumps(document, indent=1).encode("ascii"))
    return 0
