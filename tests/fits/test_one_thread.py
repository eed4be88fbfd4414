"""Fits and posteriors compute by one thread, and leave as many as before; what many cost.

A fit of 60 frames with odometry took 23 to 27 s of processor time by two threads beside ten other
processes on two processors, and takes 0.9 s by one.
"""

import operator
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import inference.posterior.fold
import inference.posterior.summary
from hybridtof import (
    RadialTrajectory,
    SamplerSettings,
    estimate,
    infer,
    parse_scene,
    parse_sensor,
    simulate,
)
from inference.realtime.net import rule_out
from simulator import one_thread as threads


def numbers() -> list[int]:
    return [library.get() for library in threads._libraries()]


@pytest.fixture
def two() -> Iterator[None]:
    """Two threads, whatever the tests were started with."""
    before = numbers()
    assert len(before) == 2, "the OpenBLAS of the wheels of numpy and scipy is not found"
    for library in threads._libraries():
        library.set(2)
    yield
    for library, n in zip(threads._libraries(), before, strict=True):
        library.set(n)


@pytest.mark.usefixtures("two")
def test_a_fit_computes_by_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    within: list[list[int]] = []

    def watched(*args: Any) -> Any:
        within.append(numbers())
        return rule_out(*args)

    monkeypatch.setattr("inference.fits.answer.likelihood_answer.rule_out", watched)
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-3]}}
    )
    truth = parse_scene({"object": {"c0": 0.08, "c1": 0.05, "c2": 0.1}})
    path = RadialTrajectory(kind="radial", from_m=0.3, to_m=1.5, frames=12, spacing="log")
    estimate(sensor, parse_scene({}), simulate(sensor, truth, path, seed=2).frames, ["joint_fit"])
    assert within == [[1, 1]]
    assert numbers() == [2, 2]


@pytest.mark.usefixtures("two")
def test_the_last_one_out_restores() -> None:
    entered, leave = threading.Event(), threading.Event()

    def other() -> None:
        with threads.one_thread():
            entered.set()
            assert leave.wait(10)

    thread = threading.Thread(target=other)
    with threads.one_thread():
        thread.start()
        assert entered.wait(10)
    assert numbers() == [1, 1]
    leave.set()
    thread.join()
    assert numbers() == [2, 2]


@pytest.mark.usefixtures("two")
def test_an_error_restores() -> None:
    with pytest.raises(ZeroDivisionError), threads.one_thread():
        raise ZeroDivisionError(numbers())
    assert numbers() == [2, 2]


@pytest.mark.usefixtures("two")
def test_a_posterior_computes_by_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    within: dict[str, list[int]] = {}

    def watched(place: str) -> None:
        function = operator.attrgetter(place)(inference.posterior)

        def watching(*args: Any, **named: Any) -> Any:
            within[place] = numbers()
            return function(*args, **named)

        monkeypatch.setattr(f"inference.posterior.{place}", watching)

    for place in ("fold.import_libraries", "fold._after", "criticism.model_check.predictive_check"):
        watched(place)
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-3]}}
    )
    truth = parse_scene({"object": {"c0": 0.08, "c1": 0.05, "c2": 0.1}})
    path = RadialTrajectory(kind="radial", from_m=0.3, to_m=1.5, frames=12, spacing="log")
    frames = simulate(sensor, truth, path, seed=2).frames
    settings = SamplerSettings(method="auto", seed=1)
    assert infer(sensor, parse_scene({}), frames, settings).verdict.converged
    assert list(within.values()) == [[1, 1]] * 3
    assert numbers() == [2, 2]
