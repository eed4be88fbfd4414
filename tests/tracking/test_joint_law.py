"""A tracker of a calibrated scene: it knows what one with the posterior's draws knows."""

import numpy as np
import pytest

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from inference.tracking.tracker import tracker
from service.problems import describe
from simulator.errors import RefusedError
from simulator.frames import frames_from_columns
from simulator.parameters import parameters_of
from simulator.priors import LogNormal
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-4, 1e-4]}})
STATED = {"crosstalk": [{"prior": "normal", "mean": 0.003, "sd": 0.05}] * 2}
NAMES = parameters_of(SENSOR, parse_scene(STATED)).names


@pytest.mark.parametrize("drift", [None, (1e-5, 1e-5)])
@pytest.mark.parametrize("discrepancy", [0, 0.05])
def test_a_law_and_draws_of_it_are_the_same(
    drift: tuple[float, float] | None, discrepancy: float
) -> None:
    rng = np.random.default_rng(1)
    d = len(NAMES)
    root = 0.01 * np.tril(rng.normal(size=(d, d)))
    normal = rng.standard_normal((400, d))
    normal -= normal.mean(axis=0)
    normal = normal @ np.linalg.inv(np.linalg.cholesky(normal.T @ normal / 399)).T
    prior = parse_scene(STATED | {"discrepancy": discrepancy})
    draws = parameters_of(SENSOR, prior).natural(normal @ root.T)
    mode = {"mean": [0.0] * d, "covariance": (root @ root.T).tolist()}
    law = parse_scene(
        STATED | {"discrepancy": discrepancy, "joint": {"unknowns": list(NAMES), "modes": [mode]}}
    )
    settings = TrackingSettings(crosstalk_drift=drift)
    path = RadialTrajectory(from_m=0.5, to_m=1.2, frames=8, duration_s=4.0)
    truth = parameters_of(SENSOR, prior).natural(np.zeros((1, d)))[0].tolist()
    known = {
        "object": dict(zip(("c0", "c1", "c2"), truth[:3], strict=True)),
        "crosstalk": truth[3:],
    }
    frames = simulate(SENSOR, parse_scene(known), path, 3).frames
    here = track(SENSOR, law, frames, settings)
    there = track(SENSOR, prior, frames, settings, draws)
    assert np.isfinite(here.range_m[2:]).all()
    # second differences of directions that are turned: a hundredth of one that is a hundredth wide
    assert np.allclose(here.range_m, there.range_m, rtol=1e-3, equal_nan=True)
    assert np.allclose(here.sd_m, there.sd_m, rtol=2e-2, equal_nan=True)


