"""Frames that may have no light: their ranges reach to the end of what is possible, alone."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.fits.answer import likelihood_answer
from inference.fits.likelihood.erring import Erring, erring_maxima, softened
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.erring_profile import holding
from inference.fits.likelihood.far_ends import far_ends
from inference.fits.likelihood.multistart import find_starts
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.told import KnownRanges
from tests.fits.random_sets import far_set, random_set


@functools.cache
def fitted() -> tuple[FitProblem, Erring]:
    """Return a fit of which a few frames are dark, and many nearly."""
    one = random_set("crosstalk", "pulsed", 2, "default", "default", (2.0, 2.0))
    problem = fit_problem(one.sensor, one.scene, one.simulation.frames)
    return problem, erring_maxima(problem, find_starts(problem, softened(problem)))[0]


@functools.cache
def answered(seed: int) -> tuple[TechniqueResult, list[tuple[FitProblem, Erring]]]:
    """Return a fit of frames that may be dark, and what it asked for the costs of ends for."""
    asked: list[tuple[FitProblem, Erring]] = []

    def noted(problem: FitProblem, top: Erring, *rest: Any) -> Any:
        asked.append((problem, top))
        return far_ends(problem, top, *rest)

    one = far_set("pulsed", seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(likelihood_answer, "far_ends", noted)
        found = estimate(one.sensor, one.scene, one.simulation.frames, ["joint_fit"])
    (result,) = found.results
    return result, asked


@pytest.mark.parametrize("seed", [100, pytest.param(139, marks=pytest.mark.thorough)])
def test_dark_frames_behind_told_crosstalk_are_not_sure_and_wrong(seed: int) -> None:
    """They were `unique`, 17 and 40 standard deviations nearer than the truth, without a misfit."""
    one, (result, _) = far_set("pulsed", seed), answered(seed)
    assert result.fit is not None
    assert not result.fit["misfit"]
    away = np.abs(result.range_m - one.simulation.range_m) / result.sd_m
    assert np.isfinite(away).sum() > 15
    assert np.nanmax(away) < 4.0
    relative = (result.sd_m / result.range_m)[result.status == Status.UNIQUE]
    assert np.nanmedian(relative) < 0.1  # what is bright is told as well as before


def test_ends_cost_what_long_climbs_find() -> None:
    """Also of frames that are not held there: of a deviance of 9 that three sd cost."""
    problem, top = fitted()
    own, _, _, _ = top.at_ranges(top.positions)
    rises = far_ends(problem, top)
    darkest = np.argsort(-own)[:5]
    assert 2 <= np.isfinite(rises[darkest]).sum() <= 4
    assert np.isinf(np.delete(rises, darkest)).all()
    for frame in darkest.tolist():
        held = holding(problem, frame, math.log(problem.support[1]))
        end, _ = climbed(held, begun(held, top.x, top.positions), 100)
        cost = end.deviance - top.deviance
        if math.isfinite(rises[frame]):
            assert rises[frame] == pytest.approx(cost, rel=0.2)
        else:
            assert cost > 9.0


def test_few_dark_frames_stand_for_many() -> None:
    """Of ten that are dark five are held; between these costs follow how dark a frame is."""
    _, ((problem, top),) = answered(100)
    rises = far_ends(problem, top)
    dark = np.flatnonzero(np.isfinite(rises))
    assert dark.size >= 8
    for frame in dark.tolist():
        held = holding(problem, frame, math.log(problem.support[1]))
        end, _ = climbed(held, begun(held, top.x, top.positions), 100)
        assert rises[frame] == pytest.approx(end.deviance - top.deviance, rel=0.3, abs=0.1)


def test_what_is_told_well_or_known_is_not_followed() -> None:
    problem, top = fitted()
    _, _, whole, _ = top.at_ranges(top.positions)
    assert np.isinf(far_ends(problem, top)[whole < 0.1]).all()
    values, rates = np.zeros((2, whole.size, 2))
    values[0, 0], rates[0, 0] = math.exp(top.positions[0]), 1e3
    known = dataclasses.replace(problem, known=KnownRanges(values, rates, 0.0, 0.0))
    assert np.isinf(far_ends(known, top)).all()
