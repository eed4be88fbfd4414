"""Which room is granted: noise alone does not explain what lasts from frame to frame."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.criticism import room
from inference.posterior.criticism.model_check import lasts_from_frame_to_frame
from inference.posterior.criticism.predictive_check import FLUX_ERROR, NEIGHBOURS, TOTAL, WANDER


@dataclasses.dataclass(frozen=True)
class Part:
    """Stands for a job: the sizes that it was given room for."""

    flux_times: float = 1.0
    noise_times: float = 1.0


def fit_of(misfit: bool, total: float, **p_values: float) -> Fit:
    """Return a fit whose chi-square is so many times what replicates have."""
    p = {NEIGHBOURS: 0.5, WANDER: 0.5, FLUX_ERROR: 0.5} | p_values
    checks = [FitCheck(TOTAL, total, 1.0, 1e-9 if misfit else 0.5)]
    checks += [FitCheck(name, 1.0, 1.0, value) for name, value in p.items()]
    return Fit(1e-9 if misfit else 0.5, misfit, (), total, 1.0, tuple(checks), ())


@pytest.mark.parametrize("name", [NEIGHBOURS, WANDER, FLUX_ERROR])
def test_what_lasts_is_told_by_each_of_the_smooth_checks(name: str) -> None:
    assert lasts_from_frame_to_frame(fit_of(False, 1.0, **{name: 0.049}))
    assert not lasts_from_frame_to_frame(fit_of(False, 1.0, **{name: 0.051}))


@pytest.mark.parametrize(("left", "flux", "noise"), [(0.5, 1.0, 4.4), (0.03, 3.7, 3.0)])
def test_noise_alone_is_granted_where_nothing_smooth_is_left(
    left: float, flux: float, noise: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of an error of the flux that explains not all, noise all, and both together all as well.

    Ranges of recorded photons were 38 % short in intervals of 1.7 % where noise was taken.
    """
    said = iter([fit_of(True, 3.0), fit_of(False, 1.0, **{WANDER: left}), fit_of(False, 1.0)])
    monkeypatch.setattr(room, "model_check", lambda *_: (next(said), None))
    monkeypatch.setattr(room, "asked_for", lambda *_: (3.7, 1.0))
    stated: Any = room.Room((Part(),), None, False)  # type: ignore[arg-type]
    whole: Any = None
    given: Any = None
    found = room.room_for(
        given, given, stated, (fit_of(True, 4.4), None), lambda _: whole, np.random.default_rng(0)
    )
    (part,) = found.parts
    assert (part.flux_times, part.noise_times) == (flux, noise)
    assert found.explained
