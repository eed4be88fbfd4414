"""A posterior without draws that can be trusted: starting points are no intervals."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import identifiability
from inference.posterior import undrawn
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import standing
from service.answers.posteriors import PosteriorResponse, full
from service.cli import main
from service.store.record import QUEUED, JobRecord
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import UNKNOWN_CROSSTALK, data, sensor_of

NO_TIME = SamplerSettings(method="emcee", seed=1, max_seconds=1e-3)
SENSOR = sensor_of("pulsed")
# with crosstalk no law fits their posterior at once
UNKNOWN_WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.5},
}
SIMULATED = data(SENSOR, {"crosstalk": [0.002, 0.01]}, frames=8).frames
# the last without the object, so that it has no range to foresee anything at
FRAMES = dataclasses.replace(SIMULATED, object_present=np.arange(8) < 7)


@pytest.fixture
def untrusted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no weighted draws be enough."""
    monkeypatch.setattr(standing, "_LEAST_ESS", math.inf)


# with an optional term nothing is decided yet: it stays
@pytest.mark.usefixtures("untrusted")
@pytest.mark.parametrize("crosstalk", [UNKNOWN_CROSSTALK, {"values": UNKNOWN_CROSSTALK}])
def test_nothing_drawn_has_no_numbers_and_says_what_is_foreseen(crosstalk: Any) -> None:
    if isinstance(crosstalk, dict):
        crosstalk = crosstalk | {"optional": True}
    exact = parse_scene({"crosstalk": crosstalk, "discrepancy": 0})
    found = infer(SENSOR, exact, FRAMES, NO_TIME)
    assert not found.drawn
    assert not found.verdict.converged
    assert any("nothing was drawn" in reason for reason in found.verdict.reasons)
    assert found.fit.misfit is None
    assert found.fit.reasons == ("not checked: nothing was drawn yet",)
    for name in ("q05", "q50", "q95", "mean", "sd"):
        assert np.isnan(getattr(found.range_m, name)).all()
        assert all(math.isnan(getattr(row, name)) for row in found.parameters.values())
    assert set(found.range_m.modes) == {()}
    assert found.draws.range_m.shape == (1, 1, 0, 8)
    # eight frames, one of them empty, tell all five unknowns; what is foreseen is not yet found
    assert [row.parameter for row in found.identifiability] == [*found.parameters, "range_m"]
    for row in found.identifiability:
        assert row.status == "weak"
        assert "foreseen at the best fit so far: identified" in row.reason
    assert all(mode.weight is None for mode in found.modes)
    # what OpenAPI says is what is sent
    result = found.to_json()
    record = JobRecord("a", "", "emcee", 1, "", 1, 1, "done", False, 1, QUEUED, 0, 0, result)
    answer = PosteriorResponse.model_validate(full(record))
    assert answer.model_dump(exclude={"problem"}) == full(record)


@pytest.mark.usefixtures("untrusted")
def test_nothing_drawn_of_a_sensor_of_unknown_drifts_has_no_numbers_either() -> None:
    drifts = {"gain_drift_per_k": {"prior": "normal", "mean": 0.0, "sd": 3e-3}}
    sensor = parse_sensor(SENSOR.model_dump() | {"temperature": drifts})
    warm = dataclasses.replace(FRAMES, temperature_k=np.linspace(290.0, 310.0, 8))
    found = infer(sensor, parse_scene({"crosstalk": UNKNOWN_CROSSTALK}), warm, NO_TIME)
    assert not found.drawn
    assert np.isnan(found.range_m.mean).all()
    assert found.draws.range_m.shape == (1, 1, 0, 8)


@pytest.mark.usefixtures("untrusted")
def test_an_object_at_rest_foresees_what_it_will_never_tell() -> None:
    still = data(SENSOR, frames=8, span=(0.241, 0.2411)).frames
    rows = infer(SENSOR, parse_scene({"motion": "static"}), still, NO_TIME).identifiability
    by_name = {row.parameter: row for row in rows}
    assert by_name["object.c0"].status == "not_identified"
    assert "the object must move" in by_name["object.c0"].reason


@pytest.mark.usefixtures("untrusted")
def test_a_ruler_is_foreseen_as_it_was_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the clock errs by is counted where it is foreseen, and once."""
    asked: list[Any] = []

    def listening(*args: Any, **more: Any) -> Any:
        asked.append(more)
        return identifiability(*args, **more)

    monkeypatch.setattr(undrawn, "identifiability", listening)
    known = np.append(np.geomspace(0.1, 2.0, 8)[:7], np.nan)
    told = dataclasses.replace(FRAMES, known_range_m=known, known_range_sd_m=np.full(8, 1e-3))
    rows = infer(SENSOR, parse_scene({"crosstalk": UNKNOWN_CROSSTALK}), told, NO_TIME)
    assert "foreseen at the best fit so far" in rows.identifiability[0].reason
    (of,) = asked
    assert of["known_range_sd_m"] == [pytest.approx(1e-3)] * 7 + [None]


def test_the_command_line_does_not_take_it_for_an_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frames, scene, draws = (tmp_path / name for name in ("f.json", "s.json", "d.nc"))
    readings = dict(zip(("w1", "w2"), SIMULATED.readings[:4].T.tolist(), strict=True))
    frames.write_text(json.dumps(readings))
    stated = {
        "sensor": SENSOR.model_dump(mode="json", exclude_none=True),
        "scene": {"crosstalk": UNKNOWN_CROSSTALK, "background": UNKNOWN_WALL},
    }
    scene.write_text(json.dumps(stated))
    arguments = [str(frames), "--scene", str(scene), "--max-seconds", "0.001", "--seed", "1"]
    assert main(["infer", *arguments, "--draws", str(draws)]) == 3
    out, err = capsys.readouterr()
    printed = json.loads(out)
    assert printed["drawn"] is False
    assert printed["fit"]["misfit"] is None
    assert printed["range_m"]["q50"] == [None] * 4
    assert "not converged: stopped at the time limit" in err
    assert "is not written: nothing was drawn" in err
    assert not draws.exists()
