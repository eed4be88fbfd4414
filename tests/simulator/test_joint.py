"""Joint laws of unknowns: read and written, drawn from, inside what physics allows, refused."""

import json
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from simulator.errors import InvalidInputError, RefusedError
from simulator.joint_scene import around, centre
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene, parse_scene
from simulator.scene_checks import check_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}})
PRIOR: dict[str, Any] = {"crosstalk": [{"prior": "halfnormal", "sd": 0.02}, 0.1]}
MODES: list[dict[str, Any]] = [
    {"weight": 0.7, "mean": [1.0, 0.2, 0.0], "covariance": np.diag([0.04, 0.25, 0.5]).tolist()},
    {
        "weight": 0.3,
        "mean": [-1.0, -9.0, 1.0],
        "covariance": [[0.04, 0.0199, 0.0], [0.0199, 0.01, 0.0], [0.0, 0.0, 1e-6]],
    },
]
JOINT: dict[str, Any] = {"unknowns": ["object.c0", "object.c1", "crosstalk.w1"], "modes": MODES}
STATED: dict[str, Any] = {"unknown": "crosstalk.w1", "mean": 0.1, "sd": 0.1, "q05": 0.0, "q95": 0.2}
STATED["prior"] = PRIOR["crosstalk"][0]
CALIBRATION: dict[str, Any] = {
    "sensor": SENSOR.model_dump(mode="json"),
    "converged": True,
    "misfit": False,
    "frames": {"count": 3, "sha256": "0" * 64},
    "model_error": [0.072, 0.0008],
    "unknowns": [
        {"unknown": "object.c0", "mean": 0.1, "sd": 0.01, "q05": 0.09, "q95": 0.11},
        {
            "unknown": "object.c1",
            "prior": "default",
            "mean": 0.0,
            "sd": 0.1,
            "q05": -0.1,
            "q95": 0.1,
        },
        STATED,
    ],
}


def scene(**changes: Any) -> Scene:
    return parse_scene(PRIOR | {"joint": JOINT, "calibration": CALIBRATION} | changes)


def one_mode(k: int) -> dict[str, Any]:
    return JOINT | {"modes": [MODES[k] | {"weight": 1.0}]}


def both() -> tuple[Parameters, Parameters]:
    """With the law, and with independent priors."""
    return parameters_of(SENSOR, scene()), parameters_of(SENSOR, parse_scene(PRIOR))


def test_what_is_written_is_read() -> None:
    written = json.dumps(scene().model_dump(mode="json", exclude_none=True))
    assert parse_scene(json.loads(written)) == scene()


def test_draws_have_the_moments_of_the_law_in_the_coordinates_of_the_priors() -> None:
    """Means of 1e5 draws, within five standard errors: false alarms below 1e-5."""
    law, prior = both()
    n = 100_000
    z = law.sample(np.random.default_rng(1), n)
    t = prior.standard(law.natural(z))[:, [0, 1, 3]]
    weights = [0.7, 0.3]
    means = [np.array(mode["mean"]) for mode in MODES]
    mean = np.average(means, axis=0, weights=weights)
    second = [
        np.array(mode["covariance"]) + np.outer(m, m) for m, mode in zip(means, MODES, strict=True)
    ]
    whole = np.average(second, axis=0, weights=weights) - np.outer(mean, mean)
    sd = np.sqrt(np.diagonal(whole))
    assert np.all(np.abs(t.mean(axis=0) - mean) < 5 * sd / math.sqrt(n))
    # fourth moments of two modes are no larger than a normal law's times three
    assert np.all(np.abs(np.cov(t.T) - whole) < 5 * 3 * np.outer(sd, sd) / math.sqrt(n))
    assert np.allclose(law.standard(law.natural(z)), z, atol=1e-5)
    own = law.marginal(z)
    assert np.all(np.abs(own.std(axis=0) - 1) < 5 * 2 / math.sqrt(n))
    # c1 of the second mode lies nine standard deviations down: above -2 sqrt(c0) all the same
    natural = law.natural(z)
    assert np.all(natural[:, 0] > 0)
    assert np.all(natural[:, 1] > -2 * np.sqrt(natural[:, 0]))
    assert np.all(natural[:, 3] > 0)


