"""The commands, one file each: ``add_parser(subparsers)`` and ``run(args) -> exit code``.

What a command needs is imported when it runs: worker processes import the command line too.
"""

import argparse
from collections.abc import Callable

from service import reproduce
from service.commands import (
    calibrate,
    convert,
    estimate,
    export,
    identifiability,
    infer,
    keys,
    schema,
    serve,
    simulate,
    track,
    warm,
)
from service.commands.command import Subparsers
from service.demo import command as demo
from service.report import command as report

__all__ = ["COMMANDS", "AddParser"]

AddParser = Callable[["Subparsers[argparse.ArgumentParser]"], None]

COMMANDS: tuple[AddParser, ...] = (
    serve.add_parser,
    simulate.add_parser,
    convert.add_parser,
    estimate.add_parser,
    infer.add_parser,
    calibrate.add_parser,
    track.add_parser,
    export.add_parser,
    identifiability.add_parser,
    keys.add_parser,
    schema.add_parser,
    warm.add_parser,
    reproduce.add_parser,
    demo.add_parser,
    report.add_parser,
)
