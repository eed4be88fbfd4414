"""Readings that refute the model and ask for larger errors of the flux get room for them."""

import dataclasses

import numpy as np
import pytest

from benchmarks.coverage.paths import PathSet, draw_path
from benchmarks.larger_errors import TOLD, answers, sampled, understated
from inference.posterior import fold
from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.answer.posterior import Posterior
from inference.posterior.criticism.discrepancy_check import MISFIT, LargerDiscrepancy
from inference.posterior.criticism.model_check import (
    LARGEST,
    asked_for,
    flux_error_asked_for,
    noise_asked_for,
)
from inference.posterior.criticism.predictive_check import FLUX_ERROR, MISFIT_P, TOTAL
from inference.posterior.job import Job
from inference.posterior.settings import SamplerSettings
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


def has_room(data: PathSet, found: Posterior, without: Posterior, of: str) -> None:
    assert found.fit.misfit
    assert any(of in why for why in found.fit.reasons)
    assert not any(of in why for why in without.fit.reasons)
    ranges = found.range_m
    assert np.all((ranges.q05 <= data.range_m) & (data.range_m <= ranges.q95))
    assert np.array_equal(found.draws.log_density, without.draws.log_density)


@pytest.mark.thorough
def test_readings_that_refute_the_model_have_room_for_larger_errors() -> None:
    """Errors are five times what stands; draws are the same, and without room next to none held."""
    job, checkpoint = sampled(SET, 5, 30.0)
    found, without = answers(job, checkpoint)
    has_room(SET, found, without, FLUX)
    off = np.abs(without.range_m.mean - SET.range_m) / without.range_m.sd
    assert np.mean(off > 1.645) > 0.8
    part, draws = fold.draw(job, checkpoint)
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
    job, checkpoint = sampled(data, 3, 30.0)
    found, without = answers(job, checkpoint)
    has_room(data, found, without, NOISE)
    part, draws = fold.draw(job, checkpoint)
    assert part.flux_times == 1.0
    assert np.array_equal(draws.range_m, found.draws.range_m)
    # what ranges, unknowns and the flux's error leave is a chi-square of a dozen numbers
    times = np.sqrt(part.noise_times)
    assert 2.0 < times < 6.0
    assert any(f"{NOISE} {times:.2g} times" in why for why in found.fit.reasons)
    parts, before = found.range_m.sd_parts, without.range_m.sd_parts
    whole = np.sqrt(parts.noise**2 + parts.scene**2 + parts.model**2)
    assert np.allclose(whole, found.range_m.sd, rtol=ROUNDING)
    # what noise leaves grows by as much, the model's part is the same; all are parts of the spread
    # of some thousand draws, few of which decide far out
    assert np.allclose(parts.noise, times * before.noise, rtol=0.15)
    assert np.allclose(parts.scene, times * before.scene, rtol=0.15)
    assert np.allclose(parts.model, before.model, rtol=0.15)


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