def test_log_prior_is_that_of_the_law() -> None:
    law, prior = both()
    z = law.sample(np.random.default_rng(2), 50)
    t = prior.standard(law.natural(z))
    density = stats.norm.logpdf(t[:, 2])  # c2 is not named and keeps its prior
    density += np.log(
        sum(
            mode["weight"]
            * stats.multivariate_normal(np.array(mode["mean"]), np.array(mode["covariance"])).pdf(
                t[:, [0, 1, 3]]
            )
            for mode in MODES
        )
    )
    off = law.log_prior(z) - density
    assert np.allclose(off, off[0], atol=1e-5)


def test_one_mode_is_standard_normal_in_its_coordinates() -> None:
    parameters = parameters_of(SENSOR, scene(joint=one_mode(1)))
    z = np.random.default_rng(3).standard_normal((20, 4))
    assert np.allclose(parameters.log_prior(z), -0.5 * np.square(z).sum(axis=1), atol=1e-12)


def test_what_lies_beyond_a_prior_has_no_coordinates() -> None:
    """As without the law; what depends on no such unknown keeps its own."""
    parameters, plain = both()
    natural = parameters.natural(np.zeros((3, 4)))
    natural[:2, 3] = 0.0, -0.01  # of crosstalk.w1, half-normal
    with np.errstate(all="ignore"):
        z, alone = parameters.standard(natural), plain.standard(natural)
    assert np.array_equal(np.isfinite(z), np.isfinite(alone))
    assert np.array_equal(np.isfinite(z[:, 3]), [False, False, True])
    assert np.allclose(z[:, :3], 0.0, atol=1e-9)


def test_the_order_of_the_unknowns_plays_no_part() -> None:
    order = [2, 0, 1]
    turned = {
        "unknowns": [JOINT["unknowns"][j] for j in order],
        "modes": [
            mode
            | {
                "mean": [mode["mean"][j] for j in order],
                "covariance": np.array(mode["covariance"])[np.ix_(order, order)].tolist(),
            }
            for mode in MODES
        ],
    }
    z = np.random.default_rng(4).standard_normal((20, 4))
    here, there = both()[0], parameters_of(SENSOR, scene(joint=turned))
    assert np.allclose(here.natural(z), there.natural(z), rtol=1e-9)
    assert np.allclose(here.log_prior(z), there.log_prior(z))


def test_simulations_draw_from_it() -> None:
    narrow = {"mean": [0.5, 0.0], "covariance": [[1e-12, 0.0], [0.0, 1e-12]]}
    joint = {"unknowns": ["object.c0", "crosstalk.w1"], "modes": [narrow]}
    path = RadialTrajectory(from_m=0.2, to_m=1.0, frames=3)
    drawn = simulate(SENSOR, scene(joint=joint), path, 1).parameters
    prior = parameters_of(SENSOR, parse_scene(PRIOR))
    expected = prior.natural(np.array([[0.5, 0.0, 0.0, 0.0]]))[0]
    assert drawn["object.c0"] == pytest.approx(expected[0], rel=1e-4)
    assert drawn["crosstalk.w1"] == pytest.approx(expected[3], rel=1e-4)


def changed(mode: int, **members: Any) -> dict[str, Any]:
    modes: list[dict[str, Any]] = [dict(each) for each in MODES]
    modes[mode] |= members
    return JOINT | {"modes": modes}


