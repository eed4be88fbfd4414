"""Coverage outside the posterior's own model: data sets, rows and tables of the study."""

import numpy as np
import pytest

from benchmarks.coverage.classes import CLASSES, FRAMES, TERMS, draw, told
from benchmarks.coverage.intervals import COLUMNS, interval_row
from benchmarks.coverage.recorded import CELLS
from benchmarks.coverage.report import confidently_wrong, coverage, recorded_report, report
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.scene_checks import check_scene
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory
from tests.posterior.scenes import OBJECT, sensor_of


@pytest.mark.parametrize("slug", CLASSES)
@pytest.mark.parametrize("number", [0, 1])
def test_a_data_set_is_what_its_class_says(slug: str, number: int) -> None:
    group = CLASSES[slug]
    data, again = draw(group, number), draw(group, number)
    np.testing.assert_array_equal(data.frames.readings, again.frames.readings)
    assert data.sensor.kind == ("pulsed", "sine_wave")[number]
    assert data.range_m.shape == (FRAMES,)
    assert np.all((data.range_m > 0.05) & (data.range_m < 3.0))
    assert set(data.terms) == {name for name in ("crosstalk", "background") if getattr(group, name)}
    for term in TERMS:
        check_scene(data.sensor, parse_scene(told(data, term)))
    # readings of light, far above their noise
    assert np.all(np.hypot(*data.frames.readings.T) > 20 * data.sensor.noise.read[0])
    if group.tilts == ("T00",):
        assert data.name.endswith("T00")


def test_readings_belong_to_the_true_ranges() -> None:
    """Without crosstalk or background w1 / w2 is the true range: chi-square at 1e-4."""
    data = draw(CLASSES["glossy-disk-t00"], 2)
    w1, w2 = data.frames.readings.T
    r0 = data.sensor.max_range_m
    noise = data.sensor.noise.read[0]
    sd = noise * np.sqrt(1 + (data.range_m / r0) ** 2)
    # 24 normal variates beyond 4.7 with probability 6e-5
    assert np.all(np.abs(w1 - w2 * data.range_m / r0) < 4.7 * sd)


def test_a_row_holds_what_the_posterior_says() -> None:
    """In its own model, with the object known, intervals hold 60 % of the truths or more.

    Ranges of a known object are independent: fewer than 24 of 40 with probability 1e-7.
    """
    sensor = sensor_of("pulsed")
    path = RadialTrajectory(from_m=0.2, to_m=1.5, frames=40, spacing="log")
    scene = {"object": OBJECT, "range_m": {"prior": "loguniform", "low": 0.1, "high": 2.0}}
    made = simulate(sensor, parse_scene(scene), path, 5)
    settings = SamplerSettings(seed=1)
    row = interval_row("plate", sensor, scene, made.frames, made.range_m, settings, "v")
    assert set(row) | {"set"} == set(COLUMNS)
    assert float(row["inside"]) >= 0.6
    assert 0 < float(row["width"]) < 0.1
    assert row["converged"] == 1
    wrong = interval_row("plate", sensor, scene, made.frames, 2 * made.range_m, settings, "v")
    assert wrong["inside"] == 0.0
    assert float(wrong["error"]) == pytest.approx(-0.5, abs=0.05)


def _row(inside: str, misfit: str = "0", scale: str = "identified") -> dict[str, str]:
    return dict.fromkeys(COLUMNS, "") | {
        "scene": "plate",
        "inside": inside,
        "width": "0.02",
        "error": "-0.01",
        "misfit": misfit,
        "scale": scale,
        "converged": "1",
        "seconds": "2.0",
    }


def test_a_class_is_judged_over_data_sets() -> None:
    rows = [_row("1.0")] * 30 + [_row("0.0", misfit="1")] * 20
    found = coverage("disks", "default", rows)
    assert found.inside == pytest.approx(0.6)
    # whole data sets are right or wrong: the binomial error of fifty, not of fifty times the frames
    error = np.sqrt(0.6 * 0.4 / 50)
    assert found.high - found.low == pytest.approx(2 * 1.96 * error, rel=0.15)
    assert found.warned == 20
    assert found.inside_unwarned == 1.0
    assert not found.reached
    assert "outside 85% to 95% by default: disks: 60.0%" in report([found])
    refused = coverage("disks", "default", [dict.fromkeys(COLUMNS, "")] * 3)
    assert (refused.inside, refused.refused) == (0.0, 3)


def test_confidently_wrong_is_said() -> None:
    assert confidently_wrong(_row("0.79"))
    assert not confidently_wrong(_row("0.81"))
    assert not confidently_wrong(_row("0.0", misfit="1"))
    assert not confidently_wrong(_row("0.0", scale="not_identified"))
    assert confidently_wrong(_row("0.0", scale="weak"))
    text = recorded_report([("exact", _row("0.1")), ("default", _row("0.9"))])
    assert "exact: 1 of 1 confidently wrong" in text
    assert "default: 0 of 1 confidently wrong" in text


def test_the_recorded_cells_are_all_there() -> None:
    assert len({cell.name for cell in CELLS}) == len(CELLS) == 32
