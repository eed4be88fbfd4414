"""Where ensembles begin, and what is said before they have moved."""

import dataclasses
import math

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.posterior import fold
from inference.posterior.infer import infer
from inference.posterior.sampling.ensemble import WALKERS
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.start import find_optima
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import setting_out
from inference.posterior.stages.setting_out import SetOutTask
from inference.posterior.stages.stage import Stage, Tempering, Walking, Weighted
from inference.posterior.stages.tempering import tasks
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from tests.posterior.scenes import UNKNOWN_CROSSTALK, example, sensor_of


def test_ensembles_begin_in_different_members_from_all_over_a_population(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where draws that could be the answer hold a mode that hardly any walker would begin in."""
    told = lambda job, _: job.settings.method == "auto"  # noqa: E731
    monkeypatch.setattr(setting_out, "are_told", told)
    sensor, scene, frames = example("pulsed", crosstalk=True)
    settings = SamplerSettings(method="emcee", seed=1, ensembles=14)
    job = fold.prepare(sensor, scene, frames, settings)
    density = collapsed_density(sensor, scene, frames)
    optima = mixture_of(find_optima(density, np.random.default_rng(1)))
    members = optima.draw(np.random.default_rng(2), 1000)
    members = members[np.isfinite(density(members))]
    populations = tuple(
        Population(z, density(z), np.zeros(len(z)), 1.0, 0.0, 1, 1)
        for z in np.array_split(members[np.argsort(members[:, 0])], 2)
    )
    before = Tempering(Proposal(optima, None, 0.5), populations, Verdict(False, ()))
    after = _stage_after(job, before)
    assert isinstance(after, Walking)
    assert after.weighted is not None  # what the walkers are held to
    settings = job.settings.model_copy(update={"method": "auto"})
    answer = _stage_after(dataclasses.replace(job, settings=settings), before)
    assert isinstance(answer, Weighted)
    assert answer.verdict.converged
    assert np.array_equal(answer.draws.z, after.weighted.z)
    starts = [after.proposal.bend(ensemble.coords)[0] for ensemble in after.ensembles[:-1]]
    for k, start in enumerate(starts):
        population = populations[k % 2].z
        # 32 members drawn at random: their mean within 4.5 standard errors of the population's
        error = population[:, 0].std() / math.sqrt(WALKERS)
        assert abs(start[:, 0].mean() - population[:, 0].mean()) < 4.5 * error
    together = np.concatenate(starts[::2]).round(9)
    assert len(np.unique(together, axis=0)) == len(together)


def _stage_after(job: fold.Job, stage: Stage) -> Stage:
    """Return what rounds lead to, in however many chunks."""
    while isinstance(stage, Tempering):
        (task,) = tasks(job, stage)
        assert isinstance(task, SetOutTask)
        stage = task.run().stage
    return stage


def test_one_frame_a_discrepancy_and_an_optional_term_are_answered() -> None:
    sensor = sensor_of("pulsed")
    scene = parse_scene(
        {
            "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
            "discrepancy": 0.05,
            "range_m": {"prior": "loguniform", "low": 0.05, "high": 4.0},
            "crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True},
        }
    )
    frames = frames_from_columns(sensor, {"w1": [0.0014], "w2": [0.0314]})
    found = infer(sensor, scene, frames, SamplerSettings(seed=1, max_seconds=4))
    assert found.selection is not None
    assert all(np.isfinite(one.log_evidence) for one in found.selection.candidates)
