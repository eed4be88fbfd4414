"""What is answered of the hypotheses: ranges that there are, and no mean over what is unlike."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.hypotheses import COUNT, Hypotheses, U, V
from inference.tracking.report import (
    BEST,
    HYPOTHESIS_COLUMNS,
    POSITION,
    REPORT_COLUMNS,
    SD,
    STATUS,
    WEIGHT,
    report,
)
from inference.tracking.tracker import tracker
from tests.tracking.scenes import PLATE, scene_of, sensor_of

Array = NDArray[np.float64]

MODEL = tracker(sensor_of(1e-4), scene_of(PLATE)).model
LOW, HIGH = MODEL.table.start, MODEL.table.end


def told(*rows: tuple[float, float, float]) -> tuple[Array, Array]:
    """Report hypotheses given by log r, its standard deviation and weight; none is empty."""
    count = len(rows)
    of = Hypotheses(
        np.zeros((count + 1, 2)),
        np.zeros((count + 1, 2, 2)),
        np.zeros(count + 1),
        np.zeros(14),
    )
    for j, (u, sd, weight) in enumerate(rows, start=1):
        of.x[j, U], of.X[j, U, U], of.X[j, V, V], of.weight[j] = u, sd, 1.0, weight
    of.numbers[COUNT] = count
    out = np.full((1, REPORT_COLUMNS), np.nan)
    listed = np.full((1, count, HYPOTHESIS_COLUMNS), np.nan)
    described = np.zeros((len(of.weight), HYPOTHESIS_COLUMNS))
    report(out, listed, 0, of, MODEL.rules, MODEL.table, described)
    return out[0], listed[0]


@pytest.mark.parametrize("u", [LOW - 40.0, LOW - 0.1, 0.0, HIGH + 0.1, HIGH + 40.0])
def test_ranges_are_within_the_support_and_their_deviations_no_larger_than_it_says(
    u: float,
) -> None:
    for sd in (1e-3, 0.2, 30.0):
        out, listed = told((u, sd, 1.0))
        assert out[STATUS] == Status.UNIQUE
        assert out[BEST + POSITION] == listed[0, POSITION] == pytest.approx(np.clip(u, LOW, HIGH))
        # of a uniform law
        assert out[BEST + SD] == pytest.approx(min(sd, (HIGH - LOW) / np.sqrt(12.0)))
        assert listed[0, SD] == pytest.approx(out[BEST + SD])


def test_a_broad_and_light_hypothesis_takes_no_part_in_a_narrow_one() -> None:
    out, listed = told((0.0, 1e-3, 0.5), (0.002, 1e-3, 0.48), (0.001, 20.0, 0.02))
    assert out[STATUS] == Status.UNIQUE
    assert out[BEST + WEIGHT] == pytest.approx(0.98)
    # neighbours that overlap are one range all the same, also around the broad one
    assert out[BEST + POSITION] == pytest.approx(0.002 * 0.48 / 0.98)
    assert out[BEST + SD] < 2e-3
    assert np.all(np.diff(listed[:, POSITION]) >= 0.0)


def test_light_hypotheses_within_a_broad_and_heavy_one_are_part_of_it() -> None:
    out, _ = told((0.0, 1e-3, 0.1), (-0.2, 0.5, 0.9))
    assert out[STATUS] == Status.UNIQUE
    assert out[BEST + WEIGHT] == pytest.approx(1.0)
    assert out[BEST + POSITION] == pytest.approx(-0.18)


def test_hypotheses_beside_each_other_are_two_ranges() -> None:
    out, _ = told((0.0, 1e-3, 0.6), (0.1, 1e-3, 0.4))
    assert out[STATUS] == Status.AMBIGUOUS
    assert out[BEST + POSITION] == 0.0
    assert out[BEST + WEIGHT] == pytest.approx(0.6)
