"""Limits that the documents state are those of the code: who reads an answer goes by them."""

import re
from pathlib import Path

import pytest

from inference.posterior.criticism import predictive_check
from inference.posterior.sampling import importance

GLOSSARY = (Path(__file__).parents[1] / "docs" / "glossary.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "limits"),
    [
        (r"readings \(false-alarm rate at most ([\d.e-]+)\)", (predictive_check.MISFIT_P,)),
        (r"trusted up to a Pareto k-hat of ([\d.]+\d)", (importance.MAX_K_HAT,)),
    ],
)
def test_the_glossary_states_what_the_code_does(words: str, limits: tuple[float, ...]) -> None:
    found = re.search(words, GLOSSARY)
    assert found is not None, f"docs/glossary.md says nothing like {words}"
    assert tuple(map(float, found.groups())) == limits
