"""Readings that refute the model and ask for larger errors of the flux get room for them."""

import dataclasses

import numpy as np
import pytest

from benchmarks.coverage.paths import PathSet, draw_path
from benchmarks.larger_errors import TOLD, answers, sampled, understated
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum
from inference.posterior import fold
from inference.posterior.answer.error_budget import error_budget
from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.answer.posterior import Posterior
from inference.posterior.answer.where_misfit import where_integrated, where_misfit
from inference.posterior.answer.widened import widened
from inference.posterior.criticism.discrepancy_check import MISFIT, LargerDiscrepancy
from inference.posterior.criticism.model_check import (
    LARGEST,
    asked_for,
    flux_error_asked_for,
    noise_asked_for,
)
from inference.posterior.criticism.predictive_check import FLUX_ERROR, MISFIT_P, TOTAL
from inference.posterior.job import Job
from inference.posterior.sample import sample_of
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.stage import Selecting, Starting
from inference.posterior.stages.standing import standing
from simulator.discrepancy import DISCREPANCY_SD
from simulator.scene import parse_scene

SNR = 3e4
SET = draw_path("independent", "crosstalk", TOLD, 5, SNR)
ROUNDING = 1e-9


FLUX, NOISE = "has room for errors of the object's flux", "is as wide as noise"


def job_of(data: PathSet) -> Job:
    settings = SamplerSettings(method="auto", seed=4, max_seconds=30.0)
    return fold.prepare(data.sensor, parse_scene(data.scene), data.frames, settings)


def fit_of(p_value: float, *checks: FitCheck) -> Fit:
    return Fit(p_value, p_value < MISFIT_P, (), 50.0, 15.0, checks, ())


@pytest.fixture(scope="module")
def refuted() -> tuple[Job, Checkpoint]:
    return sampled(SET, 5, 30.0)


def has_room(
    data: PathSet, found: Posterior, without: Posterior, of: str, most: float = 0.2
) -> None:
    assert found.fit.misfit
    assert any(of in why for why in found.fit.reasons)
    assert not any(of in why for why in without.fit.reasons)
    held, before = (
        np.mean((of.range_m.q05 <= data.range_m) & (data.range_m <= of.range_m.q95))
        for of in (found, without)
    )
    assert held == 1.0
    assert before < most
    assert np.array_equal(found.draws.log_density, without.draws.log_density)


def test_readings_that_refute_the_model_have_room_for_larger_errors(
    refuted: tuple[Job, Checkpoint],
) -> None:
    """Errors are five times what stands; draws are the same, and without room next to none held."""
    found, without = answers(*refuted)
    has_room(SET, found, without, FLUX)
    part, draws = fold.draw(*refuted)
    assert part.flux_times > 1
    assert np.array_equal(draws.range_m, found.draws.range_m)


@pytest.mark.thorough
def test_readings_of_another_sensor_have_room_too() -> None:
    """All that such a scale owes is one error: room for it holds all within three of its sizes."""
    data = draw_path("constant speed", "crosstalk", TOLD, 4, SNR)
    found, without = answers(*sampled(data, 4, 30.0))
    assert found.fit.misfit
    assert any(FLUX in why for why in found.fit.reasons)
    off, before = (
        np.abs(of.range_m.mean - data.range_m) / of.range_m.sd for of in (found, without)
    )
    assert off.max() < 3.0
    assert before.max() > 10.0
    assert np.all(found.range_m.sd > without.range_m.sd)


