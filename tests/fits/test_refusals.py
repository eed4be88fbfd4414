"""What frames do not determine is refused, with the reason and a remedy."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Estimates, Status
from inference.fits.answer.counts import frames_needed
from inference.fits.likelihood.unknowns import unknowns_of
from inference.identifiability.experiment import Experiment, information
from inference.plan import plan
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.sensor import Sensor
from tests.fits.scenes import OBJECT, SIGNAL_AT_1M, VAGUE, WALL, data, exact_scene, path, sensor_of
from tests.thorough import first

PRIOR = {"prior": "lognormal", "median": 1.0, "sigma": 1.0}
CROSSTALK = {"crosstalk": [VAGUE, VAGUE]}
TRUTH = {"object": OBJECT, "crosstalk": [0.002, 0.01]}


def refusal(sensor: Sensor, scene: dict[str, Any], frames: Frames, name: str = "joint_fit") -> str:
    return said_by(estimate(sensor, exact_scene(scene), frames, [name]), name)


def said_by(found: Estimates, name: str = "joint_fit") -> str:
    assert not found.results
    return next(item.reason for item in found.left_out if item.name == name)


@pytest.mark.parametrize(
    ("scene", "minimum"),
    [
        ({"object": {"c0": 0.1, "c1": 0.0}, **CROSSTALK}, 3),  # D
        (CROSSTALK, 5),  # E
        ({"background": {"strength": PRIOR, "distance_m": PRIOR, "shadow": "object"}}, 5),  # A
        ({"background": {"strength": PRIOR, "distance_m": PRIOR}}, 7),  # B
        ({"background": {"strength": 1.0, "distance_m": 3.0}}, 5),  # G
        ({"background": {"strength": 1.0, "distance_m": 3.0, "shadow": "object"}}, 3),  # G2
        (
            {
                "object": OBJECT,
                "background": {"strength": PRIOR, "distance_m": PRIOR, "shadow": WALL["shadow"]},
            },
            2,
        ),  # C
        (
            {
                **CROSSTALK,
                "background": {"strength": PRIOR, "distance_m": PRIOR, "shadow": "object"},
            },
            7,
        ),  # F1
        ({**CROSSTALK, "background": {"strength": PRIOR, "distance_m": PRIOR}}, 9),  # F2
        # of a pulse both move the first reading of an empty scene
        (
            {
                "object": {"c0": 0.1, "c1": 0.0},
                "crosstalk": [VAGUE, 0.02],
                "background": {**WALL, "distance_m": PRIOR},
            },
            3,
        ),
    ],
)
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_one_frame_more_than_determines_the_unknowns(
    scene: dict[str, Any], minimum: int, kind: str
) -> None:
    """The minimum counts are those of the study's section 2, less the rank of empty scenes."""
    sensor = sensor_of(kind)
    unknowns = unknowns_of(sensor, exact_scene(scene))
    assert frames_needed(kind, unknowns, empty=False) == minimum + 1
    parameters = parameters_of(sensor, exact_scene(scene))
    empty = Experiment(sensor, parameters, np.zeros(len(parameters)), np.full(3, np.nan))
    told = information(empty).rank
    assert frames_needed(kind, unknowns, empty=True) == minimum + 1 - told


def test_too_few_frames() -> None:
    sensor = sensor_of("pulsed", 1e5)
    reason = refusal(sensor, CROSSTALK, data(sensor, TRUTH, path(5)))
    assert "at least 6" in reason
    assert "has 5" in reason
    assert "posterior" in reason
    frames = data(sensor, TRUTH, path(6))
    assert estimate(sensor, exact_scene(CROSSTALK), frames, ["joint_fit"]).results
    # an empty scene tells both crosstalks
    frames = data(sensor, TRUTH, path(4, 1))
    assert estimate(sensor, exact_scene(CROSSTALK), frames, ["joint_fit"]).results
    assert "at least 4" in refusal(sensor, CROSSTALK, data(sensor, TRUTH, path(3, 1)))


def test_a_linear_fit_of_as_many_frames_as_unknowns_asks_for_one_more() -> None:
    """Three unknowns of the object; that three frames do not move enough is not what is wrong."""
    sensor = sensor_of("pulsed", 1e5)
    frames = data(sensor, {"object": OBJECT}, path(3))
    reason = refusal(sensor, {}, frames, "object_fit")
    assert "at least 4 frames" in reason
    assert "has 3" in reason
    frames = data(sensor, {"object": OBJECT}, path(5))
    assert estimate(sensor, exact_scene({}), frames, ["object_fit"]).results
    # two of five have no range
    dark = frames.readings.copy()
    dark[:2, 1] *= -1.0
    reason = refusal(sensor, {}, dataclasses.replace(frames, readings=dark), "object_fit")
    assert "at least 4 frames that have a range by conventional" in reason
    assert "has 3" in reason


def test_saturated_frames_do_not_count() -> None:
    sensor = sensor_of("pulsed", 1e5).model_copy(update={"full_scale": (10.0, 10.0)})
    frames = data(sensor, TRUTH, path(7))
    bright = frames.readings.copy()
    bright[:2, 1] = 10.0
    shown = dataclasses.replace(frames, readings=bright)
    assert "has 5" in refusal(sensor, CROSSTALK, shown)
    bright[1] = frames.readings[1]
    shown = dataclasses.replace(frames, readings=bright)
    result = estimate(sensor, exact_scene(CROSSTALK), shown, ["joint_fit"]).results[0]
    assert result.status[0] == Status.SATURATED
    assert (result.status[1:] == Status.UNIQUE).all()


def test_an_object_that_does_not_move() -> None:
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, TRUTH, path(12, span=(1.0, 1.0 + 1e-12)))
    reason = refusal(sensor, CROSSTALK, frames)
    assert "does not move" in reason
    assert "object_present" in reason


