"""docs/api.md is made from the docstrings, and describes every public name."""

import re
import runpy
from pathlib import Path

import hybridtof

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "api.md").read_text(encoding="utf-8")
SCRIPT = runpy.run_path(str(DOCS / "make_api.py"))


def test_page_is_as_the_docstrings_are() -> None:
    assert SCRIPT["page"]() == PAGE, "run `make api`"


def test_every_public_name_is_described() -> None:
    described = re.findall(r"^### `(\w+)`$", PAGE.split("## What comes back")[0], re.MULTILINE)
    assert sorted(described) == sorted(hybridtof.__all__)
    for name in described:
        entry = PAGE.split(f"### `{name}`\n")[1].split("\n#")[0]
        assert len(entry.split()) > 5, name


def test_what_comes_back_is_described() -> None:
    described = set(re.findall(r"^### `(\w+)`$", PAGE, re.MULTILINE))
    assert {"Estimates", "TechniqueResult", "Posterior", "Verdict", "Track"} <= described
    assert len({kind.__name__ for kind in SCRIPT["answers"]()} & described) > 15
