"""What stands as an answer before any ensemble has walked."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import special, stats

from inference.posterior import fold
from inference.posterior.sampling.importance import WeightedDraws, pareto_k_hat, smoothed
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.rounds_so_far import RoundsSoFar, Wanted
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages import walking
from inference.posterior.stages.ensembles import from_draws
from inference.posterior.stages.stage import Starting, Tempering, Walking, Weighted
from inference.posterior.stages.standing import _tail, _weighted, standing
from inference.posterior.stages.starting import begin
from tests.posterior.scenes import example


def test_stopped_before_the_first_chunk_the_weighted_draws_answer() -> None:
    """Their intervals, with the same error of the model, are those of the ensembles.

    Quantiles of 5 % of 400 draws err by 0.1 sd; five times that, with those of the ensembles.
    """
    settings = SamplerSettings(method="emcee", seed=7)
    job = fold.prepare(*example("pulsed", crosstalk=False), settings)
    checkpoint = begin(job, Starting())
    assert isinstance(checkpoint.stage, Weighted)
    assert isinstance(standing(checkpoint.stage), Weighted)
    first = fold.summarise(job, checkpoint, 0.0, 0.0)
    while pieces := [fold.run(task) for task in fold.tasks(job, checkpoint)]:
        checkpoint = fold.merge(job, checkpoint, pieces)
    last = fold.summarise(job, checkpoint, 0.0, 0.0)
    assert first.drawn
    assert first.method == "importance"
    assert not first.verdict.converged
    assert "effective sample size" in first.verdict.reasons[0]
    assert all(row.status != "identified" for row in first.identifiability)
    assert last.verdict.converged
    for name, row in last.parameters.items():
        assert first.parameters[name].ess_bulk > 100
        assert first.parameters[name].q05 == pytest.approx(row.q05, abs=0.5 * row.sd)
        assert first.parameters[name].q95 == pytest.approx(row.q95, abs=0.5 * row.sd)
    assert np.all(np.abs(first.range_m.q50 - last.range_m.q50) < 0.5 * last.range_m.sd)


def test_weighted_draws_stand_while_a_proposal_is_adapted(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was walked is forgotten then; that there was an answer is not."""
    settings = SamplerSettings(method="emcee", seed=7)
    job = fold.prepare(*example("pulsed", crosstalk=False), settings)
    drawn = begin(job, Starting()).stage
    assert isinstance(drawn, Weighted)
    assert drawn.outset is not None
    stage = from_draws(job, job.density(), drawn.draws, drawn.outset)[0]
    assert stage.weighted is not None
    monkeypatch.setattr(walking, "is_slow", lambda *_: True)
    adapted = dataclasses.replace(stage, adaptations=2, start=None)
    pieces = [task.run() for task in walking.tasks(job, adapted)]
    after, _ = walking.merge(job, adapted, pieces)
    assert isinstance(after, Walking)
    assert after.steps == 0
    assert after.weighted is stage.weighted
    assert isinstance(standing(after), Weighted)


def test_members_at_some_power_are_draws_of_the_posterior_by_weight() -> None:
    """Prior N(0, 1), likelihood N(1, 1/3) of a datum: the posterior is N(0.75, 1/4).

    At power 1/2 the members are N(0.6, 0.4). Bands of five standard errors.
    """
    rng = np.random.default_rng(5)
    z = 0.6 + np.sqrt(0.4) * rng.standard_normal((2000, 1))
    likelihood, prior = -1.5 * (z[:, 0] - 1.0) ** 2, -0.5 * z[:, 0] ** 2
    twice = np.concatenate([np.arange(2000), np.arange(1000)])  # copies
    members = Population(z[twice], likelihood[twice], prior[twice], 0.5, 0.0, 3, 1)
    found = _weighted(members)
    mean = float(found.weights @ found.z[:, 0])
    variance = float(found.weights @ (found.z[:, 0] - mean) ** 2)
    assert found.weights.sum() == pytest.approx(1.0)
    assert len(found.z) == 2000
    assert found.ess < 2000
    assert abs(mean - 0.75) < 5 * 0.5 / np.sqrt(found.ess)
    assert abs(variance / 0.25 - 1) < 5 * np.sqrt(2 / found.ess)
    assert found.k_hat < 0.7


