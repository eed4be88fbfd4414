"""How far a range may err to the far side, beside crosstalk that is learnt."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.tracking.far_side import far_side_variance
from inference.tracking.hypotheses import COUNT, Hypotheses, U, V
from inference.tracking.readings_table import mean_at
from inference.tracking.report import (
    BEST,
    HYPOTHESIS_COLUMNS,
    REPORT_COLUMNS,
    SD,
    report,
)
from inference.tracking.settings import TrackingSettings
from inference.tracking.tracker import tracker
from tests.tracking.scenes import PLATE, scene_of, sensor_of

Array = NDArray[np.float64]

LEARNS = tracker(
    sensor_of(1e-4), scene_of(PLATE), TrackingSettings(crosstalk_drift=(1e-5, 1e-5))
).model
KNOWN = tracker(sensor_of(1e-4), scene_of(PLATE)).model


def hypothesis(u: float, sd: float, states: int) -> Hypotheses:
    """Return one object, known to a standard deviation of log r, with a weight of 1."""
    of = Hypotheses(
        np.zeros((2, states + (states > 2))),
        np.zeros((2, states, states)),
        np.array([0.0, 1.0]),
        np.zeros(22),
    )
    of.x[1, U], of.X[1, U, U], of.X[1, V, V] = u, sd, 1.0
    of.numbers[COUNT] = 1.0
    return of


def told_sd(of: Hypotheses, learns: bool) -> float:
    """Return the standard deviation of log r that is answered."""
    model = LEARNS if learns else KNOWN
    out = np.full((1, REPORT_COLUMNS), np.nan)
    rows = np.full((1, 1, HYPOTHESIS_COLUMNS), np.nan)
    described = np.zeros((len(of.weight), HYPOTHESIS_COLUMNS))
    report(out, rows, 0, of, model.rules, model.table, described)
    return float(out[0, BEST + SD])


@pytest.mark.parametrize("u", [np.log(0.3), 0.0, np.log(1.5)])
@pytest.mark.parametrize("sd", [0.003, 0.03, 0.2])
def test_it_is_the_deviation_by_the_slope_at_the_far_end(u: float, sd: float) -> None:
    """The obvious reference: slopes of the table at both places, in numpy."""
    here = np.hypot(*mean_at(u, LEARNS.table)[2:])
    there = np.hypot(*mean_at(u + 1.645 * sd, LEARNS.table)[2:])
    assert told_sd(hypothesis(u, sd, 4), True) == pytest.approx(sd * max(here / there, 1.0))


def test_a_range_that_is_sharp_is_as_sharp_as_before() -> None:
    """The light of a far object falls with the fourth power: 1 % of range is 7 % of the slope."""
    for u in (np.log(0.3), 0.0, np.log(1.5)):
        assert 1e-3 <= told_sd(hypothesis(u, 1e-3, 4), True) < 1.01e-3


def test_beside_known_crosstalk_nothing_is_added() -> None:
    assert told_sd(hypothesis(0.0, 0.2, 2), False) == pytest.approx(0.2)


def test_at_the_end_of_the_ranges_and_beyond_it_is_none_or_finite() -> None:
    end = LEARNS.table.end
    for u, sd in ((end, 0.3), (end - 0.1, 30.0), (LEARNS.table.start, 300.0)):
        added = far_side_variance(hypothesis(u, sd, 4), 1, LEARNS.table)
        assert 0.0 <= added < np.inf
