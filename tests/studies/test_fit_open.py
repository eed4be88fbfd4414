"""The table of the joint fit where frames leave ranges open: a small run, and what it counts."""

from benchmarks.fit_open import COLUMNS, HEAD, line, row_of


def test_a_set_that_frames_tell_is_answered_without_priors() -> None:
    row = dict(row_of("pulsed", "object", (4.0, 4.0), 0, 3))
    assert set(row) <= set(COLUMNS)
    assert row["priors"] == row["misfit"] == 0
    assert row["frames"] == row["unique"] == row["held"]
    assert 0.0 < float(row["worst"]) < 2.0


def test_far_frames_that_are_dark_are_a_class_of_their_own() -> None:
    row = dict(row_of("pulsed", "far", (0.0, 0.0), 100, 0))
    assert row["misfit"] == 0
    assert int(row["unique"]) > 15
    assert 0.0 < float(row["worst"]) < 4.0


def test_columns_count_sets_and_frames_of_what_is_answered() -> None:
    none = dict.fromkeys(COLUMNS, "")
    counts = {"frames": "8", "unique": "4", "held90": "2", "held": "3", "width": "0.1"}
    answered = none | counts | {"misfit": "0", "seconds": "2", "priors": "0", "worst": "1"}
    far = answered | {"worst": "5.1", "priors": "1", "identified": "5.1", "held90": "4"}
    misfit = answered | {"misfit": "1", "worst": "9"}
    refused = none | {"refused": "too open", "seconds": "4"}
    cells = line([answered, far, misfit, refused], "all").split()
    assert cells[1:6] == ["4", "1", "1", "2", "1"]
    assert cells[6::2][:3] == ["50.0", "75.0", "75.0"]
    assert cells[12:] == ["1.0e-01", "1", "1", "2.0", "4.0"]
    assert len(HEAD) == len(line([answered], ""))
