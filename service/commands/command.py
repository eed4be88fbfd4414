"""What all commands have in common: their help, ``--quiet``, and notes on standard error."""

import argparse
import importlib.util
import sys
from collections.abc import Callable

__all__ = ["EXIT_CODES", "FRAMES_HELP", "Subparsers", "add_command", "can_draw", "note"]

Subparsers = argparse._SubParsersAction  # argparse has no public name for it

FRAMES_HELP = "frames as .csv, .ndjson or .json; - for standard input, in any of these forms"
EXIT_CODES = "exit codes: 0 answered, 2 bad input, 3 no honest answer, 4 failure, 130 interrupted"


def add_command(
    subparsers: "Subparsers[argparse.ArgumentParser]",
    name: str,
    run: Callable[[argparse.Namespace], int],
    *,
    brief: str,
    description: str,
    examples: str,
) -> argparse.ArgumentParser:
    """Add a command to a parser.

    Parameters
    ----------
    subparsers : argparse subparsers
        Of the main parser.
    name : str
        Of the command.
    run : callable
        Gets the parsed arguments and returns the exit code.
    brief, description : str
        For the list of commands, and for the command's own help.
    examples : str
        Command lines, one a line.

    Returns
    -------
    argparse.ArgumentParser
        To which the command adds its arguments.
    """
    shown = "\n".join(f"  {line.strip()}" for line in examples.strip().splitlines())
    parser = subparsers.add_parser(
        name,
        help=brief,
        description=description,
        epilog=f"examples:\n{shown}\n\n{EXIT_CODES}",
        formatter_class=_Help,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--quiet", action="store_true", help="errors alone on standard error: no notes, no progress"
    )
    parser.set_defaults(run=run)
    return parser


class _Help(argparse.HelpFormatter):
    """Fills paragraphs, but leaves the lines of an epilog as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("examples:"):
            return text
        return super()._fill_text(text, width, indent)


def note(args: argparse.Namespace, text: str) -> None:
    """Say something on standard error, unless ``--quiet`` was given."""
    if not args.quiet:
        sys.stderr.write(f"hybridtof: {text}\n")


def can_draw(args: argparse.Namespace) -> bool:
    """Whether matplotlib is there; where it is not, say so: before the work, not after it."""
    if importlib.util.find_spec("matplotlib") is not None:
        return True
    note(args, "there will be no picture: it needs matplotlib, install hybridtof[plots]")
    return False
