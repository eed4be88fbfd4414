"""The best point of unknowns, ranges and errors together."""

import dataclasses

import numpy as np
import pytest

from inference.identifiability.joint_optimum import joint_optimum
from inference.identifiability.response_rows import ResponseRows
from inference.posterior.answer import where_bent
from tests.identifiability.test_shadow_response import KINDS, experiment


@pytest.mark.parametrize("kind", KINDS)
def test_a_climb_ends_no_worse_than_at_the_truth(kind: str) -> None:
    """Of readings without noise; what it may stop short by is twice its last gain."""
    at = experiment(kind, 0.07)
    k = at.by_error.shape[2]
    error = np.asarray(np.random.default_rng(4).standard_normal(k))
    truth = dataclasses.replace(at, error=error)
    readings = truth.readings.mean
    begun = dataclasses.replace(at, z=at.z + 0.2, log_r=at.log_r + 0.05)
    end, deviance = joint_optimum(begun, readings)
    of_truth = float(np.square(at.z).sum() + np.square(error).sum())
    assert end.error is not None
    assert deviance <= of_truth + 0.006
    assert np.isnan(end.log_r[-1])
    # nothing but priors is off: the readings are met
    assert np.square(end.z).sum() + np.square(end.error).sum() == pytest.approx(deviance, rel=0.5)


@pytest.mark.parametrize("kind", KINDS)
def test_only_the_best_of_short_climbs_goes_on_and_ends_as_the_best_of_long_ones(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(where_bent, "_FIRST", 3)
    at = experiment(kind, 0.07)
    rng = np.random.default_rng(5)
    error = np.asarray(rng.standard_normal(at.by_error.shape[2]))
    truth = dataclasses.replace(at, error=error)
    readings = truth.readings.mean
    draws = [
        dataclasses.replace(at, z=at.z + by, log_r=at.log_r + by / 8.0)
        for by in (0.8, 0.4, -0.4, -0.8)
    ]
    long = min(joint_optimum(one, readings)[1] for one in draws)
    best = where_bent.best_end(draws, readings)
    assert best is not None
    assert best.error is not None
    off = ResponseRows(best).residual(readings)
    deviance = sum(np.square(part).sum() for part in (off, best.z, best.error))
    assert deviance == pytest.approx(long, abs=0.006)
