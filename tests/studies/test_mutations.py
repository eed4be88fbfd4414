"""The list of planted faults lives, and the run over it says what is so."""

import dataclasses
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.mutations import trial
from benchmarks.mutations.__main__ import run, table
from benchmarks.mutations.faults import Fault, planted, read_faults, wrong_with

ROOT = Path(__file__).parents[2]
FAULTS = read_faults()


def test_every_fault_of_the_list_can_be_planted() -> None:
    wrong = [reason for fault in FAULTS if (reason := wrong_with(fault, ROOT)) is not None]
    assert not wrong, "\n".join(wrong)
    for fault in FAULTS:
        compile(planted(fault, ROOT), fault.file, "exec")


def test_the_list_is_spread_over_layers_and_kinds() -> None:
    assert len(FAULTS) >= 100
    assert min(Counter(fault.layer for fault in FAULTS).values()) >= 20
    assert set(Counter(fault.layer for fault in FAULTS)) == {"simulator", "inference", "service"}
    assert min(Counter(fault.kind for fault in FAULTS).values()) >= 10


SOURCE = "def area(a, b):\n    return a * b\n\n\ndef length(a):\n    return abs(a)\n"
TESTS = "from sums import area\n\n\ndef test_area():\n    assert area(2.0, 3.0) == 6.0\n"
SEEN = Fault("seen", "wrong factor", "sums.py", "a * b", "a + b", ("test_sums.py",))
UNSEEN = Fault("unseen", "sign", "sums.py", "abs(a)", "-abs(a)", ("test_sums.py",))


@pytest.fixture
def toy(tmp_path: Path) -> Path:
    root = tmp_path / "toy"
    root.mkdir()
    (root / "sums.py").write_text(SOURCE)
    (root / "test_sums.py").write_text(TESTS)
    (root / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    return root


def test_what_is_noticed_and_what_survives(toy: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    results = run((SEEN, UNSEEN), toy, out)
    assert results["seen"].noticed
    assert results["seen"].by == "test_sums.py::test_area"
    assert results["seen"].stage == "named tests"
    assert not results["unseen"].noticed
    assert results["unseen"].stage == "fast suite"
    assert (toy / "sums.py").read_text() == SOURCE
    said = table((SEEN, UNSEEN), results)
    assert "| **all** | 2 | 1 (50.0%) |" in said
    assert "survived: unseen" in said


def test_what_is_known_is_not_tried_again(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def fails(_tree: Path, arguments: list[str], _cache: Path) -> str | None:
        asked.append(arguments[-1])
        return "test_sums.py::test_area"

    monkeypatch.setattr(trial, "_failing", fails)
    out = tmp_path / "out"
    first = run((SEEN,), toy, out)
    assert run((SEEN, UNSEEN), toy, out)["seen"] == first["seen"]
    assert len(asked) == 2
    (out / "seen.json").write_text("{")  # cut short
    run((SEEN, UNSEEN), toy, out)
    assert len(asked) == 3
    run((dataclasses.replace(SEEN, new="a - b"), UNSEEN), toy, out)  # another fault
    assert len(asked) == 4


def test_a_fault_that_cannot_be_planted_is_named(toy: Path) -> None:
    assert wrong_with(SEEN, toy) is None
    gone = dataclasses.replace(SEEN, old="a / b")
    assert "seen: its old text stands 0 times in sums.py" in str(wrong_with(gone, toy))
    with pytest.raises(ValueError, match="stands 0 times"):
        planted(gone, toy)
    assert "2 times" in str(wrong_with(dataclasses.replace(SEEN, old="return"), toy))
    assert "no kind" in str(wrong_with(dataclasses.replace(SEEN, kind="typo"), toy))
    assert "no tests other.py" in str(
        wrong_with(dataclasses.replace(SEEN, tests=("other.py",)), toy)
    )


def test_no_verdict_is_no_result(toy: Path, tmp_path: Path) -> None:
    lost = dataclasses.replace(SEEN, tests=("test_sums.py::test_volume",))
    with pytest.raises(RuntimeError, match="pytest ended with 4"):
        run((lost,), toy, tmp_path / "out")
    assert not (tmp_path / "out" / "seen.json").exists()
