"""A posterior as a scene: the law of its draws, and what is said of them."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.calibrated import scene_of_draws
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service import drawn

FINDINGS = {"converged": True, "misfit": False, "seed": 3, "date": None}


def of_coordinates(z: NDArray[np.float64], mode: NDArray[np.intp]) -> dict[str, Any]:
    """Members of the law of draws that are given in the priors' coordinates."""
    job = drawn.job()
    parameters = parameters_of(job.sensor, job.scene)
    draws = dataclasses.replace(
        drawn.draws(),
        parameters=parameters.natural(z).reshape(1, 1, len(z), 2),
        mode=mode.reshape(1, 1, len(z)),
    )
    scene = scene_of_draws(job.sensor, job.scene, job.frames, draws, FINDINGS)
    assert scene.joint is not None
    assert scene.calibration is not None
    assert scene.calibration.frames.count == len(job.frames)
    assert [row.unknown for row in scene.calibration.unknowns] == ["object.c0", "object.c2"]
    assert all(row.prior is not None for row in scene.calibration.unknowns)
    return scene.joint.model_dump() | {"distance": scene.calibration.distance}


def test_the_law_has_mean_and_covariance_of_the_draws() -> None:
    """Of 4000 normal draws the greatest distance is above 2.2 / sqrt(n) once in 8,000 times."""
    rng = np.random.default_rng(1)
    z = rng.standard_normal((4000, 2)) @ np.array([[0.1, 0.05], [0.0, 0.01]]) + [0.4, -1.0]
    law = of_coordinates(z, np.zeros(len(z), dtype=np.intp))
    (mode,) = law["modes"]
    assert np.allclose(mode["mean"], z.mean(axis=0), atol=1e-9)
    assert np.allclose(mode["covariance"], np.cov(z.T, bias=True), rtol=1e-6)
    assert 0.0 < law["distance"] < 2.2 / np.sqrt(len(z))


def test_separate_modes_are_a_mixture_and_strays_are_none() -> None:
    rng = np.random.default_rng(2)
    z = 0.01 * rng.standard_normal((2000, 2))
    mode = np.repeat([0, 1, 2], [1496, 500, 4])
    z[mode == 1] += [3.0, 0.0]
    law = of_coordinates(z, mode)
    first, second = law["modes"]
    assert np.isclose(first["weight"], 1496 / 1996)
    assert np.isclose(first["weight"] + second["weight"], 1.0)
    assert np.allclose(second["mean"], z[mode == 1].mean(axis=0), atol=1e-9)


def test_draws_at_the_end_of_a_support_are_a_law() -> None:
    """A parameter so near the end that it has no coordinate any more, and one that never moves."""
    z = np.column_stack([np.full(500, 40.0), np.zeros(500)])
    law = of_coordinates(z, np.zeros(500, dtype=np.intp))
    assert np.isfinite(law["modes"][0]["covariance"]).all()


SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [1e-4, 1e-4]}})
CROSSTALK = [{"prior": "halfnormal", "sd": 0.01}, {"prior": "halfnormal", "sd": 0.08}]
SIZES = {"c0": 0.08, "c1": 0.05, "c2": 0.1}
WALL = {"strength": {"prior": "lognormal", "median": 0.01, "sigma": 1.0}, "distance_m": 3.0}


def learnt_of(stated: dict[str, Any], other_objects: bool) -> Any:
    """Return a scene of 2000 draws, of which all unknowns are correlated."""
    scene = parse_scene(stated)
    parameters, rng = parameters_of(SENSOR, scene), np.random.default_rng(4)
    d = len(parameters.names)
    z = 0.1 * rng.standard_normal((2000, d)) @ rng.standard_normal((d, d)) + 0.3
    draws = dataclasses.replace(
        drawn.draws(),
        names=parameters.names,
        parameters=parameters.natural(z).reshape(1, 1, len(z), d),
        mode=np.zeros((1, 1, len(z)), dtype=np.intp),
    )
    frames = Frames(np.full((9, 2), 0.1), np.arange(9.0))
    return scene_of_draws(SENSOR, scene, frames, draws, FINDINGS, other_objects)


@pytest.mark.parametrize("stated", [{"crosstalk": CROSSTALK}, {"background": WALL}])
def test_for_other_objects_nothing_is_kept_of_the_one_that_was_there(stated: Any) -> None:
    """What stays has the law that it has beside all else: of a normal law rows and columns."""
    whole, rest = (learnt_of(stated, other).model_dump()["joint"] for other in (False, True))
    gone = [n for n in whole["unknowns"] if n.startswith(("object.", "background.shadow."))]
    stay = [j for j, name in enumerate(whole["unknowns"]) if name not in gone]
    assert {"object.c0", "object.c1", "object.c2"} <= set(gone)
    assert list(rest["unknowns"]) == [whole["unknowns"][j] for j in stay]
    (before,), (after,) = whole["modes"], rest["modes"]
    assert np.array_equal(after["mean"], np.array(before["mean"])[stay])
    assert np.array_equal(after["covariance"], np.array(before["covariance"])[np.ix_(stay, stay)])
    said = learnt_of(stated, True).calibration
    assert [row.unknown for row in said.unknowns] == list(rest["unknowns"])


def test_an_object_that_is_stated_in_numbers_is_no_other() -> None:
    stated = {"object": SIZES, "crosstalk": CROSSTALK}
    assert learnt_of(stated, False).joint is not None
    with pytest.raises(RefusedError, match="of a known plate narrow ones") as told:
        learnt_of(stated, True)
    assert [problem.pointer for problem in told.value.problems] == ["/scene/object"]


def test_after_a_known_plate_other_objects_are_stated_in_its_place() -> None:
    """The priors of the plate are the scene's still; the law stays, whatever takes their place."""
    plate = {n: {"prior": "lognormal", "median": m, "sigma": 1e-3} for n, m in SIZES.items()}
    document = learnt_of({"object": plate, "crosstalk": CROSSTALK}, True).model_dump(
        mode="json", exclude_none=True
    )
    assert document.pop("object")["c0"]["sigma"] == 1e-3
    for other in ({}, {"object": {"c0": 0.02, "c1": 0.01, "c2": 0.04}}):
        scene = parse_scene(document | other)
        assert scene.joint is not None
        assert list(scene.joint.unknowns) == ["crosstalk.w1", "crosstalk.w2"]


def test_where_the_object_alone_was_unknown_the_priors_are_left() -> None:
    scene = learnt_of({}, True)
    assert scene.joint is None
    assert scene.calibration is not None
    assert scene.calibration.unknowns == ()
