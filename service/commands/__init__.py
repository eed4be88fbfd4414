"""The commands, one file each: ``add_parser(subparsers)`` and ``run(args) -> exit code``.

What a command needs is imported when it runs: worker processes import the command line too.
"""

import argparse
from importlib import import_module

from service.commands.command import Subparsers

__all__ = ["COMMANDS", "add_parsers"]

COMMANDS = {
    "serve": "service.commands.serve",
    "simulate": "service.commands.simulate",
    "convert": "service.commands.convert",
    "estimate": "service.commands.estimate",
    "infer": "service.commands.infer",
    "calibrate": "service.commands.calibrate",
    "track": "service.commands.track",
    "export": "service.commands.export",
    "identifiability": "service.commands.identifiability",
    "keys": "service.commands.keys",
    "schema": "service.commands.schema",
    "warm": "service.commands.warm",
    "reproduce": "service.reproduce",
    "demo": "service.demo.command",
    "report": "service.report.command",
}
"""Name of every command, and the module that it is in."""


def add_parsers(
    subparsers: "Subparsers[argparse.ArgumentParser]", command: str | None = None
) -> None:
    """Add a command to the command line.

    Parameters
    ----------
    subparsers : argparse subparsers
        Of the main parser.
    command : str, optional
        One of `COMMANDS`; left out: all of them.
    """
    for name in COMMANDS if command is None else (command,):
        import_module(COMMANDS[name]).add_parser(subparsers)