@pytest.mark.parametrize(
    ("changes", "pointer", "words"),
    [
        ({"joint": changed(0, covariance=[[1.0]])}, "/joint/modes/0", "3 rows"),
        (
            {"joint": changed(1, covariance=[[1.0, 2.0, 0], [2.0, 1.0, 0], [0, 0, 1.0]])},
            "/joint/modes/1",
            "positive definite",
        ),
        (
            {"joint": changed(1, covariance=[[1.0, 0.5, 0], [0.0, 1.0, 0], [0, 0, 1.0]])},
            "/joint/modes/1",
            "symmetric",
        ),
        ({"joint": changed(0, weight=0.5)}, "/joint", "add up to 1"),
        ({"joint": changed(0, mean=[0.0, 101.0, 0.0])}, "/joint/modes/0", "wider"),
        ({"joint": JOINT | {"modes": []}}, "/joint/modes", "at least 1"),
        ({"joint": JOINT | {"unknowns": ["object.c0"] * 3}}, "/joint", "once"),
        (
            {"joint": JOINT | {"unknowns": ["object.c0", "object.c1", "crosstalk.w2"]}},
            "/joint/unknowns/2",
            "no unknown of this scene",
        ),
        (
            {"crosstalk": {"values": PRIOR["crosstalk"], "optional": True}},
            "/joint/unknowns/2",
            "optional",
        ),
        ({"calibration": CALIBRATION | {"converged": False}}, "/calibration/accept", "converged"),
        ({"calibration": CALIBRATION | {"misfit": True}}, "/calibration/accept", "not fit"),
        (
            {"calibration": CALIBRATION | {"sensor": CALIBRATION["sensor"] | {"gain": 2.0}}},
            "/calibration/sensor",
            "gain 2.0 instead of 1.0",
        ),
        (
            {
                "calibration": CALIBRATION
                | {
                    "sensor": {
                        "kind": "sine_wave",
                        "frequency_hz": 1e7,
                        "noise": CALIBRATION["sensor"]["noise"],
                    }
                }
            },
            "/calibration/sensor",
            "another sensor",
        ),
        ({"calibration": CALIBRATION | {"accept": ["all"]}}, "/calibration/accept/0", "misfit"),
        (
            {"crosstalk": [{"prior": "halfnormal", "sd": 0.03}, 0.1]},
            "/calibration/unknowns/2/prior",
            "put that back",
        ),
        (
            {"object": {"c1": {"prior": "normal", "mean": 0.0, "sd": 0.1}}},
            "/calibration/unknowns/1/prior",
            "the default",
        ),
        ({"joint": changed(1, weight=-1.0)}, "/joint/modes/1/weight", "greater than 0"),
        (
            {"joint": JOINT | {"modes": [{"mean": [], "covariance": []}]}},
            "/joint/modes/0/mean",
            "1",
        ),
        ({"joint": []}, "/joint", "JSON object"),
        ({"calibration": CALIBRATION | {"accept": "misfit"}}, "/calibration/accept", "valid list"),
    ],
)
def test_bad_documents(changes: dict[str, Any], pointer: str, words: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        check_scene(SENSOR, scene(**changes))
    assert [problem.pointer for problem in caught.value.problems] == [pointer]
    assert words in caught.value.problems[0].message


def test_a_word_takes_what_failed_and_noise_may_be_stated_anew() -> None:
    bad = CALIBRATION | {"converged": False, "misfit": True, "accept": ["misfit", "not_converged"]}
    noise = {"read": [2e-6, 1e-6]}
    other = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    check_scene(other, scene(calibration=bad))


def test_numbers_that_overflow_are_refused() -> None:
    """A law inside the bounds of its coordinates, of a prior that is wide enough for anything."""
    wide = {"c2": {"prior": "lognormal", "median": 1.0, "sigma": 100.0}}
    mode = {"mean": [0.0], "covariance": [[4.0]]}
    joint = {"unknowns": ["object.c2"], "modes": [mode]}
    stated = parse_scene({"object": wide, "joint": joint})
    assert centre(SENSOR, stated)[1].object.c2 == 1.0
    with pytest.raises(RefusedError, match=r"object\.c2 is beyond"):
        around(SENSOR, stated)
