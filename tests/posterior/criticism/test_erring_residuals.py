"""Residuals about the point that meets readings best with errors of flux and shadow."""

import dataclasses

import numpy as np
import pytest

from inference.frame.sensitivity import whiteners
from inference.posterior.criticism.best_point import BestPoint
from inference.posterior.criticism.erring_residuals import erring_residuals
from tests.identifiability.test_shadow_response import KINDS, experiment

REPLICATES = 400


@pytest.mark.parametrize("kind", KINDS)
def test_errors_that_the_scene_allows_are_no_misfit_and_others_are(kind: str) -> None:
    """With a fixed seed; among so many replicates one in 401 sets would be beyond all of them."""
    rng = np.random.default_rng(5)
    at = experiment(kind, 0.07)
    error = np.asarray(rng.standard_normal(at.by_error.shape[2]))
    at = dataclasses.replace(at, error=error)
    sd = np.linalg.inv(whiteners(at.sensor, at.readings))
    noise = np.einsum("nij,nj->ni", sd, rng.standard_normal(at.readings.mean.shape))
    readings = at.readings.mean + noise
    found = erring_residuals(BestPoint(at, readings), REPLICATES, rng)
    total = found.squared.sum(axis=1)
    assert total[0] < total[1:].max()
    assert found.error[0] < found.error[1:].max()
    assert np.all(np.diff(found.log_r) > 0)
    assert found.across.shape == (1 + REPLICATES, 12)
    # what is not smooth along the range is no such error
    rough = np.where(np.arange(len(noise)) % 2 == 0, 30.0, -30.0)
    spoilt = readings + np.einsum("nij,j->ni", sd, np.array([1.0, -1.0])) * rough[:, None]
    total = erring_residuals(BestPoint(at, spoilt), REPLICATES, rng).squared.sum(axis=1)
    assert total[0] > 2.0 * total[1:].max()
