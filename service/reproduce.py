"""``hybridtof reproduce``: the thesis's tables and figures from this code."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from service.commands.command import Subparsers, add_command, note

if TYPE_CHECKING:
    from collections.abc import Iterable

    from simulator.optics.appendix_b import Row

__all__ = ["add_parser", "reproduce_appendix_b", "reproduce_figures"]

_NOTE = {
    False: "# facets of the thesis's own set-up; --converged for the true rectangles",
    True: "# true rectangles, converged",
}


def _as_table(rows: "Iterable[Row]") -> str:
    lines = [f"{'scene':<14}{'c0 [m^2]':>11}{'c1 [m]':>11}{'c2':>11}{'error':>11}"]
    for row in rows:
        code, *numbers = row.printed()
        line = f"{code:<14}" + "".join(f"{number:>11}" for number in numbers)
        if row.fit.statement:
            line += f"  {row.fit.statement}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def reproduce_appendix_b(args: argparse.Namespace) -> int:
    """Write Appendix B's table of one system to standard output and return the exit code."""
    from simulator.optics.appendix_b import rows_as_csv, simulate

    rows = list(simulate(args.system, converged=args.converged))
    if args.format == "csv":
        sys.stdout.write(rows_as_csv(rows))
    else:
        sys.stdout.write(_NOTE[args.converged] + "\n" + _as_table(rows))
        errors = [row.fit.error for row in rows]
        sys.stdout.write(
            f"average error {sum(errors) / len(errors):.2E}, largest {max(errors):.2E}"
            " (mean squared relative residuals)\n"
        )
    return 0


def reproduce_figures(args: argparse.Namespace) -> int:
    """Draw the thesis's figures into a directory and return the exit code."""
    try:
        from simulator.optics.figures import FIGURES, draw
    except ModuleNotFoundError as error:
        if error.name != "matplotlib":
            raise
        sys.stderr.write("figures need matplotlib: install hybridtof[plots]\n")
        return 2
    unknown = sorted(set(args.only or ()) - set(FIGURES))
    if unknown:
        known = ", ".join(FIGURES)
        sys.stderr.write(f"no figure {', '.join(unknown)}; there are {known}\n")
        return 2
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        sys.stderr.write(f"cannot make {args.out}: {error.strerror}\n")
        return 2
    for name in args.only or FIGURES:
        path = draw(name, args.out, args.format)
        note(args, str(path))
    return 0


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command ``reproduce`` to a parser.

    Parameters
    ----------
    subparsers : argparse subparsers
        Of the main parser. Parsed arguments carry ``run(args) -> int``.
    """
    # the parser is complete with the subcommands below, each of which sets its own function
    parser = subparsers.add_parser("reproduce", help="make the thesis's tables and figures anew")
    what = parser.add_subparsers(dest="what", required=True)
    table = add_command(
        what,
        "appendix-b",
        reproduce_appendix_b,
        brief="object parameters of 108 scenes",
        description="Print the object parameters of Appendix B's scenes, made anew.",
        examples="""
            hybridtof reproduce appendix-b
            hybridtof reproduce appendix-b --system sine_wave --converged --format csv
        """,
    )
    table.add_argument("--system", choices=("pulsed", "sine_wave"), default="pulsed")
    table.add_argument("--format", choices=("table", "csv"), default="table")
    table.add_argument(
        "--converged",
        action="store_true",
        help="true rectangles by convergent quadrature instead of the thesis's facets",
    )
    figures = add_command(
        what,
        "figures",
        reproduce_figures,
        brief="figures of chapters 2 to 5 and appendix A",
        description="Draw figures of chapters 2 to 5 and appendix A; needs matplotlib.",
        examples="""
            hybridtof reproduce figures --out figures
            hybridtof reproduce figures --out figures --format pdf --only 2-6 3-1
        """,
    )
    figures.add_argument("--out", type=Path, required=True, metavar="DIR")
    figures.add_argument("--format", choices=("png", "svg", "pdf"), default="png")
    figures.add_argument(
        "--only", nargs="+", metavar="NAME", help="some figures only, such as 2-6 3-1"
    )