def test_motions_that_the_model_does_not_describe() -> None:
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, TRUTH, path(12))
    for motion in ("static", "tangential"):
        assert motion in refusal(sensor, {**CROSSTALK, "motion": motion}, frames)
    optional = {"crosstalk": {"values": [VAGUE, VAGUE], "optional": True}}
    assert "leaves crosstalk to the data" in refusal(sensor, optional, frames)
    assert "nothing but the ranges" in refusal(sensor, {"object": OBJECT}, frames)


def test_what_noise_leaves_open_is_refused_and_named() -> None:
    """Crosstalk, wall and shadow unknown at a signal-to-noise ratio of 100: hopeless."""
    sensor = sensor_of("pulsed", 100.0)
    scene = {**CROSSTALK, "background": {"strength": PRIOR, "distance_m": PRIOR}}
    truth = {**TRUTH, "background": WALL}
    # as few frames as determine them
    reason = refusal(sensor, scene, data(sensor, truth, path(10)))
    assert "relative standard deviation" in reason or "cannot be determined" in reason
    assert "object.c0" in reason


def test_a_fit_is_chosen_where_no_single_frame_serves() -> None:
    sensor = sensor_of("pulsed", 1e5)
    frames = dataclasses.replace(data(sensor, TRUTH, path(8)), time_s=None)
    chosen = plan(sensor, exact_scene(CROSSTALK), frames)
    assert chosen.chosen == "joint_fit"
    found = estimate(sensor, exact_scene(CROSSTALK), frames)
    assert [result.technique for result in found.results] == ["joint_fit"]
    # refused by what the frames hold: nothing is chosen, and the reason is told
    still = dataclasses.replace(data(sensor, TRUTH, path(8, span=(1.0, 1.0 + 1e-12))), time_s=None)
    found = estimate(sensor, exact_scene(CROSSTALK), still)
    assert found.chosen is None
    assert found.results == ()
    reasons = {item.name: item.reason for item in found.left_out}
    assert "does not move" in reasons["joint_fit"]


def test_settings_say_what_they_are_for() -> None:
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, TRUTH, path(12))
    assert "known or absent" in refusal(sensor, {}, frames, "iterative_differential")
    scene = {"background": WALL}
    assert "not immune" in refusal(sensor, scene, frames, "iterative_differential")
    assert '"shadow": "object"' in refusal(sensor, scene, frames, "iterative_background_cancelling")


def test_a_reading_beyond_numbers_in_units_of_its_noise() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, {"object": OBJECT}, path(12))
    frames.readings[3] = 1e306
    found = estimate(sensor, exact_scene({}), frames, ["joint_fit"])
    assert not found.results
    reasons = {item.name: item.reason for item in found.left_out}
    assert "times its noise" in reasons["joint_fit"]


@pytest.mark.parametrize("span", [(0.7, 0.7 + 1e-12), (0.69, 0.71)])
def test_noise_is_not_taken_for_the_shape_of_an_object_that_hardly_moves(
    span: tuple[float, float],
) -> None:
    """A pole among the ranges fits such noise better than the truth does, and is sure of itself.

    Three of six sets each, refused; a still object is taken for a moving one in 1e-3 of sets.
    """
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-5)
    for seed in first(3, range(6)):
        shown = data(sensor, {"object": OBJECT}, path(200, span=span), seed)
        found = estimate(sensor, exact_scene({}), shown, ["joint_fit"])
        if span[1] > 0.7 + 1e-9 and found.results:
            # answered where the noise was not followed: the ranges are right
            (result,) = found.results
            off = np.abs(result.range_m - np.linspace(*span, 200)) / result.sd_m
            assert np.mean(off < 2.0) > 0.8
            assert np.isfinite(off).mean() > 0.9
            continue
        said = said_by(found)
        assert ("does not move" if span[1] < 0.7 + 1e-9 else "follow the noise") in said
        # an empty scene shows nothing of an object
        assert "object_present" not in said


def test_an_object_seen_from_noise_of_its_own_size_is_not_said_to_rest() -> None:
    """The relative error belongs to the object's light, not to crosstalk a hundred times as bright.

    Four of twelve sets; of their refusals none may say that the frames read the same.
    """
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-4, relative=0.05)
    truth = {"object": OBJECT, "crosstalk": [1.0, 5.0]}
    wide = {"prior": "normal", "mean": 0.0, "sd": 10.0}
    for seed in first(4, range(12)):
        frames = data(sensor, truth, path(20, span=(0.6, 1.2)), seed)
        found = estimate(sensor, exact_scene({"crosstalk": [wide, wide]}), frames, ["joint_fit"])
        assert all("does not move" not in item.reason for item in found.left_out)


def test_what_empty_scenes_do_not_show_is_not_asked_of_them() -> None:
    """Where they are there already they are not asked for, and two numbers missing are two."""
    sensor = sensor_of("pulsed", 1e4)
    still = path(12, 3, span=(1.0, 1.0 + 1e-12))
    said = refusal(sensor, CROSSTALK, data(sensor, TRUTH, still))
    assert "object_present" not in said
    assert "state 2 of them as known" in said


def test_values_that_no_optimum_stands_at_widen_the_intervals() -> None:
    """From 0.6 to 0.8 m noise leaves a valley of c0 from its least to its largest prior values.

    Curvature at this set's optimum, and a walk from it, tell c0 to a third.
    """
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-5)
    frames = data(sensor, {"object": OBJECT}, path(40, span=(0.6, 0.8)), 10)
    (result,) = estimate(sensor, exact_scene({}), frames, ["joint_fit"]).results
    assert result.parameters is not None
    assert result.parameters["object.c0"]["status"] == "not_identified"
