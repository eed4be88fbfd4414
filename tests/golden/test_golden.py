"""Answers are those of commit 35737d6: to the last bit, or within what `tolerances.json` states.

A row of ``within`` names a group or ``group/request``, the relative tolerance, the step of the
redesign that allowed it, and the reason; a row of ``recorded_again`` a group or request whose
answers were stored anew with that step, since draws that differ in a last bit part for good. Bits
depend on the processor's vector instructions and on the compiler, so that they are compared only
where they were recorded; elsewhere answers must agree to 1e-6, and draws are not compared.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.golden.groups import GROUPS
from tests.golden.machine import RECORDED, machine
from tests.golden.plain import differences, read

STATED: dict[str, Any] = json.loads(
    (Path(__file__).parent / "tolerances.json").read_text(encoding="utf-8")
)
TOLERANCES: dict[str, dict[str, Any]] = STATED["within"]
EVERY = [f"{group}/{name}" for group, requests in GROUPS.items() for name in requests]
ELSEWHERE = 1e-6


@pytest.mark.parametrize("name", EVERY)
def test_an_answer_is_what_it_was(name: str) -> None:
    group, request = name.split("/")
    row = TOLERANCES.get(name, TOLERANCES.get(group))
    relative = None if row is None else float(row["relative"])
    if machine() != RECORDED:
        if group == "posterior":
            pytest.skip(f"draws were recorded on another machine: {RECORDED}")
        relative = max(relative or 0.0, ELSEWHERE)
    found = json.loads(json.dumps(GROUPS[group][request]()))
    lines = differences(read(group)[request], found, relative)
    assert not lines, f"{len(lines)} differences, such as\n" + "\n".join(lines[:12])


def test_nothing_is_stored_that_is_not_asked() -> None:
    stored = {f"{group}/{name}" for group in GROUPS for name in read(group)}
    assert stored == set(EVERY)


def test_every_tolerance_states_its_step_and_its_reason() -> None:
    for name, row in TOLERANCES.items():
        assert name in GROUPS or name in EVERY, name
        assert set(row) == {"relative", "step", "reason"}
        assert 0 < row["relative"] <= 1e-6
        assert row["step"]
        assert row["reason"]
    for row in STATED["recorded_again"]:
        assert row.get("group") in GROUPS or row.get("request") in EVERY
        assert row["step"]
        assert row["reason"]


def test_a_last_bit_a_word_and_a_missing_column_are_seen() -> None:
    stored = {"a": [1.0, float("nan")], "b": "x", "c": -0.0, "digests": {"d": "1"}}
    assert differences(stored, json.loads(json.dumps(stored))) == []
    for found in (
        {**stored, "a": [1.0 + 2e-16, float("nan")]},
        {**stored, "a": [1.0, 1.0]},
        {**stored, "a": [1.0]},
        {**stored, "a": [1, float("nan")]},
        {**stored, "b": "y"},
        {**stored, "c": 0.0},
        {**stored, "digests": {"d": "2"}},
        {key: item for key, item in stored.items() if key != "b"},
        {**stored, "e": 1},
    ):
        assert len(differences(stored, found)) == 1
    near = {**stored, "a": [1.0 + 1e-9, float("nan")], "digests": {"d": "2"}}
    assert differences(stored, near, 1e-8) == []
    assert len(differences(stored, near, 1e-10)) == 1
    assert len(differences(stored, {**near, "b": "y"}, 1e-8)) == 1
