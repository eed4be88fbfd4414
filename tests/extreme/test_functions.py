"""Every public function in one form: the small version of the table of docs/stability.md."""

import re
from pathlib import Path

import pytest

import hybridtof
from tests.extreme.functions import FUNCTIONS, table_row

STABILITY = Path(__file__).parents[2] / "docs" / "stability.md"
# posteriors take seconds each, and other tests here hold the same
SMALL = {
    "parse_sensor": 40,
    "parse_scene": 40,
    "frames_from_columns": 40,
    "read_frames": 40,
    "simulate": 40,
    "identifiability": 12,
    "estimate": 40,
    "plan": 40,
    "track": 4,
    "step": 6,
    "state_from_bytes": 6,
}


def public_functions() -> set[str]:
    """Whatever can be called and is neither a class nor a module."""
    names = {name for name in hybridtof.__all__ if name[0].islower()} - {"fold"}
    fold = hybridtof.fold
    inside = {f"fold.{name}" for name in fold.__all__ if name[0].islower()}
    return names | inside


def row_of(document: str, name: str) -> list[str]:
    """Return the cells of a function's row in a page."""
    (line,) = re.findall(rf"^\| `{re.escape(name)}`( \|.*) \|$", document, flags=re.MULTILINE)
    return [cell.strip() for cell in line.split("|")[1:]]


def test_every_public_function_has_a_row() -> None:
    """Of cases, condition, worst error and the case, and none is off by a thousand units."""
    held = {each.function.partition(",")[0] for each in FUNCTIONS}
    assert held == public_functions()
    page = STABILITY.read_text()
    section = page[page.index("## Every public function") :].split("\n## ")[0]
    assert re.search(r"\d+ \w+ 20\d\d", section)
    for name in sorted(public_functions()):
        by, cases, condition, error, case = row_of(section, name)
        assert by
        assert condition
        assert re.fullmatch(r"[\d,]+ of [\d,]+", cases), name
        assert float(error) <= 1e3, name
        assert case.isdigit() or (case == "-" and float(error) == 0.0), name


@pytest.mark.parametrize("name", SMALL)
def test_a_few_cases_are_within_a_thousand_roundings(name: str) -> None:
    (held,) = (each for each in FUNCTIONS if each.function == name)
    _, worst = table_row(held, SMALL[name])
    assert worst.decided > 0
    assert worst.error <= 1e3