def test_smoothed_weights_keep_their_order_and_their_mean() -> None:
    """Of a Pareto law of shape 0.6 the largest of 2,000 weights are nearly all noise."""
    errors = []
    for seed in range(20):
        raw = np.log(stats.pareto(1 / 0.6).rvs(2000, random_state=seed))
        log_weights, k_hat = smoothed(raw)
        assert k_hat == pareto_k_hat(raw)
        assert (np.diff(log_weights[np.argsort(raw)]) >= 0).all()
        assert log_weights.max() <= raw.max()
        errors.append([special.logsumexp(x) - np.log(2000 / 0.4) for x in (raw, log_weights)])
    # the mean is 1 / (1 - 0.6) = 2.5; its spread is less once the tail is smoothed
    assert np.std(errors, axis=0)[1] <= np.std(errors, axis=0)[0]
    same = np.zeros(100)
    assert np.array_equal(smoothed(same)[0], same)


def test_weights_that_differ_by_more_than_numbers_reach_are_smoothed() -> None:
    """Pareto quantiles of a shape of 100 exceed the largest number; a warning is an error."""
    rng = np.random.default_rng(3)
    for spread in (1e2, 3e2, 1e3, 1e4):
        for raw in (spread * rng.standard_normal(3000), spread * rng.exponential(size=3000)):
            log_weights, k_hat = smoothed(raw)
            assert k_hat > 10.0
            assert np.isfinite(log_weights).all()
            assert log_weights.max() <= raw.max()


def test_of_draws_and_members_the_larger_number_answers() -> None:
    """Draws of rounds that failed stand until larger populations are on their way."""
    rng = np.random.default_rng(6)

    def drawn(n: int, k_hat: float) -> WeightedDraws:
        return WeightedDraws(rng.standard_normal((n, 1)), np.zeros(n), np.full(n, 1 / n), k_hat, 0)

    def stage(members: int, draws: WeightedDraws | None) -> Tempering:
        one = np.zeros(members)
        population = Population(rng.standard_normal((members, 1)), one, one, 1.0, 0.0, 3, 1)
        optima = Mixture(np.zeros((1, 1)), np.eye(1)[None], np.ones(1))
        proposal = Proposal(optima, None, 0.5)
        return Tempering(proposal, (population,), Verdict(False, ("no steps were made",)), draws)

    for members, draws, size in (
        (400, drawn(100, 0.6), 400),
        (60, drawn(100, 0.6), 100),
        (60, drawn(100, 0.8), 60),  # a tail that is not to be trusted, however many
        (60, None, 60),
    ):
        found = standing(stage(members, draws))
        assert isinstance(found, Weighted)
        assert len(found.draws.z) == size


def test_trusted_draws_of_rounds_stand_before_what_these_began_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Members that stayed where there is little mass have even weights, and may be more."""
    rng, one = np.random.default_rng(6), np.zeros(400)
    population = Population(rng.standard_normal((400, 1)), one, one, 1.0, 0.0, 3, 1)
    optima = Mixture(np.zeros((1, 1)), np.eye(1)[None], np.ones(1))
    none = np.empty(0)
    pool = Pool(np.empty((0, 1)), none, (), (), (), none)
    proposal = Proposal(optima, None, 0.5)
    rounds = RoundsSoFar(Wanted(400, 12_000), proposal, pool, (0,), 0)
    verdict = Verdict(False, ("no steps were made",))
    stage = Tempering(proposal, (population,), verdict, rounds=rounds)
    known: list[WeightedDraws | None] = []
    monkeypatch.setattr(RoundsSoFar, "draws", property(lambda _: known[-1]))
    for n, k_hat, size in ((100, 0.6, 100), (100, 0.8, 400), (40, 0.6, 400), (0, 0.0, 400)):
        z = rng.standard_normal((n, 1))
        draws = WeightedDraws(z, np.zeros(n), np.full(n, 1 / max(n, 1)), k_hat, 0)
        known.append(draws if n else None)
        found = standing(stage)
        assert isinstance(found, Weighted)
        assert len(found.draws.z) == size
        assert not found.verdict.converged


@pytest.mark.parametrize(
    ("k_hat", "said"),
    [
        (0.254, "Pareto k-hat 0.25"),
        (-math.inf, "weights without a tail"),
        (math.inf, "weights too few to be trusted"),
    ],
)
def test_no_number_is_said_of_weights_that_have_no_tail(k_hat: float, said: str) -> None:
    assert _tail(k_hat) == said
