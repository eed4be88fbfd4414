"""The table of the joint fit by signal-to-noise ratio: a small run, and what its columns count."""

from collections.abc import Mapping

import numpy as np
import pytest

from benchmarks.fit_cells import COLUMNS, HEAD, line, name_of, row_of
from tests.fits.random_sets import random_set


def text_of(row: Mapping[str, object]) -> dict[str, str]:
    return {column: str(row.get(column, "")) for column in COLUMNS}


@pytest.mark.parametrize("told", ["exact", "default"])
def test_a_set_with_little_noise_is_answered_and_right(told: str) -> None:
    row = dict(row_of(told, "pulsed", "object", 1e4, 3))
    assert set(row) <= set(COLUMNS)
    assert "refused" not in row
    assert row["misfit"] == 0
    compared = told == "exact"  # by default not the best fit is the answer
    assert ("excess" in row) == compared
    assert float(row.get("excess", 0.0)) < 0.1
    frames = random_set("object", "pulsed", 3).simulation.frames
    assert row["frames"] == row["unique"] == np.count_nonzero(frames.present)
    assert 0.0 < float(row["open"]) <= float(row["alone"]) < 1.0
    cells = line([[text_of(row)]], "one").split()
    assert cells[1:6] == ["1", "0", "0", "0", "1"]
    assert cells[6:8] == (["100.0", "%"] if compared else ["-", "100.0"])
    assert len(HEAD) == len(line([[text_of(row)]], ""))


def test_a_refusal_is_none_of_the_answers_and_needless_where_the_truth_tells() -> None:
    row = text_of(dict(row_of("exact", "pulsed", "everything", 30.0, 0)))
    assert row["refused"]
    assert float(row["alone"]) > 1.0
    told = row | {"alone": "0.5"}
    answered = row | {"refused": "", "misfit": "0", "excess": "0.2", "unique": "4", "held": "1"}
    far = answered | {"excess": "0.05", "held": "4", "worst": "5.1", "width": "0.1"}
    misfit = answered | {"misfit": "1", "unique": "0", "held": "0"}
    cells = line([[row, told], [answered, far, misfit]], "all").split()
    # sets, refused, needless, misfit, answered; right of these
    assert cells[1:6] == ["5", "2", "1", "1", "2"]
    assert cells[6] == "50.0"
    # held of the unique; sets of which less than half are; the width of those that have one
    assert cells[10] == "62.5"
    assert cells[12:15] == ["1", "1.0e-01", "1"]


def test_every_cell_has_a_table_of_its_own() -> None:
    names = {
        name_of(told, "pulsed", name, snr)
        for told in ("exact", "default")
        for name in ("object", "free shadow")
        for snr in (1e2, 1e9)
    }
    assert len(names) == 8
    assert all(" " not in name for name in names)
