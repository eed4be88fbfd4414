"""The command line: ``hybridtof <command>``.

Results go to standard output as JSON, everything else to standard error. The exit code is 0 for an
answer, 2 for input that breaks a rule, 3 for input without an honest answer, 4 for a failure of
the program (1 for one that nobody foresaw, with its traceback), 130 after Ctrl-C.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence

from service.commands import COMMANDS
from service.errors import ServiceError
from simulator.errors import HybridTofError, InvalidInputError, RefusedError

__all__ = ["main"]

_EPILOG = "exit codes: 0 answered, 2 bad input, 3 no honest answer, 4 failure, 130 interrupted"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="hybridtof",
        description="Distance from hybrid intensity/time-of-flight sensors (SI units).",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="command")
    for add_parser in COMMANDS:
        add_parser(subparsers)
    return parser


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

    Returns
    -------
    int
        Exit code.
    """
    parsed = _parser().parse_args(arguments)
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
