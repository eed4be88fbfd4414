"""The command line: ``hybridtof <command>``.

Results go to standard output as JSON, everything else to standard error.

==== ======================================================================
exit meaning
==== ======================================================================
0    there is an answer
1    a failure of the program that nobody foresaw, with its traceback
2    the input, or the command line, breaks a rule
3    valid input without an honest answer
4    a failure of the program
130  interrupted by Ctrl-C
141  the reader of standard output went away
==== ======================================================================
"""

import argparse
import atexit
import gc
import os
import signal
import sys
from collections.abc import Sequence

from service.commands import COMMANDS, add_parsers
from service.commands.command import EXIT_CODES
from service.errors import ServiceError
from simulator.errors import HybridTofError, InvalidInputError, RefusedError

__all__ = ["command_line", "main"]


class _Version(argparse.Action):
    """Say which version this is; looking for it is left to who asks."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"{parser.prog} {version('hybridtof')}")
        parser.exit()


def command_line(command: str | None = None) -> argparse.ArgumentParser:
    """Return what parses a line of the command line: documents are held to it, too.

    Parameters
    ----------
    command : str, optional
        The one command that it knows; left out: all of them.
    """
    parser = argparse.ArgumentParser(
        prog="hybridtof",
        description="Distance from hybrid intensity/time-of-flight sensors (SI units).",
        epilog=f"Each command has examples: hybridtof estimate --help. {EXIT_CODES}",
        allow_abbrev=False,
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="show program's version number and exit"
    )
    subparsers = parser.add_subparsers(
        # named here, since argparse would format a usage to find it
        prog=parser.prog,
        dest="command",
        required=True,
        metavar="command",
    )
    add_parsers(subparsers, command)
    return parser


def _begin_quickly() -> None:
    """Leave out what a process of one command does not need: a sixth of the time of a short one."""
    # nearly all that imports make stays: it is no garbage, nor is it searched for on the way out;
    # a short command, which makes some 60,000 objects, ends before it is looked for
    gc.set_threshold(200_000, 20, 50)
    atexit.register(gc.freeze)
    # pydantic would read the metadata of all that is installed for hooks into checking
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # small systems, which threads would wait for where the machine is busy (simulator.one_thread)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _say(text: str) -> None:
    sys.stderr.write(f"hybridtof: {text}\n")


def _report(error: HybridTofError) -> int:
    if isinstance(error, InvalidInputError):
        for problem in error.problems:
            _say(f"error: {problem.pointer or '/'}: {problem.message}")
        return 2
    _say(f"error: {error}")
    if isinstance(error, RefusedError):
        return 3
    return 2 if isinstance(error, ServiceError) else 4


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Left out: those of the process.
    """
    if arguments is None:
        _begin_quickly()
    words = sys.argv[1:] if arguments is None else arguments
    parsed = command_line(words[0] if words and words[0] in COMMANDS else None).parse_args(words)
    try:
        code = int(parsed.run(parsed))
        sys.stdout.flush()
    except HybridTofError as error:
        return _report(error)
    except BrokenPipeError:
        # the reader has what it wanted; nothing more can be written, not even at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        _say(f"error: {error.filename or ''}: {error.strerror or error}")
        return 2
    except KeyboardInterrupt:
        _say("interrupted")
        return 128 + signal.SIGINT
    return code


if __name__ == "__main__":
    sys.exit(main())
