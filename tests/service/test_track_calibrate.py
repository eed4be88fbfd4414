"""``hybridtof track --calibrate``: real posteriors, on the command line."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.self_calibration.test_following import SENSOR, STATED, TRUTH, course
from tests.service.said import Said, written


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    columns = course().select(slice(0, 240)).to_columns(SENSOR)
    rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    path = tmp_path_factory.mktemp("calibrate") / "frames.ndjson"
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return path


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    of = {
        "sensor": SENSOR.model_dump(mode="json", exclude_none=True),
        "scene": STATED.model_dump(mode="json", exclude_none=True),
        "tracking": {"rate_sd": 0.5},
    }
    return written(tmp_path / "scene.json", of)


def answers(said: Said) -> list[dict[str, Any]]:
    assert (said.code, said.err) == (0, "")
    return [json.loads(line) | {"latency_s": None} for line in said.out.splitlines()]


def test_a_recording_is_calibrated_and_replayed_to_the_last_bit(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, frames: Path
) -> None:
    asked = ("track", frames, "--scene", scene, "--calibrate", "--seed", "7")
    said = answers(Said(capsys, *asked, "--lag", "45"))
    events = [line["calibration"] for line in said if "calibration" in line]
    first = events[0]
    assert (first["kind"], first["number"]) == ("taken", 1)
    assert first["applies_at"] == first["sequence"] == first["decided_at"] + 45
    after = first["after"]["scene"]["crosstalk.w2"]
    # the mean of empty frames: standard deviation of a reading over the root of 24, 5 of them
    assert abs(after["q50"] - TRUTH[1]) < 5 * 8e-5 / 24**0.5
    assert [line["sequence"] for line in said] == list(range(1, 241))
    told = tmp_path / "answers.ndjson"
    told.write_text("".join(json.dumps(line) + "\n" for line in said))
    assert answers(Said(capsys, *asked, "--replay", told)) == said
    stands = written(tmp_path / "stream.json", {"calibration": {"events": events}})
    assert answers(Said(capsys, *asked, "--replay", stands)) == said
    # told of none, it takes none
    none = written(tmp_path / "none.json", {"calibration": {"events": []}})
    assert not any(
        "calibration" in line for line in answers(Said(capsys, *asked, "--replay", none))
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--seed", "7"), "--seed: is of calibrations: needs --calibrate"),
        (("--calibrate", "--lag", "0"), "--lag: must be 1 or more"),
        (("--calibrate", "--seed", "-1"), "--seed: must be an integer from 0"),
        (("--calibrate", "--replay", "{scene}"), "neither answers of a stream"),
        (("--calibrate", "--replay", "nowhere"), "nowhere"),
    ],
)
def test_bad_options_are_refused(
    capsys: pytest.CaptureFixture[str],
    scene: Path,
    frames: Path,
    options: tuple[str, ...],
    message: str,
) -> None:
    given = [scene if option == "{scene}" else option for option in options]
    said = Said(capsys, "track", frames, "--scene", scene, *given)
    assert (said.code, said.out) == (2, "")
    assert message in said.err


def test_a_scene_of_which_all_is_known_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, scene: Path, frames: Path
) -> None:
    document = json.loads(scene.read_text())
    document["scene"] |= {"crosstalk": [0.0, 0.0]}
    known = written(tmp_path / "known.json", document)
    said = Said(capsys, "track", frames, "--scene", known, "--calibrate")
    assert said.code == 2
    assert "--calibrate: nothing of the scene is unknown" in said.err
