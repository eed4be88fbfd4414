"""A posterior tells what looks like a mistake, as estimates do."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import pytest

from inference.posterior.infer import infer
from inference.stuck_readings import stuck_readings
from service.commands.infer import exit_code_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

SENSOR = parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [1e-5, 2e-5]}}
)  # fmt: skip
# nothing is unknown but the ranges: there is nothing to sample
SCENE = parse_scene(
    {
        "object": {"c0": 0.02, "c1": 0.0, "c2": 0.1},
        "crosstalk": [0.01, 0.02],
        "range_m": {"prior": "reference", "low": 0.1, "high": 2.0},
    }
)


def test_readings_of_a_stuck_reader_are_told_of() -> None:
    """Frames that repeat were silent: sure, and as wrong as the reader was stuck."""
    path = RadialTrajectory(from_m=0.2, to_m=1.0, frames=30, spacing="log")
    frames = simulate(SENSOR, SCENE, path, 3).frames
    answer = infer(SENSOR, SCENE, frames)
    assert answer.assumptions == ()
    assert answer.to_json()["assumptions"] == []
    readings = frames.readings.copy()
    readings[21:24] = readings[20]
    stuck = dataclasses.replace(frames, readings=readings)
    told = stuck_readings(SENSOR, stuck)
    assert told is not None
    assert told in infer(SENSOR, SCENE, stuck).assumptions


def test_the_command_line_says_what_was_not_said_before(
    capsys: pytest.CaptureFixture[str],
) -> None:
    result = {"verdict": {"converged": True}, "assumptions": ["one thing", "another"]}
    record: Any = SimpleNamespace(problem=None, result=result)
    args: Any = SimpleNamespace(quiet=False)
    assert exit_code_of(args, record, ["another"]) == 0
    assert capsys.readouterr().err == "hybridtof: note: one thing\n"
    older: Any = SimpleNamespace(problem=None, result={"verdict": {"converged": True}})
    assert exit_code_of(args, older, ()) == 0
    assert capsys.readouterr().err == ""
