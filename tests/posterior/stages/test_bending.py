"""When the model's errors are to be integrated out: as the scale bends, or an unknown is missed."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from inference.posterior.stages import integrating

DRAWS, FRAMES = 5, 4


def bending(
    patch: pytest.MonkeyPatch, *, missed: float, curvature: float, far_out: bool, leads: bool
) -> bool:
    """Tell whether errors that are all that moves a scale are to be integrated out."""
    found = SimpleNamespace(of_scale=1.0, curvature=curvature, missed=np.array([0.0, missed]))
    patch.setattr(integrating, "first_responses", lambda *_: found)
    patch.setattr(integrating, "repeated", lambda *_: found)
    patch.setattr(integrating, "are_far_out", lambda *_: far_out)
    patch.setattr(integrating, "flux_leads", lambda _: leads)
    log_r = np.zeros((DRAWS, FRAMES))
    density: Any = SimpleNamespace(draw_log_ranges=lambda *_: log_r)
    z, rng, job = np.zeros((DRAWS, 2)), np.random.default_rng(0), Any
    told: Any = integrating.bending(job, density, z, z, rng)  # type: ignore[arg-type]
    assert told is None or told is found
    return told is not None


@pytest.mark.parametrize(
    ("missed", "curvature", "far_out", "leads", "expected"),
    [
        (0.9, 0.01, False, True, False),  # straight
        (1.1, 0.01, False, True, True),  # of an unknown that the scale knows nothing of
        (1.1, 0.01, True, True, False),  # a prior that is contradicted: that is to be said
        (0.0, 0.5, True, True, True),  # the scale's own
        (1.1, 0.5, False, False, False),  # errors of a shadow are not integrated
    ],
)
def test_errors_are_integrated_where_their_response_bends(
    missed: float,
    curvature: float,
    far_out: bool,
    leads: bool,
    expected: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = bending(monkeypatch, missed=missed, curvature=curvature, far_out=far_out, leads=leads)
    assert told == expected


def test_frames_without_object_have_no_response(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(integrating, "first_responses", None)
    density: Any = SimpleNamespace(draw_log_ranges=lambda *_: np.full((DRAWS, FRAMES), np.nan))
    z, rng, job = np.zeros((DRAWS, 2)), np.random.default_rng(0), Any
    assert integrating.bending(job, density, z, z, rng) is None  # type: ignore[arg-type]
