"""Where errors of the flux larger than stated put draws: against least squares, and how wide."""

import dataclasses

import numpy as np
import pytest

from benchmarks.coverage.paths import draw_path
from benchmarks.larger_errors import BRIGHT, TOLD
from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability import joint_optimum as climbs
from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum
from inference.identifiability.response_rows import ResponseRows
from inference.posterior import fold
from inference.posterior.answer.error_budget import error_budget
from inference.posterior.answer.where_misfit import where_integrated
from inference.posterior.answer.widened import widened
from inference.posterior.criticism.fit_residuals import fit_residuals
from inference.posterior.job import Job
from inference.posterior.settings import SamplerSettings
from simulator.discrepancy import DISCREPANCY_SD
from simulator.scene import parse_scene

SET = draw_path("independent", "crosstalk", TOLD, 5, BRIGHT)
ROUNDING = 1e-9
SMALL = 1e-3  # errors of the flux, in standard deviations: all follow them linearly


def given() -> Job:
    settings = SamplerSettings(method="auto", seed=4, max_seconds=30.0)
    return fold.prepare(SET.sensor, parse_scene(SET.scene), SET.frames, settings)


def test_draws_are_widened_by_a_factor_of_their_variance() -> None:
    rng = np.random.default_rng(1)
    z = rng.standard_normal((50, 3)) @ rng.standard_normal((3, 3))
    log_r = np.concatenate([z @ rng.standard_normal((3, 4)), np.full((50, 1), np.nan)], axis=1)
    of_z, of_log_r = widened(z, log_r, 5.0)
    assert np.allclose(of_z @ of_z.T, 4.0 * np.cov(z.T, bias=True), rtol=ROUNDING)
    expected = 4.0 * np.cov(log_r[:, :4].T, bias=True)
    assert np.allclose(of_log_r[:4] @ of_log_r[:4].T, expected, rtol=ROUNDING)
    assert np.allclose(of_log_r[4], 0.0, atol=ROUNDING)


def best_by_least_squares(
    at: Experiment, error: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where readings with small errors put unknowns, ranges and errors that are zero there.

    A linear problem, with the ranges as unknowns as well, none eliminated.
    """
    rows, frames, d = ResponseRows(at), np.arange(at.log_r.size), at.z.size
    each, k = rows.along.shape[1], error.size
    along = np.zeros((frames.size, each, frames.size))
    along[frames, :, frames] = rows.along
    prior = np.eye(d + k)
    above = np.concatenate([rows.jacobian, rows.by_error, along], axis=2)
    whole = np.zeros((frames.size * each + d + k, d + k + frames.size))
    whole[: -(d + k)], whole[-(d + k) :, : d + k] = above.reshape(-1, whole.shape[1]), prior
    seen = np.append((rows.by_error @ error).ravel(), np.zeros(d + k))
    size = np.linalg.norm(whole, axis=0)
    found = np.linalg.lstsq(whole / size, seen, rcond=None)[0] / size
    return found[:d], found[d + k :], found[d : d + k]


def erring_a_little(job: Job) -> tuple[CollapsedDensity, Experiment, np.ndarray]:
    """Return a density of readings without noise, the middle of its priors, and the flux's error.

    All of them are at that middle but for this error.
    """
    density = job.density()
    middle, true = np.zeros(len(density.parameters)), np.log(SET.range_m)
    begin = Experiment(density.sensor, density.parameters, middle, true, discrepancy=DISCREPANCY_SD)
    error = SMALL * np.random.default_rng(3).standard_normal((begin.by_error.shape[2],))
    frames = density.frames.copy()
    frames[:, :2] = dataclasses.replace(begin, error=error).readings.mean
    return dataclasses.replace(density, frames=frames), begin, error


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_residuals_allow_for_errors_of_the_flux_as_large_as_readings_ask_for(times: float) -> None:
    """Errors of three times the size are fewer standard deviations of it, by a linear fit."""
    job = dataclasses.replace(given(), flux_times=times)
    density, begin, error = erring_a_little(job)
    found = fit_residuals(job, density, begin.z, 2, np.random.default_rng(1)).error[0]
    larger = dataclasses.replace(begin, discrepancy=times * DISCREPANCY_SD)
    *_, best = best_by_least_squares(larger, error / times)
    assert found == pytest.approx(np.square(best).sum(), rel=5.0 * SMALL)


@pytest.mark.parametrize("times", [1.001, 4.0])
def test_all_draws_move_to_the_best_point_and_are_as_uncertain_as_the_way_is_long(
    times: float,
) -> None:
    """From all around, to the point that errors of that size put there: all is small and linear."""
    rng = np.random.default_rng(3)
    density, begin, error = erring_a_little(given().with_error_integrated())
    assert isinstance(density, DiscrepantDensity)
    small, readings, true = SMALL, density.frames[:, :2], begin.log_r
    z = small * rng.standard_normal((5, begin.z.size))
    log_r = true + small * (1.0 + 0.2 * rng.standard_normal((5, true.size)))
    draws = zip(z, log_r, strict=True)
    at = [dataclasses.replace(begin, z=one, log_r=ranges) for one, ranges in draws]
    of_z, of_log_r = where_integrated(density, at, readings, (z, log_r), times)
    larger = dataclasses.replace(begin, discrepancy=times * density.discrepancy)
    best = best_by_least_squares(larger, error / times)[:2]
    there = np.median(z, axis=0) + of_z[:, 0], np.median(log_r, axis=0) + of_log_r[:, 0] - true
    for found, expected, moved, drawn in zip(
        there, best, (of_z, of_log_r), (z, log_r), strict=True
    ):
        # what is not linear is the square of what is small, times a few
        np.testing.assert_allclose(found, expected, atol=5.0 * small**2)
        assert np.array_equal(moved[:, 0], moved[:, 1])
        more, spread = moved[:, 2:] @ moved[:, 2:].T, np.cov(drawn.T, bias=True)
        assert np.allclose(more, (times**2 - 1.0) * spread, rtol=1e-6, atol=ROUNDING * small**2)
    # a mistaken size leads elsewhere
    stated = best_by_least_squares(begin, error)[0]
    assert (np.abs(stated - best[0]).max() > 0.05 * small) == (times > 2.0)


def test_where_frames_are_dealt_out_no_part_climbs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each would take seconds, and there may be fifty; errors are larger there, too."""
    job, climbs = dataclasses.replace(given(), flux_times=3.0), []
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
    """Towards readings a hundred times as bright one step leads to a c2 of e^80."""
    density = given().with_error_integrated().density()
    d, larger = len(density.parameters), 4.0 * DISCREPANCY_SD
    at = Experiment(
        density.sensor, density.parameters, np.zeros(d), np.log(SET.range_m), discrepancy=larger
    )
    at = dataclasses.replace(at, error=np.zeros(at.by_error.shape[2]))
    readings = 100.0 * at.readings.mean
    one = climbs._stepped(ResponseRows(at), readings, 0.0)
    assert np.abs(one.z).max() == climbs._FARTHEST
    end, deviance = joint_optimum(at, readings)
    assert np.isfinite(deviance)
    assert end.finite