def test_noise_that_is_stated_too_small_widens_its_part_of_every_interval() -> None:
    """By a quarter of what it is; an object that errs as stands by default."""
    data = understated(draw_path("constant speed", "crosstalk", "nothing", 3), 4.0)
    found, without = answers(*sampled(data, 3, 30.0))
    # of twenty intervals of 90 % half or fewer hold the truth once in a hundred thousand
    has_room(data, found, without, NOISE, 0.5)
    said = next(why for why in found.fit.reasons if NOISE in why)
    assert 2.0 < float(said.split(NOISE)[1].split()[0]) < 6.0
    parts, before = found.range_m.sd_parts, without.range_m.sd_parts
    whole = np.sqrt(parts.noise**2 + parts.scene**2 + parts.model**2)
    assert np.allclose(whole, found.range_m.sd, rtol=ROUNDING)
    # the model's part is the same, what noise leaves is not
    assert np.all(parts.scene > 2.0 * before.scene)
    assert np.allclose(parts.model, before.model, rtol=0.3)


def test_noise_is_asked_for_where_no_error_of_the_flux_is() -> None:
    job = job_of(SET)
    density = job.density()
    total, flux = FitCheck(TOTAL, 90.0, 10.0, 1e-5), FitCheck(FLUX_ERROR, 2.0, 1.0, 0.3)
    assert noise_asked_for(fit_of(1e-4, total)) == pytest.approx(9.0)
    assert noise_asked_for(fit_of(2e-3, total)) == 1.0
    assert noise_asked_for(fit_of(1e-4, dataclasses.replace(total, p_value=0.1))) == 1.0
    assert asked_for(job, density, fit_of(1e-4, total, flux), None) == pytest.approx((1.0, 9.0))
    both = fit_of(1e-4, total, dataclasses.replace(flux, statistic=4.0, p_value=1e-3))
    assert asked_for(job, density, both, None) == pytest.approx((2.0, 1.0))


def test_a_larger_error_is_asked_for_only_where_the_model_is_refuted_by_it() -> None:
    job = job_of(SET)
    asked = FitCheck(FLUX_ERROR, 9.0, 1.0, 1e-4)
    assert flux_error_asked_for(job, fit_of(1e-4, asked)) == pytest.approx(3.0)
    by_noise = dataclasses.replace(asked, p_value=0.06)
    assert flux_error_asked_for(job, fit_of(1e-4, by_noise)) == 1.0
    assert flux_error_asked_for(job, fit_of(2e-3, asked)) == 1.0
    beyond = dataclasses.replace(asked, statistic=1e9)
    most = flux_error_asked_for(job, fit_of(1e-4, beyond))
    assert most * DISCREPANCY_SD == pytest.approx(LARGEST)
    assert flux_error_asked_for(job.with_error_integrated(), fit_of(0.0, asked)) == 1.0
    exact = dataclasses.replace(job, scene=job.scene.model_copy(update={"discrepancy": 0.0}))
    assert flux_error_asked_for(exact, fit_of(0.0, asked)) == 1.0


def test_a_range_that_is_known_has_its_own_room() -> None:
    known = np.full(len(SET.frames), np.nan)
    known[0] = SET.range_m[0]
    sd = np.full(len(SET.frames), 1e-3)
    frames = dataclasses.replace(SET.frames, known_range_m=known, known_range_sd_m=sd)
    job = job_of(dataclasses.replace(SET, frames=frames))
    asked = FitCheck(FLUX_ERROR, 9.0, 1.0, 1e-4)
    assert flux_error_asked_for(job, fit_of(1e-4, asked)) == 1.0
    total = FitCheck(TOTAL, 90.0, 10.0, 1e-5)
    fit, none = fit_of(1e-4, asked, total), np.zeros(1)
    demands = LargerDiscrepancy(2.0 * MISFIT, none, none)
    assert asked_for(job, job.density(), fit, demands) == (1.0, 1.0)
    little = LargerDiscrepancy(1.0, none, none)
    assert asked_for(job, job.density(), fit, little) == pytest.approx((1.0, 9.0))


