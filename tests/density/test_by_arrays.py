"""What the interpreter does by arrays has the bits of the loops that it stands for."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import CollapsedDensity
from inference.frame import light_by_arrays, modes_by_arrays, table, table_by_arrays
from inference.frame.arguments import scene_of
from inference.frame.light_by_arrays import NotByArraysError
from inference.frame.range_prior import integration_bounds
from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from service.warm import questions
from simulator import uncompiled
from simulator.compiled import Kernel

_WALL = questions._CROSSTALK | {"background": questions._FREE_WALL}
_SHOT = {"read": [1e-5, 1e-4], "shot": 1e-6}
_RELATIVE = {"read": [3e-5, 3e-5], "relative": 0.02}


def _as_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uncompiled, "by_arrays", lambda function, plain: plain)  # noqa: ARG005
    monkeypatch.setattr(uncompiled, "_names", {})
    monkeypatch.setattr(uncompiled, "_twins", {})


def _interpreted(kernel: Kernel, *args: Any) -> Any:
    return uncompiled.run(kernel._function, args, math.inf)[0]


def _answers(density: CollapsedDensity, z: Any) -> list[bytes]:
    """Integrals with the reference prior, and maxima without it."""
    return [density.frame_log_likelihoods(z).tobytes(), density.best_ranges(z).tobytes()]


@pytest.mark.parametrize(
    ("sensor", "scene", "unknowns"),
    [
        (questions._PULSED, {}, 3),
        (questions._SINE, {"crosstalk": [1e-4, -2e-4]}, 3),
        (questions._SINE, _WALL, 9),
        (questions._PULSED | {"noise": _SHOT}, _WALL, 9),
        (questions._PULSED | {"noise": _RELATIVE | _SHOT}, questions._CROSSTALK, 5),
        (questions._SINE | {"noise": _RELATIVE}, {}, 3),
        (questions._PULSED, {"range_m": {"prior": "normal", "mean": 0.5, "sd": 0.3}}, 3),
    ],
)
def test_by_arrays_are_the_loops(
    sensor: dict[str, Any], scene: dict[str, Any], unknowns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "_FRAMES", 3)
    monkeypatch.setattr(Kernel, "__call__", _interpreted)
    walled = "background" in scene
    parsed, known, frames = questions._question(sensor, scene, walled, "crosstalk" in scene)
    density = fold.prepare(parsed, known, frames, SamplerSettings(seed=1)).density()
    z = np.random.default_rng(3).normal(size=(2, unknowns)) * 0.5
    counted = _counted(monkeypatch)
    quick = _answers(density, z)
    # of shot noise the reference prior is left to the loop
    assert counted["scan"] > 0
    assert counted["table"] > 0
    _as_loops(monkeypatch)
    assert _answers(density, z) == quick


@pytest.mark.parametrize("strongest", [0.3, 1.7, 30.0])
@pytest.mark.parametrize("sensor", [questions._PULSED, questions._SINE])
def test_tables_of_any_gain_are_those_of_the_loops(
    sensor: dict[str, Any], strongest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "_FRAMES", 3)
    monkeypatch.setattr(Kernel, "__call__", _interpreted)
    parsed, known, frames = questions._question(sensor, _WALL, True, True)
    density = fold.prepare(parsed, known, frames, SamplerSettings(seed=1)).density()
    terms = density.parameters.terms(np.full((1, 9), 0.1))
    scene = scene_of(density.integral_rows(terms), density.instrument, 0)
    bounds = integration_bounds(scene.range_prior)
    counted = _counted(monkeypatch)
    quick = uncompiled.twin(table.tabulate)(bounds, scene, strongest)
    assert counted["table"] == 1
    _as_loops(monkeypatch)
    assert uncompiled.twin(table.tabulate)(bounds, scene, strongest).tobytes() == quick.tobytes()


def _counted(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Count what is answered by arrays."""
    answered = {"scan": 0, "table": 0}

    def counting(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def count(*args: Any) -> Any:
            found = function(*args)
            answered[name] += found is not NotImplemented
            return found

        return count

    for module, function, name in (
        (modes_by_arrays, "_scan", "scan"),
        (table_by_arrays, "tabulate", "table"),
    ):
        monkeypatch.setattr(module, function, counting(name, getattr(module, function)))
    monkeypatch.setattr(uncompiled, "_names", {})
    monkeypatch.setattr(uncompiled, "_twins", {})
    return answered


@pytest.mark.parametrize("pulsed", [True, False])
@pytest.mark.parametrize("shot", [None, 1e-6])
def test_segments_to_split(
    pulsed: bool, shot: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(5)
    answers = []
    rows = rng.normal(size=(6, 40)).cumsum(axis=1)
    rows[0] = np.sort(rng.normal(size=40))
    rows[0, 7] = rows[0, 6]  # a segment as short as it can be
    rows[4, 20:23] = math.nan, math.inf, -math.inf
    for loops in (False, True):
        if loops:
            _as_loops(monkeypatch)
        split = np.empty(39, dtype=bool)
        with np.errstate(all="ignore"):
            marked = uncompiled.twin(table._too_coarse)(
                split, rows, (0.2, -0.3), (0.5, 0.7), pulsed, shot
            )
        answers.append((int(marked), split.tobytes()))
    assert answers[0] == answers[1]
    assert 0 < answers[0][0] < 39


def test_what_python_refuses_is_left_to_the_loop() -> None:
    values = np.array([1.0, 2.5])
    assert light_by_arrays.of_each(math.log, values).tolist() == [math.log(1.0), math.log(2.5)]
    for function, refused in ((math.log, 0.0), (math.log, -1.0), (math.exp, 1e4)):
        with pytest.raises(NotByArraysError):
            light_by_arrays.of_each(function, np.array([1.0, refused]))
