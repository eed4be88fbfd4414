"""Statuses and reasons from draws."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.identifiability.after_data import _is_still, statuses_of_draws
from inference.identifiability.judged import Spread
from inference.identifiability.status import Identifiability
from simulator.model_error import ModelError
from simulator.parameters import Parameters, parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import UNKNOWN_CROSSTALK, sensor_of

Array = NDArray[np.float64]
SENSOR = sensor_of("pulsed")


def parameters() -> Parameters:
    return parameters_of(SENSOR, parse_scene({"crosstalk": UNKNOWN_CROSSTALK}))


def spread_of(z: Array, log_r: Array) -> Spread:
    present = np.isfinite(log_r[0])
    scale = float(log_r[:, present].mean(axis=1).std()) if present.any() else np.nan
    return Spread(z.std(axis=0), scale)


def judged(z: Array, log_r: Array) -> dict[str, Identifiability]:
    rows = statuses_of_draws(SENSOR, parameters(), spread_of(z, log_r), z, log_r)
    assert [row.parameter for row in rows] == [*parameters().names, "range_m"]
    return {row.parameter: row for row in rows}


def test_contraction_is_that_of_the_draws() -> None:
    rng = np.random.default_rng(1)
    spread = np.array([0.01, 0.1, 0.5, 0.9, 1.2])
    z = spread * rng.standard_normal((4000, 5))
    log_r = np.log(np.linspace(0.2, 2.0, 20)) + 0.1 * rng.standard_normal((4000, 1))
    rows = judged(z, log_r)
    expected = ["identified", "identified", "weak", "not_identified", "not_identified"]
    for name, sd, status in zip(parameters().names, spread, expected, strict=True):
        assert rows[name].status == status
        # the sd of 4000 draws is known to 1.1 %: six of them
        assert 1 - rows[name].contraction == pytest.approx(sd**2, rel=0.14)
    assert rows["range_m"].status == "weak"
    assert "known only to 10% of itself" in rows["range_m"].reason


def test_more_spread_than_the_curvature_says() -> None:
    """Two narrow groups of draws far apart: each tells c2, both together do not."""
    rng = np.random.default_rng(2)
    z = 1e-3 * rng.standard_normal((2000, 5))
    z[::2, 2] += 2.0
    log_r = np.log(np.linspace(0.2, 2.0, 20)) + 1e-3 * rng.standard_normal((2000, 20))
    row = judged(z, log_r)["object.c2"]
    assert row.status == "not_identified"
    assert "there are several solutions, or one valley that bends" in row.reason


@pytest.mark.parametrize("stretch", [0.3, 0.6, 1.0])
def test_a_way_whose_length_is_uncertain_is_a_way(stretch: float) -> None:
    """Draws that shift and stretch the whole way together differ in that, not frame by frame.

    Of ranges at rest, by contrast, each scatters as far from draw to draw as from frame to frame.
    """
    rng = np.random.default_rng(6)
    way = np.linspace(-0.35, 0.35, 8)
    factor = 1.0 + stretch * rng.standard_normal((2000, 1))
    shift = 0.3 * rng.standard_normal((2000, 1))
    own = 0.02 * rng.standard_normal((2000, 8))
    assert not _is_still(factor * way + shift + own)
    for frames in (2, 3, 8, 400):
        # their mean ranges scatter by as much: four times that in 1e-3 of cases of 8 frames
        means = 0.02 * np.sqrt(frames / (frames - 1)) * np.where(np.arange(frames) % 2, 1.0, -1.0)
        noise = 0.02 * rng.standard_normal((2000, frames))
        assert _is_still(means + shift + noise)
        assert not _is_still(5 * means + shift + noise)


@pytest.mark.parametrize("law", ["loguniform", "reference"])
def test_what_the_law_of_the_ranges_tells_is_not_identified_by_the_data(law: str) -> None:
    """Draws far narrower than the readings can make them."""
    scene = {"range_m": {"prior": law, "low": 0.02, "high": 15.0}, "crosstalk": UNKNOWN_CROSSTALK}
    weak, made = sensor_of("pulsed", 1.0), parameters_of(SENSOR, parse_scene(scene))
    rng = np.random.default_rng(6)
    z = 1e-4 * rng.standard_normal((500, 5))
    log_r = np.log(np.linspace(0.5, 1.0, 20)) + 1e-4 * rng.standard_normal((500, 20))
    for row in statuses_of_draws(weak, made, spread_of(z, log_r), z, log_r):
        if law == "reference":
            assert row.status == "identified"
            continue
        assert row.status != "identified"
        assert "The readings by themselves would tell it only to" in row.reason
        assert '{"prior": "reference"}' in row.reason


@pytest.mark.parametrize("shared", [0.0, 0.3])
def test_ranges_that_scatter_by_their_noise_alone_do_not_move(shared: float) -> None:
    """Also where all of them are uncertain together."""
    rng = np.random.default_rng(3)
    truth = 0.01 * rng.standard_normal(30)  # what the noise of the readings makes of one range
    log_r = truth + 0.01 * rng.standard_normal((1000, 30)) + shared * rng.standard_normal((1000, 1))
    rows = judged(rng.standard_normal((1000, 5)), log_r)
    assert "the object must move" in rows["object.c0"].reason
    moving = log_r + np.linspace(0.0, 0.2, 30)
    rows = judged(rng.standard_normal((1000, 5)), moving)
    assert "the object must move" not in rows["object.c0"].reason


def test_what_overflows_has_a_status_all_the_same() -> None:
    rng = np.random.default_rng(5)
    z = rng.standard_normal((100, 5))
    rows = judged(z, np.full((100, 3), -600.0) + 0.01 * rng.standard_normal((100, 3)))
    assert rows["object.c1"].reason == "the answer is little more than the prior"


def test_frames_without_object_and_nothing_unknown() -> None:
    rng = np.random.default_rng(4)
    log_r = np.full((100, 4), np.nan)
    rows = judged(rng.standard_normal((100, 5)), log_r)
    assert "no frame holds an object" in rows["range_m"].reason
    known = parameters_of(SENSOR, parse_scene({"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}}))
    z = np.empty((100, 0))
    log_r = 1e-3 * rng.standard_normal((100, 4))
    (row,) = statuses_of_draws(SENSOR, known, spread_of(z, log_r), z, log_r)
    assert (row.parameter, row.status) == ("range_m", "identified")


@pytest.mark.parametrize(
    ("crosstalk", "spread", "status"),
    [
        (UNKNOWN_CROSSTALK, 0.10, "not_identified"),
        (UNKNOWN_CROSSTALK, 0.04, "identified"),
        ([0.0, 0.0], 0.10, "weak"),
    ],
)
def test_a_scale_left_open_by_crosstalk_and_discrepancy_is_not_identified(
    crosstalk: list[object], spread: float, status: str
) -> None:
    scene = {"range_m": {"prior": "reference", "low": 0.05, "high": 5.0}, "crosstalk": crosstalk}
    made = parameters_of(SENSOR, parse_scene(scene))
    rng = np.random.default_rng(7)
    z = 1e-3 * rng.standard_normal((500, len(made)))
    scale = spread * rng.standard_normal((500, 1))
    log_r = np.log(np.linspace(0.2, 0.4, 20)) + 1e-4 * rng.standard_normal((500, 20)) + scale

    def row(flux: float) -> Identifiability:
        spread = spread_of(z, log_r)
        error = ModelError(flux, 0.0, integrated=False)
        return statuses_of_draws(SENSOR, made, spread, z, log_r, error=error)[-1]

    found = row(0.072)
    assert found.status == status
    assert ("crosstalk and an error of the object's flux of 0.072" in found.reason) == (
        status == "not_identified"
    )
    # nor is a scale open that is known well, however small the error is said to be
    assert spread > 0.05 or row(1e-3).status == "identified"
    # a model that is stated to be exact cannot be what leaves it open
    assert "error of the object's flux" not in row(0.0).reason
