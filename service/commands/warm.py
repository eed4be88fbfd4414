"""``hybridtof warm``: machine code ahead of the first question."""

import argparse

from service.commands.command import Subparsers, add_command, note

__all__ = ["add_parser", "warm"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    add_command(
        subparsers,
        "warm",
        warm,
        brief="make the machine code of all kernels, once",
        description="Make the machine code of all kernels and keep it in the kernel cache, "
        "$NUMBA_CACHE_DIR/hybridtof or ~/.cache/hybridtof. Nothing has to be warmed: what is asked "
        "before is answered all the same, only slower. With NUMBA_CPU_NAME=generic the cache may "
        "be copied to another machine that has the same setting.",
        examples="""
            hybridtof warm
            NUMBA_CPU_NAME=generic NUMBA_CACHE_DIR=cache hybridtof warm
        """,
    )


def warm(args: argparse.Namespace) -> int:
    """Make the machine code of all kernels that is not there; return the command's exit code.

    Parameters
    ----------
    args : Namespace
        ``quiet``: whether nothing is said of how far it is.

    Raises
    ------
    HybridTofError
        Where it cannot be kept.
    """
    from service.warm.warming import is_warm, mark_warm
    from simulator.compiled import compiling_at_once
    from simulator.errors import HybridTofError
    from simulator.kernel_cache import base_folder

    folder = base_folder()
    if folder is None or not folder.writable:
        raise HybridTofError("there is no kernel cache that can be written to: NUMBA_CACHE_DIR")
    if is_warm():
        note(args, f"{folder.path} is warm")
        return 0
    from service.warm.questions import QUESTIONS

    with compiling_at_once():
        for number, (name, ask) in enumerate(QUESTIONS.items(), start=1):
            note(args, f"compiling {number} of {len(QUESTIONS)}: {name}")
            ask()
    mark_warm()
    note(args, f"{folder.path} is warm")
    return 0
