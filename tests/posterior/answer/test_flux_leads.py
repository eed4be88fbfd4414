"""Of which errors an answer owes its scale: the flux's are integrated out, a shadow's are not."""

import dataclasses

import numpy as np
import pytest

from benchmarks.coverage.paths import draw_path
from inference.identifiability.model_response import model_response
from inference.posterior import fold
from inference.posterior.answer import error_budget
from inference.posterior.answer.responses import Responses, flux_leads, responses_at
from inference.posterior.criticism.discrepancy_check import ADDED
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.identifiability.test_shadow_response import KINDS, experiment


def followed(kind: str, flux: float, shadow: float) -> Responses:
    """Return how one draw before a wall follows errors of these sizes."""
    one = dataclasses.replace(experiment(kind, flux), shadow=shadow)
    readings = one.readings.mean
    each = (model_response(one, readings),)
    return Responses(one.z[None], one.log_r[None], (one,), each, readings, 0.0, repeated=False)


@pytest.mark.parametrize("kind", KINDS)
def test_what_moves_the_scale_most_leads(kind: str) -> None:
    """Either of them that is a thousand times smaller than the other does not."""
    assert flux_leads(followed(kind, 0.07, 2e-4))
    assert not flux_leads(followed(kind, 7e-5, 0.2))
    assert flux_leads(followed(kind, 0.07, 0.0))


@pytest.mark.parametrize("kind", KINDS)
def test_the_flux_leads_by_six_tenths_of_what_both_move_the_scale_by(kind: str) -> None:
    """Sizes on both sides of it: as what both move by grows with the shadow's, so does the rest."""
    sizes = np.geomspace(1e-3, 1.0, 13)
    both = [followed(kind, 0.07, size) for size in sizes]
    alone = followed(kind, 0.07, 0.0).of_scale
    share = np.array([alone / each.of_scale for each in both])
    assert share.max() > 0.6 > share.min()
    assert [flux_leads(each) for each in both] == list(share >= 0.6)


@pytest.mark.parametrize(("curvature", "asked"), [(ADDED / 2.0, False), (2.0 * ADDED, True)])
def test_which_of_them_leads_is_asked_where_the_response_bends(
    curvature: float, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it is straight nothing has to be integrated out, whichever it is."""
    data = draw_path("independent", "crosstalk", "nothing", 5)
    settings = SamplerSettings(method="auto", seed=4)
    job = fold.prepare(data.sensor, parse_scene(data.scene), data.frames, settings)
    density = job.density()
    z = np.zeros((3, len(density.parameters)))
    log_r = density.best_ranges(z)[:, :, 0]
    follow = responses_at

    def bent(*arguments: object) -> Responses:
        found = follow(*arguments)  # type: ignore[arg-type]
        return dataclasses.replace(found, curvature=curvature)

    monkeypatch.setattr(error_budget, "responses_at", bent)
    for leads in (False, True):
        monkeypatch.setattr(error_budget, "flux_leads", lambda _, leads=leads: leads)
        rng = np.random.default_rng(1)
        budget = error_budget.error_budget(job, density, z, log_r, None, None, None, rng)
        assert budget.by_flux == (leads or not asked)
