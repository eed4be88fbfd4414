"""What stands by default in posteriors stands in what is foreseen of them."""

from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.clock import as_ruled, with_clock
from inference.identifiability.shared_errors import fewer
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.discrepancy import DISCREPANCY_SD
from simulator.errors import RefusedError
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.scene import parse_scene
from simulator.shadow_error import SHADOW_SD
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, sensor_of

STROKE = np.geomspace(0.16, 1.3, 20).tolist()
WALL = {"strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0}, "distance_m": 2.0}
SCENES: dict[str, dict[str, Any]] = {
    "object": {},
    "crosstalk": {"crosstalk": UNKNOWN_CROSSTALK},
    "background": {"background": WALL},
    "known object": {"object": OBJECT, "crosstalk": UNKNOWN_CROSSTALK},
}


def foresee(scene: dict[str, Any], kind: str = "pulsed", **more: Any) -> Foresight:
    return identifiability(sensor_of(kind, 1000.0), parse_scene(scene), STROKE, **more)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("name", list(SCENES))
def test_left_out_means_the_default(name: str, kind: str) -> None:
    """And that the measured sizes, of a known object what its fit leaves of the flux's."""
    share = FITTED_SHARE if name == "known object" else 1.0
    sizes = {"flux": share * DISCREPANCY_SD, "range_m": RANGE_ERROR_SD, "shadow": SHADOW_SD}
    left_out, default, stated, exact = (
        foresee(SCENES[name] | of, kind)
        for of in ({}, {"discrepancy": "default"}, {"discrepancy": sizes}, {"discrepancy": 0})
    )
    for other in (default, stated):
        assert other.identifiability == left_out.identifiability
        assert other.remedies == left_out.remedies
        assert other.posterior_sd == left_out.posterior_sd
        assert np.array_equal(other.posterior.range_sd, left_out.posterior.range_sd)
    for parameter, sd in exact.posterior_sd.items():
        assert sd <= left_out.posterior_sd[parameter] * (1 + 1e-9)
    assert (exact.posterior.range_sd < left_out.posterior.range_sd).all()
    assert exact.information.rank == left_out.information.rank


def test_ranges_follow_an_error_of_the_effective_distance_and_unknowns_do_not() -> None:
    """Its variance is added to that of every range, a stationary process to 1e-4 of itself."""
    exact, late = foresee({"discrepancy": 0}), foresee({"discrepancy": {"range_m": 2e-3}})
    assert late.posterior_sd == exact.posterior_sd
    assert late.sd == exact.sd
    for of, without in (
        (late.range_sd, exact.range_sd),
        (late.posterior.range_sd * STROKE, exact.posterior.range_sd * STROKE),
    ):
        assert of**2 - without**2 == pytest.approx(np.full(20, 4e-6), rel=1e-3)
    # the mean of log r moves by the mean of a smooth error: by no more than one of its size
    for told, without in (
        (late.posterior.scale_sd, exact.posterior.scale_sd),
        (late.information.scale_sd, exact.information.scale_sd),
    ):
        moved = np.sqrt(told**2 - without**2)
        assert 0.5 < moved / (2e-3 * np.mean(1.0 / np.array(STROKE))) < 1.0


def test_a_shadow_that_errs_leaves_a_wall_more_open() -> None:
    """Its size alone: neither flux nor clock errs beside it."""
    scene = {"object": OBJECT, "background": WALL | {"shadow": "object"}}
    exact, erring = (foresee(scene | {"discrepancy": of}) for of in (0, {"shadow": SHADOW_SD}))
    name = "background.strength"
    assert erring.posterior_sd[name] > 2.0 * exact.posterior_sd[name]
    # without a wall there is no shadow
    bare, none = (foresee({"discrepancy": of}) for of in ({"shadow": SHADOW_SD}, 0))
    assert bare.posterior_sd == none.posterior_sd


def test_a_ruler_tells_the_effective_distance_to_no_better_than_the_clock() -> None:
    """Against 4e5 draws: shares to four standard errors, one false alarm in 1e4."""
    ruler, size, r = 1e-3, RANGE_ERROR_SD, 0.5
    rates = with_clock(np.array([[1.0 / ruler, 0.0], [0.0, 0.0]]), size)
    assert 1.0 / rates[0, 0] == pytest.approx(np.hypot(ruler, size))
    share, own = as_ruled(rates, np.log([r, r]), size)
    assert (share[1], own[1]) == (1.0, 0.0)
    rng = np.random.default_rng(20)
    off = ruler * rng.standard_normal(400_000)
    effective = off + size * rng.standard_normal(off.size)
    slope = np.mean(off * effective) / np.mean(effective**2)
    left = np.mean((off - slope * effective) ** 2)
    assert share[0] == pytest.approx(slope, abs=4 * np.sqrt(left / 4e5) / effective.std())
    # of what is left a smooth error has share^2 already
    assert own[0] * r**2 + (share[0] * size) ** 2 == pytest.approx(left, rel=4 * np.sqrt(2 / 4e5))


def test_a_range_that_a_ruler_tells_is_known_no_worse_than_by_it() -> None:
    """And what it tells of unknowns is no better than the clock's own error lets it be."""
    told = foresee({}, known_range_sd_m=[1e-4] * 20)
    assert (told.posterior.range_sd * STROKE < 1.0001e-4).all()
    exact = foresee({"discrepancy": 0}, known_range_sd_m=[1e-4] * 20)
    late = foresee({"discrepancy": {"range_m": 8e-4}}, known_range_sd_m=[1e-4] * 20)
    assert late.posterior_sd["object.c1"] > 1.5 * exact.posterior_sd["object.c1"]


def test_the_flux_of_an_object_at_rest_errs_as_its_reflectance_does() -> None:
    """By default as in posteriors; a stated size is refused as before, and 0 states none."""
    scene = {"object": {"c0": 0.08, "c1": 0.0}, "motion": "static"}

    def sd(**more: Any) -> float:
        found = identifiability(sensor_of("pulsed", 1000.0), parse_scene(scene | more), [0.7] * 4)
        return found.posterior_sd["object.c2"] / found.reference["object.c2"]

    assert np.sqrt(sd() ** 2 - sd(discrepancy=0) ** 2) == pytest.approx(DISCREPANCY_SD, rel=0.02)
    assert sd(discrepancy="default") == sd()
    with pytest.raises(RefusedError, match="at rest"):
        sd(discrepancy=0.05)


def test_fewer_errors_move_readings_as_all_do() -> None:
    rng = np.random.default_rng(4)
    smooth = np.exp(-0.5 * np.square(np.linspace(0, 1, 12)[:, None] - np.linspace(-9, 9, 40)))
    errors = 50.0 * smooth[:, None, :] * rng.standard_normal((12, 2, 1))
    found = fewer(errors)
    assert found.shape[2] < 10
    before, after = (e.reshape(24, -1) @ e.reshape(24, -1).T for e in (errors, found))
    assert np.abs(after - before).max() < 1e-5


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_a_posterior_is_as_wide_as_was_foreseen(kind: str) -> None:
    """Of a scene that says nothing of its errors; taken for exact it would be many times as wide.

    Of draws worth 400 a standard deviation errs by 3.5 %: by a fifth in less than one of 1e7. What
    is left of a third is for what the linear law leaves out.
    """
    sensor, ranges = sensor_of(kind, 300.0), np.geomspace(0.16, 1.3, 40).tolist()
    present = [True] * 40 + [False] * 5
    truth = {"object": OBJECT, "crosstalk": [0.002, 0.01], "discrepancy": 0}
    path = SampledTrajectory(range_m=[*ranges, *[1.0] * 5], object_present=present)
    frames = simulate(sensor, parse_scene(truth), path, 5).frames
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK})
    at = {f"object.{name}": value for name, value in OBJECT.items()}
    foreseen = identifiability(sensor, scene, [*ranges, *[1.0] * 5], present, at)
    settings = SamplerSettings(seed=1, target_ess=400, max_seconds=120)
    found = infer(sensor, scene, frames, settings)
    assert found.verdict.converged
    for name in at:
        ratio = found.parameters[name].sd / foreseen.posterior_sd[name]
        assert 0.7 < ratio < 1.4
    said, got = (
        {row.parameter: row.status for row in rows}
        for rows in (foreseen.identifiability, found.identifiability)
    )
    assert said == got
    assert said["object.c1"] == "weak"
    spread = np.median(found.range_m.sd[:40] / (foreseen.posterior.range_sd[:40] * ranges))
    assert 0.7 < spread < 1.4