def test_what_the_law_does_not_name_is_refused() -> None:
    joint = {"unknowns": ["object.c0"], "modes": [{"mean": [0.0], "covariance": [[1e-6]]}]}
    frames = simulate(
        SENSOR,
        parse_scene({"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}}),
        RadialTrajectory(from_m=0.5, to_m=1.2, frames=2),
        3,
    ).frames
    with pytest.raises(RefusedError, match=r"object\.c1 and object\.c2 unknown, by a factor of"):
        track(SENSOR, parse_scene({"joint": joint}), frames)


def test_crosstalk_that_the_law_does_not_name_is_learnt_from_its_prior() -> None:
    known = {"c0": 0.08, "c1": 0.0, "c2": 0.1}
    law = {
        "object": known | {"c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.01}},
        "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.001}] * 2,
        "joint": {"unknowns": ["object.c2"], "modes": [{"mean": [0.0], "covariance": [[1.0]]}]},
    }
    readings = np.array([[0.0006, 0.0007], [0.0005, 0.0006]])
    empty = np.zeros(2, dtype=bool)
    columns = {"time_s": np.arange(2.0), "w1": readings[:, 0], "w2": readings[:, 1]}
    frames = frames_from_columns(SENSOR, columns | {"object_present": empty})
    found = track(SENSOR, parse_scene(law), frames)
    # a normal prior of sd 1e-3, two readings of sd 1e-4 each
    weights = 1e-3**-2, 2 * 1e-4**-2
    assert found.crosstalk is not None
    assert found.crosstalk_sd is not None
    assert np.allclose(found.crosstalk[-1], readings.mean(axis=0) * weights[1] / sum(weights))
    assert np.allclose(found.crosstalk_sd[-1], sum(weights) ** -0.5)


PRIORS = {
    "c2": {"c0": 0.08, "c1": 0.0, "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.3}},
    "gain": {"c0": 0.08, "c1": 0.0, "c2": 0.1},
    "all": {
        "c0": {"prior": "lognormal", "median": 0.08, "sigma": 0.2},
        "c1": {"prior": "normal", "mean": 0.0, "sd": 0.05},
        "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.2},
    },
}


@pytest.mark.parametrize("which", PRIORS)
@pytest.mark.parametrize("crosstalk", [None, [0.001, 0.002], STATED["crosstalk"]])
def test_priors_of_the_object_are_carried_as_a_law_of_them_is(
    which: str, crosstalk: object
) -> None:
    """A standard normal law in the coordinates of the priors says what they say: to the last bit.

    Such a scene, the strength of an object known to a factor, was refused.
    """
    told = {"object": PRIORS[which]} | ({} if crosstalk is None else {"crosstalk": crosstalk})
    sensor = SENSOR
    if which == "gain":
        gain = LogNormal(median=1.0, sigma=0.3)
        sensor = SENSOR.model_copy(update={"gain": gain})
    unknown = parameters_of(sensor, parse_scene(told)).names
    names = [name for name in unknown if not name.startswith("crosstalk.")]
    mode = {"mean": [0.0] * len(names), "covariance": np.eye(len(names)).tolist()}
    truth = {"object": {"c0": 0.08, "c1": 0.0, "c2": 0.12}, "crosstalk": [0.001, 0.002]}
    path = RadialTrajectory(from_m=0.5, to_m=1.2, frames=10, duration_s=1.0)
    frames = simulate(SENSOR, parse_scene(truth), path, 3).frames
    here = track(sensor, parse_scene(told), frames)
    joint = {"unknowns": names, "modes": [mode]}
    there = track(sensor, parse_scene(told | {"joint": joint}), frames)
    assert np.array_equal(here.range_m, there.range_m, equal_nan=True)
    assert np.array_equal(here.sd_m, there.sd_m, equal_nan=True)
    assert np.nanmax(here.sd_parts_m.scene) > 0.0


@pytest.mark.parametrize(
    ("changed", "factor"),
    [
        ({"c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.7}}, "2.01"),
        ({"c2": None}, "2.72"),
        ({"c0": {"prior": "lognormal", "median": 0.08, "sigma": 0.6}, "c2": None}, "3.21"),
        # near its pole little of c1 is much of the light
        ({"c1": {"prior": "normal", "mean": -0.53, "sd": 0.05}}, "2.29"),
    ],
)
def test_light_that_is_open_by_more_than_a_factor_of_two_is_refused(
    changed: dict[str, object], factor: str
) -> None:
    told = {"c0": 0.08, "c1": 0.0, "c2": 0.1} | changed
    scene = parse_scene({"object": {name: x for name, x in told.items() if x is not None}})
    with pytest.raises(RefusedError, match=f"by a factor of {factor} of the light.*narrower"):
        tracker(SENSOR, scene)


LAW = {"unknowns": ["crosstalk.w1"], "modes": [{"mean": [0.0], "covariance": [[1e-4]]}]}
FOR_OTHERS = {"crosstalk": [STATED["crosstalk"][0], 0.0], "joint": LAW}
WALL = {"background": {"strength": 0.01, "distance_m": 3.0}}
ONE = {"c0": 0.08, "c1": 0.0, "c2": 0.1}
DIFFERS = {"flux": 0.7, "range_m": 8e-4, "shadow": 0.2}


@pytest.mark.parametrize("wall", [{}, WALL])
def test_a_scene_for_other_objects_says_what_is_to_be_stated(wall: dict[str, object]) -> None:
    """It is calibrated: to calibrate it once more would lead nowhere. What is said leads on."""
    with pytest.raises(RefusedError) as told:
        tracker(SENSOR, parse_scene(FOR_OTHERS | wall))
    assert "hybridtof calibrate" not in str(told.value)
    assert "state the numbers of one object" in str(told.value)
    assert ("of its shadow" in str(told.value)) == bool(wall)
    assert "`discrepancy.flux`" in describe(told.value)["detail"]
    shadow = {"background": WALL["background"] | {"shadow": {"c0": 0.06, "c1": 0.0}}}
    stated = FOR_OTHERS | (shadow if wall else {}) | {"object": ONE, "discrepancy": DIFFERS}
    tracker(SENSOR, parse_scene(stated))


@pytest.mark.parametrize("scene", [{}, {"object": {"c0": 0.1}}, FOR_OTHERS, FOR_OTHERS | WALL])
@pytest.mark.parametrize("gain", [1.0, LogNormal(prior="lognormal", median=1.0, sigma=50.0)])
def test_the_whole_remedy_is_said_over_http(scene: dict[str, object], gain: object) -> None:
    sensor = SENSOR.model_copy(update={"gain": gain})
    with pytest.raises(RefusedError) as told:
        tracker(sensor, parse_scene(scene))
    assert describe(told.value)["detail"] == str(told.value)
