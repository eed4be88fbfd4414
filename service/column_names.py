"""Names of columns in files of frames: those that are meant, and those that cannot be."""

import re
from collections.abc import Sequence

from simulator.errors import InvalidInputError, Problem, escape
from simulator.frames import FrameColumns
from simulator.other_readings import instead_of

__all__ = ["NAMES", "check_names", "check_readings", "ignored_names", "meant", "with_remedy"]

NAMES = tuple(FrameColumns.model_fields)

# names that loggers give to columns which this project has under another name
_OTHER_WORDS = {"t": "time_s", "time": "time_s", "timestamp": "time_s", "present": "object_present"}
_READINGS = frozenset({"w1", "w2", "i", "q"})
_NULL = (
    "is null: leave that frame out of every column, or send frames one by one, as rows (.csv, "
    ".ndjson) or lines of a stream, where what is wrong with one is said of that one alone"
)
_NAMELESS = "is a column without a name: name it, or leave it out, as pandas does with index=False"
# units that columns do not have, and the one that is meant
_CONVERSIONS = {
    "ms": ("milliseconds", "s"), "millis": ("milliseconds", "s"), "us": ("microseconds", "s"),
    "ns": ("nanoseconds", "s"), "mm": ("millimetres", "m"), "cm": ("centimetres", "m"),
    "um": ("micrometres", "m"), "km": ("kilometres", "m"),
}  # fmt: skip
_UNITS = {"s": "seconds", "m": "metres"}
_ALIKE = 0.75  # difflib's ratio: one letter in four


def _plain(name: str) -> str:
    """Return the name without case, unit in brackets, and punctuation."""
    return re.sub(r"\(.*\)|\[.*\]|[^a-z0-9]", "", name.lower())


def meant(name: str) -> list[str]:
    """Return the columns that a name may stand for, itself first; none where none is meant.

    Parameters
    ----------
    name : str
        As it stands in a file.
    """
    plain = _plain(name)
    same = [known for known in NAMES if _plain(known) == plain]
    if same:
        return same
    if plain in _OTHER_WORDS:
        return [_OTHER_WORDS[plain]]
    if re.fullmatch(r"(timestamp|time|t)(s|ms|us|ns|sec|seconds|millis)", plain):
        return ["time_s"]
    if re.fullmatch(r"d?w\d?(dt)?", plain):
        return [known for known in NAMES if "w" in known and known[0] == plain[0]]
    if len(plain) <= 3:
        return []
    if "temperature" in plain:
        # of a die, a room, in degrees: only a sensor with coefficients asks for one, and by name
        return []
    from difflib import get_close_matches  # seldom needed

    return get_close_matches(plain, NAMES, n=2, cutoff=_ALIKE)


def _conversion(name: str, likely: Sequence[str]) -> str:
    """Return how to convert what stands in a column, empty where no other unit is named."""
    found = re.search(r"(?:^t|time|[^a-z])(ms|millis|us|ns|mm|cm|um|km)[)\]]?$", name.lower())
    if found is None:
        return ""
    unit, wanted = _CONVERSIONS[found[1]]
    if not all(column.endswith(f"_{wanted}") for column in likely):
        return ""
    return f" Convert {unit} to {_UNITS[wanted]}."


def check_names(names: Sequence[str]) -> None:
    """Refuse names that must be mistakes.

    Parameters
    ----------
    names : sequence of str
        Names of the columns of a file.

    Raises
    ------
    InvalidInputError
        A pointer for each name that is repeated, that is close to a column's, or that is a number,
        with a hint.
    """
    if names and names[0].lower().startswith("sep="):  # for spreadsheets
        raise InvalidInputError.at("", "the first line must name the columns: remove the line sep=")
    problems = [
        Problem(f"/{escape(name)}", "the column is repeated")
        for name in dict.fromkeys(names)
        if name and names.count(name) > 1
    ]
    for name in ignored_names(names):
        hint = ""
        if "time_s" in names and re.fullmatch(r"timestamp[a-z]+", _plain(name)):
            continue  # of another clock, beside the one that counts
        if not name:
            problems.append(Problem("/", _NAMELESS))
        elif likely := meant(name):
            hint = f"did you mean {' or '.join(likely)}?{_conversion(name, likely)}"
        elif re.fullmatch(r"[-+.\d]+(e[-+]?\d+)?", name, re.IGNORECASE):
            hint = "the first line must name the columns."
        if hint:
            wanted = ", ".join(NAMES)
            message = f"is not a column: {hint} The columns are {wanted}"
            problems.append(Problem(f"/{escape(name)}", message))
    if problems:
        raise InvalidInputError(*problems)


def check_readings(names: Sequence[str]) -> None:
    """Refuse a file that has columns, and none of them a reading.

    Parameters
    ----------
    names : sequence of str
        Names of the columns of a file.

    Raises
    ------
    InvalidInputError
        Naming the columns that were found.
    """
    if ignored_names(names) and not _READINGS.intersection(names):
        found = ", ".join(names)
        hints = dict.fromkeys(filter(None, map(instead_of, ignored_names(names))))
        raise InvalidInputError(
            Problem(
                "",
                f"no column holds readings: found {found}; a pulsed sensor has w1 (the late "
                "window) and w2 (the whole pulse), a sine_wave sensor i and q"
                + "".join(f"; {hint}" for hint in hints),
            )
        )


def ignored_names(names: Sequence[str]) -> list[str]:
    """Return the names, in their order, that are not those of columns."""
    return [name for name in dict.fromkeys(names) if name not in NAMES]


def with_remedy(error: InvalidInputError, columns: object, at: str = "") -> InvalidInputError:
    """Return an error that says what to do about null entries, and about others' columns.

    Columns are one document, good as a whole or refused: of rows each stands for itself.

    Parameters
    ----------
    error : InvalidInputError
        Of checking the columns.
    columns : object
        As they were sent.
    at : str
        Where they stand: the start of their pointers.
    """

    def told(problem: Problem) -> Problem:
        found = re.fullmatch(rf"{at}/(\w+)/(\d+)", problem.pointer)
        column = columns.get(found[1]) if found and isinstance(columns, dict) else None
        if found and isinstance(column, list) and column[int(found[2])] is None:
            return Problem(problem.pointer, _NULL)
        name = problem.pointer.removeprefix(f"{at}/")
        if f"{at}/{name}" == problem.pointer and name not in NAMES and instead_of(name):
            return Problem(problem.pointer, f"is not a column: {instead_of(name)}")
        return problem

    return InvalidInputError(*map(told, error.problems))