def test_draws_are_widened_by_a_factor_of_their_variance() -> None:
    rng = np.random.default_rng(1)
    z = rng.standard_normal((50, 3)) @ rng.standard_normal((3, 3))
    log_r = np.concatenate([z @ rng.standard_normal((3, 4)), np.full((50, 1), np.nan)], axis=1)
    of_z, of_log_r = widened(z, log_r, 5.0)
    assert np.allclose(of_z @ of_z.T, 4.0 * np.cov(z.T, bias=True), rtol=ROUNDING)
    expected = 4.0 * np.cov(log_r[:, :4].T, bias=True)
    assert np.allclose(of_log_r[:4] @ of_log_r[:4].T, expected, rtol=ROUNDING)
    assert np.allclose(of_log_r[4], 0.0, atol=ROUNDING)


def test_all_draws_move_to_the_best_point_and_are_as_uncertain_as_the_way_is_long(
    refuted: tuple[Job, Checkpoint],
) -> None:
    given, checkpoint = refuted
    stage = checkpoint.answering.stage
    assert not isinstance(stage, Selecting | Starting)
    z = sample_of(given.density(), standing(stage), np.random.default_rng(2)).flat[:3]
    job = given.with_error_integrated()
    density = job.density()
    assert isinstance(density, DiscrepantDensity)
    log_r = density.best_ranges(z)[:, :, 0]
    draws = zip(z, log_r, strict=True)
    at = [Experiment(density.sensor, density.parameters, *draw) for draw in draws]
    readings = density.frames[:, :2]
    of_z, of_log_r = where_integrated(density, at, readings, (z, log_r), 4.0)
    larger = [dataclasses.replace(each, discrepancy=4.0 * density.discrepancy) for each in at]
    ways = where_misfit(larger, readings, z, log_r)
    for found, way, drawn in ((of_z, ways[0], z), (of_log_r, ways[1], log_r)):
        assert np.array_equal(found[:, 0], found[:, 1])
        assert np.array_equal(way[:, 0], way[:, 1])
        more = found[:, 2:] @ found[:, 2:].T
        assert np.allclose(more, 15.0 * np.cov(drawn.T, bias=True), rtol=1e-6, atol=ROUNDING)
    # nearer to the truth than draws of a model that the readings refute
    off = np.median(log_r, axis=0) - np.log(SET.range_m)
    assert np.abs(off + of_log_r[:, 0]).mean() < 0.95 * np.abs(off).mean()


def test_where_frames_are_dealt_out_no_part_climbs(
    refuted: tuple[Job, Checkpoint], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each would take seconds, and there may be fifty; errors are larger there, too."""
    job, climbs = dataclasses.replace(refuted[0], flux_times=3.0), []
    density = job.density()
    z = np.zeros((3, len(density.parameters)))
    log_r = density.best_ranges(z)[:, :, 0]

    def climbed(*_: object) -> tuple[np.ndarray, np.ndarray]:
        climbs.append(1)
        return np.zeros((z.shape[1], 2)), np.zeros((log_r.shape[1], 2))

    monkeypatch.setattr("inference.posterior.answer.error_budget.where_misfit", climbed)
    for each, expected in ((job.part(np.arange(len(SET.frames))), 0), (job, 1)):
        rng = np.random.default_rng(1)
        budget = error_budget(each, density, z, log_r, None, None, None, rng)
        assert len(climbs) == expected
        assert np.isfinite(budget.by_z).all()


def test_a_climb_whose_steps_lead_out_of_all_numbers_stays_in_them() -> None:
    """From the middle of the priors one step leads to a c0 of zero."""
    density = job_of(SET).with_error_integrated().density()
    z = 0.1 * np.random.default_rng(2).standard_normal((8, len(density.parameters)))[2]
    log_r = density.best_ranges(z[None])[0, :, 0]
    larger = 4.0 * DISCREPANCY_SD
    at = Experiment(density.sensor, density.parameters, z, log_r, discrepancy=larger)
    end, deviance = joint_optimum(at, density.frames[:, :2])
    assert np.isfinite(deviance)
    assert end.finite
