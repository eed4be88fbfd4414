"""Coverage over classes of paths: data sets, rows and tables of the study."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.coverage.path_rows import COLUMNS, row_of
from benchmarks.coverage.path_study import random_tables, summary, wrong
from benchmarks.coverage.paths import LIGHT, PATHS, TOLD, draw_path, random_scene
from inference.posterior.settings import SamplerSettings
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.scene_checks import check_scene


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("light", LIGHT)
def test_a_data_set_is_what_its_class_says(path: str, light: str) -> None:
    for number, kind in enumerate(("pulsed", "sine_wave")):
        data, again = (
            draw_path(path, light, "exact", number),
            draw_path(path, light, "exact", number),
        )
        np.testing.assert_array_equal(data.frames.readings, again.frames.readings)
        assert data.sensor.kind == kind
        assert np.all((data.range_m > 0.1) & (data.range_m < 2.4))
        assert np.ptp(data.range_m) > 0.0
        scene = parse_scene(data.scene)
        check_scene(data.sensor, scene)
        assert scene.range_m is None
        # the truth of every unknown is there, and is possible
        parameters = parameters_of(data.sensor, scene)
        truth = np.array([[data.parameters[name] for name in parameters.names]])
        assert np.abs(parameters.standard(truth)).max() < 6.0


def test_what_is_told_besides() -> None:
    for told in TOLD:
        scene = parse_scene(draw_path("log-spaced", "crosstalk", told, 0).scene)
        assert (scene.range_m is not None) == (told == "loguniform")
        assert (scene.model_error.flux > 0) == told.startswith("nothing")


def test_random_scenes_differ_and_come_again() -> None:
    names = {random_scene(1, number).name for number in range(30)}
    assert len(names) > 10
    np.testing.assert_array_equal(random_scene(2, 3).range_m, random_scene(2, 3).range_m)


def test_a_row_holds_what_the_posterior_says() -> None:
    """An object alone at SNR 300: all is identified, and no mean is beyond 5 sd (1e-5 of runs)."""
    data = draw_path("at rest, a few moves", "object", "exact", 0)
    row = row_of(data, SamplerSettings(method="auto", seed=1), "v")
    assert set(row) | {"set"} == set(COLUMNS)
    assert row["converged"] == 1
    assert row["unknowns"] == 3
    assert 0 < float(row["worst"]) < 5
    text = {name: str(value) for name, value in row.items()}
    assert wrong([text]) == []
    far = text | {"worst": "5.1"}
    assert wrong([far, far | {"misfit": "1"}, far | {"converged": "0"}]) == [far]
    lost = dict.fromkeys(COLUMNS, "") | {"converged": "0"}
    assert summary("all", [far, lost]).startswith("| all | 2 | 1 |")


def test_a_random_walk_is_no_table_of_random_scenes(tmp_path: Path) -> None:
    for name in ("random-17.csv", "random-walk-crosstalk-nothing.csv"):
        (tmp_path / name).touch()
    assert random_tables(tmp_path) == [tmp_path / "random-17.csv"]
