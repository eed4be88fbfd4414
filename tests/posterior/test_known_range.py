"""Posteriors of frames of which some ranges are known."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import identifiability
from inference.posterior import fold
from inference.posterior.calibrated import calibrated_scene
from inference.posterior.infer import infer
from inference.posterior.job import Job, prepare
from inference.posterior.sampling.start import climb
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.parameters import OFFSET, parameters_of, with_offset
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-5]}})
RANGES = np.geomspace(0.3, 1.2, 16)
TRUTH = {"c0": 0.08, "c1": -0.12, "c2": 0.1}
SCENE: dict[str, Any] = {
    "object": {"c0": 0.08, "c1": -0.12},
    "crosstalk": [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 2.0}],
    "discrepancy": 0,
}
SETTINGS = SamplerSettings(seed=1, target_ess=60, max_seconds=60)


def frames(known: dict[int, float], sd: float = 3e-4) -> Frames:
    scene = parse_scene({"object": TRUTH, "crosstalk": [0.004, 0.02], "discrepancy": 0})
    seen = simulate(SENSOR, scene, SampledTrajectory(range_m=RANGES.tolist()), 3).frames
    told = np.full(RANGES.size, np.nan)
    told[list(known)] = list(known.values())
    return dataclasses.replace(seen, known_range_m=told, known_range_sd_m=np.full(told.size, sd))


def test_known_ranges_do_not_leave_out_the_shadows_error() -> None:
    """A scene calibrated with them keeps it for trackers and single frames before the wall."""
    wall = {"strength": 0.002, "distance_m": 2.5}
    scene = parse_scene({"crosstalk": SCENE["crosstalk"], "background": wall})
    ran = prepare(SENSOR, scene, frames({0: 0.3, 8: 0.6}), SETTINGS).scene.model_error
    assert ran == dataclasses.replace(scene.model_error, integrated=True)
    assert ran.shadow > 0


def foreseen(**known: Any) -> np.ndarray:
    at = {"object.c2": 0.1, "crosstalk.w1": 0.004, "crosstalk.w2": 0.02}
    scene = parse_scene(SCENE)
    found = identifiability(SENSOR, scene, RANGES.tolist(), at=at, **known)
    return found.posterior.range_sd


@pytest.mark.slow
def test_known_ranges_tell_the_others() -> None:
    """Ranges spread as foreseen with what is known, which is less than without.

    A true model: each of 16 lies within 4 of its standard deviations (false alarms: 1e-3).
    """
    known = {2: RANGES[2], 13: RANGES[13]}
    answer = infer(SENSOR, parse_scene(SCENE), frames(known), SETTINGS)
    assert answer.verdict.converged
    assert not answer.fit.misfit
    assert (np.abs(answer.range_m.mean - RANGES) < 4.0 * answer.range_m.sd).all()
    wanted = foreseen(known_range_sd_m=[3e-4 if j in known else None for j in range(RANGES.size)])
    np.testing.assert_allclose(answer.range_m.sd / RANGES, wanted, rtol=0.4)
    assert np.median(wanted / foreseen()) < 0.8


def test_a_known_range_that_contradicts_is_a_misfit_that_names_its_frame() -> None:
    known = {2: RANGES[2], 8: 1.05 * RANGES[8], 13: RANGES[13]}
    answer = infer(SENSOR, parse_scene(SCENE), frames(known), SETTINGS)
    assert answer.fit.misfit
    assert 8 in answer.fit.outliers
    assert any("frames 8" in reason or "8," in reason for reason in answer.fit.reasons)


@pytest.mark.thorough
def test_odometry_tells_the_others() -> None:
    """Displacements of every other frame, an encoder's zero 5 m behind: as foreseen, and no row
    is without a status."""
    sd = [3e-4 if j % 2 else None for j in range(RANGES.size)]
    noise = 3e-4 * np.random.default_rng(5).standard_normal(RANGES.size)
    moved = np.where([each is None for each in sd], np.nan, RANGES + 5.0 + noise)
    given = dataclasses.replace(
        frames({}), displacement_m=moved, displacement_sd_m=np.full(RANGES.size, 3e-4)
    )
    answer = infer(SENSOR, parse_scene(SCENE), given, SETTINGS)
    assert answer.verdict.converged
    assert not answer.fit.misfit
    assert (np.abs(answer.range_m.mean - RANGES) < 4.0 * answer.range_m.sd).all()
    offset = answer.parameters[OFFSET]
    assert abs(offset.mean + 5.0) < 4.0 * offset.sd
    assert {row.parameter: row.status for row in answer.identifiability}[OFFSET] == "identified"
    known = calibrated_scene(SENSOR, parse_scene(SCENE), given, answer)
    assert known.joint is not None
    assert OFFSET not in known.joint.unknowns
    wanted = foreseen(displacement_sd_m=sd)
    np.testing.assert_allclose(answer.range_m.sd / RANGES, wanted, rtol=0.4)
    assert np.median(wanted / foreseen()) < 0.8


def test_what_is_known_is_stored_with_the_job() -> None:
    job = fold.prepare(SENSOR, parse_scene(SCENE), frames({3: 0.4}), SETTINGS)
    again = Job.from_bytes(job.to_bytes())
    np.testing.assert_array_equal(again.frames.known_range_m, job.frames.known_range_m)
    z = np.zeros((1, 3))
    assert again.density()(z) == job.density()(z)


def test_a_model_that_is_not_exact_does_not_overrule_what_is_known() -> None:
    """Its flux 3 % off along the stroke: an exact model moves ranges by far more than that.

    The error is integrated out, and the best ranges are within 0.2 % of the truth (1.1 % without).
    """
    known = frames({0: RANGES[0], 15: RANGES[15]})
    bent = 1.0 + 0.03 * np.sin(3.0 * np.log(RANGES))
    light = known.readings - [0.004, 0.02]
    given = dataclasses.replace(known, readings=known.readings + light * (bent[:, None] - 1.0))
    scene = parse_scene({name: part for name, part in SCENE.items() if name != "discrepancy"})
    job = fold.prepare(SENSOR, scene, given, SETTINGS)
    assert job.scene.model_error.integrated
    density = job.density()
    z = density.parameters.standard(np.array([[0.1, 0.004, 0.02]]))[0]
    best = np.exp(density.best_ranges(climb(density, z)[0][None])[0, :, 0])
    assert np.abs(best / RANGES - 1).max() < 0.002
    plain = dataclasses.replace(given, known_range_m=None, known_range_sd_m=None)
    assert not fold.prepare(SENSOR, scene, plain, SETTINGS).scene.model_error.integrated


@pytest.mark.parametrize("static", [False, True])
def test_bounds_of_ranges_that_are_known(static: bool) -> None:
    """A range known exactly is two readings of the rest: the bound is that without the unknown.

    Known next to nothing it changes no bound, and of an object at rest it counts once.
    """
    scene = parse_scene(SCENE | ({"motion": "static"} if static else {}))
    ranges = [0.5, 0.5, 0.5] if static else [0.3, 0.6, 1.2]
    plain = identifiability(SENSOR, scene, ranges, [True, True, False])
    vague = identifiability(SENSOR, scene, ranges, [True, True, False], known_range_sd_m=[1e6] * 3)
    np.testing.assert_allclose(vague.information.sd, plain.information.sd, rtol=1e-6)
    np.testing.assert_allclose(vague.posterior.sd, plain.posterior.sd, rtol=1e-6)
    exact = identifiability(SENSOR, scene, ranges, [True, True, False], known_range_sd_m=[1e-9] * 3)
    jacobian, _, _ = exact.experiment.whitened()
    rows = jacobian.reshape(-1, jacobian.shape[2])
    wanted = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    np.testing.assert_allclose(exact.information.sd, wanted, rtol=1e-5)
    np.testing.assert_allclose(
        exact.information.range_sd[:2] * ranges[:2], 1e-9 / (2**0.5 if static else 1), rtol=1e-3
    )


def test_bounds_of_displacements() -> None:
    """Against the information matrix of everything: unknowns, offset, and all ranges."""
    ranges, sd = np.array([0.3, 0.5, 0.8, 1.2]), np.array([1e-3, 2e-3, np.inf, 1e-4])
    sds = [each if np.isfinite(each) else None for each in sd]
    found = identifiability(
        SENSOR,
        parse_scene(SCENE),
        ranges.tolist(),
        displacement_sd_m=sds,
        known_range_sd_m=[None, 5e-4, None, None],
    )
    assert found.experiment.names[-1] == OFFSET
    jacobian, along, _ = found.experiment.whitened()
    d, n = jacobian.shape[2], ranges.size
    rows = np.zeros((n, 4, d + n))
    rows[:, :2, :d] = jacobian
    for j in range(n):
        rows[j, :2, d + j] = along[j]
        rows[j, 2, d + j], rows[j, 2, d - 1] = ranges[j] / sd[j], -1.0 / sd[j]
    rows[1, 3, d + 1] = ranges[1] / 5e-4
    whole = rows.reshape(-1, d + n)
    variance = np.diag(np.linalg.inv(whole.T @ whole))
    np.testing.assert_allclose(found.sd[OFFSET], np.sqrt(variance[d - 1]), rtol=1e-6)
    np.testing.assert_allclose(found.information.sd[:-1], np.sqrt(variance[: d - 1]), rtol=1e-6)
    np.testing.assert_allclose(found.information.range_sd, np.sqrt(variance[d:]), rtol=1e-6)


def test_an_offset_beside_a_joint_law() -> None:
    """The offset is independent of what a calibration knows, whose law stays as it is."""
    law = {
        "unknowns": ["object.c2", "crosstalk.w1"],
        "modes": [
            {"weight": 0.4, "mean": [0.1, 0.2], "covariance": [[0.5, 0.2], [0.2, 0.3]]},
            {"weight": 0.6, "mean": [0.4, -0.2], "covariance": [[0.4, -0.1], [-0.1, 0.2]]},
        ],
    }
    plain = parameters_of(SENSOR, parse_scene(SCENE | {"joint": law}))
    more = with_offset(plain, np.array([0.0, 1.0]))
    z = np.random.default_rng(1).standard_normal((5, len(plain)))
    beside = np.column_stack([z, np.linspace(-1.0, 1.0, 5)])
    np.testing.assert_allclose(more.natural(beside)[:, :-1], plain.natural(z))
    np.testing.assert_allclose(more.standard(more.natural(beside)), beside, atol=1e-9)
    off = more.log_prior(beside) + 0.5 * beside[:, -1] ** 2 - plain.log_prior(z)
    np.testing.assert_allclose(off, off[0], atol=1e-12)
    assert more.sample(np.random.default_rng(1), 7).shape == (7, len(plain) + 1)
