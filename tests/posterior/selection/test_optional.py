"""Optional terms: kept where the data demand them, left out where they do not, with the numbers."""

import math
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.posterior import fold
from inference.posterior.infer import infer
from inference.posterior.selection.models import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import decide
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

QUICK = SamplerSettings(seed=7, target_ess=50, max_seconds=3600)
CROSSTALK = {"values": UNKNOWN_CROSSTALK, "optional": True}
WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": 3.0,
    "shadow": "object",
    "optional": True,
}
BOTH = parse_scene({"crosstalk": CROSSTALK, "background": WALL})


def candidate(
    terms: tuple[str, ...],
    evidence: float,
    predictive: float,
    k_hat: float = 0.2,
    error: float = 0.1,
) -> Candidate:
    """Make a candidate of 16 frames."""
    frames = np.full(16, predictive / 16)
    return Candidate(terms, evidence, error, None, frames, k_hat, 100)


def kept(scene: Scene, *candidates: Candidate) -> tuple[str, ...]:
    return tuple(d.term for d in decide(scene, candidates) if d.kept)


ONE = parse_scene({"crosstalk": CROSSTALK})


@pytest.mark.parametrize(
    ("evidence", "predictive", "stays", "agree"),
    [
        (-12.0, -2.0, False, True),
        (2.5, 1.0, False, True),  # below both margins
        (4.0, 9.0, True, True),
        (4.0, 1.0, True, False),  # the evidence alone
        (-9.0, 9.0, True, False),  # the predictive density alone: Lindley's paradox
    ],
)
def test_a_term_stays_where_either_criterion_demands_it(
    evidence: float, predictive: float, stays: bool, agree: bool
) -> None:
    without, with_it = candidate((), 0.0, 0.0), candidate(("crosstalk",), evidence, predictive)
    (decision,) = decide(ONE, [without, with_it])
    assert decision.kept is stays
    assert decision.agree is agree
    assert f"{evidence:+.1f}" in decision.reason
    assert f"{predictive:+.1f}" in decision.reason


def test_an_evidence_that_is_not_known_well_enough_leaves_nothing_out() -> None:
    without, unsure = candidate((), 0.0, 0.0), candidate(("crosstalk",), -2.0, -1.0, error=4.0)
    assert kept(ONE, without, unsure) == ("crosstalk",)


def test_a_predictive_density_that_cannot_be_trusted_decides_nothing_and_it_is_said() -> None:
    without, doubtful = candidate((), 0.0, 0.0), candidate(("crosstalk",), -9.0, 9.0, k_hat=0.9)
    (decision,) = decide(ONE, [without, doubtful])
    assert not decision.kept
    assert not decision.agree
    assert "not trusted" in decision.reason
    # the gain over a model whose density is overrated is a lower bound, which can be trusted
    overrated = candidate((), 0.0, 0.0, k_hat=3.0)
    assert kept(ONE, overrated, candidate(("crosstalk",), -9.0, 9.0)) == ("crosstalk",)


def test_a_term_without_which_nothing_explains_the_frames_stays() -> None:
    nothing = candidate((), -math.inf, -math.inf, k_hat=-math.inf)
    (decision,) = decide(ONE, [nothing, candidate(("crosstalk",), -50.0, -60.0)])
    assert decision.kept
    assert "without it no parameters" in decision.reason
    impossible = candidate(("crosstalk",), -math.inf, -math.inf, k_hat=-math.inf)
    (decision,) = decide(ONE, [candidate((), -50.0, -60.0), impossible])
    assert not decision.kept
    assert "with it no parameters" in decision.reason


@pytest.mark.parametrize(
    ("evidences", "predictives", "wanted"),
    [
        ((0, -5, -6, -9), (0, -1, -1, -2), ()),
        ((0, 90, 20, 85), (0, 95, 30, 94), ("crosstalk",)),
        ((0, 20, 90, 85), (0, 30, 95, 94), ("background",)),
        ((0, 50, 60, 200), (0, 55, 65, 210), ("crosstalk", "background")),
        # either would do, and nothing tells which
        ((0, 90, 89, 85), (0, 95, 96, 94), ("crosstalk", "background")),
        # by the evidence crosstalk, by the predictive density a background
        ((0, 95, 89, 85), (0, 93, 96, 94), ("crosstalk", "background")),
    ],
)
def test_the_simplest_of_four_models_over_which_none_is_demanded(
    evidences: tuple[float, ...], predictives: tuple[float, ...], wanted: tuple[str, ...]
) -> None:
    names = candidate_terms(BOTH)
    assert names == ((), ("crosstalk",), ("background",), ("crosstalk", "background"))
    found = [candidate(t, e, p) for t, e, p in zip(names, evidences, predictives, strict=True)]
    assert kept(BOTH, *found) == wanted


def test_the_reduced_scene_is_the_scene_that_states_only_what_stays() -> None:
    assert reduced(BOTH, ()) == parse_scene({"crosstalk": None, "background": None})
    assert (
        reduced(BOTH, ("crosstalk",)).crosstalk
        == parse_scene({"crosstalk": UNKNOWN_CROSSTALK}).crosstalk
    )
    background = reduced(BOTH, ("background",)).background
    assert background is not None
    assert not background.optional
    assert reduced(BOTH, BOTH.optional_terms).optional_terms == ()


def rate(strength: float, sets: int) -> float:
    """Share of data sets in which crosstalk stays; object known but for c2, ten frames."""
    sensor = sensor_of("pulsed", 300.0)
    read = sensor.noise.read[0]
    prior = {"prior": "normal", "mean": 0.0, "sd": 100 * read}
    terms = {"crosstalk": {"values": [prior, prior], "optional": True}}
    scene = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, **terms})
    count = 0
    for seed in range(sets):
        truth = {"crosstalk": [strength * read, strength * read]}
        frames = data(sensor, truth, frames=10, seed=seed).frames
        rng = np.random.default_rng(seed)
        found = [
            assess(terms, collapsed_density(sensor, reduced(scene, terms), frames), rng)
            for terms in candidate_terms(scene)
        ]
        count += bool(kept(scene, *found))
    return count / sets


def test_an_absent_term_is_left_out_and_a_strong_one_is_kept() -> None:
    """False alarms have a probability of 0.3 %: three of twelve data sets once in 1e5 runs.

    Of crosstalk of five read noises ten frames leave a chi-square of about 2 x 5^2 x 3, which
    falls below what either margin asks for less than once in 1e6.
    """
    assert rate(0.0, 12) <= 2 / 12
    assert rate(5.0, 4) == 1.0


def request(truth: dict[str, Any], scene: dict[str, Any]) -> tuple[Sensor, Scene, Frames]:
    sensor = sensor_of("pulsed")
    return sensor, parse_scene(scene), data(sensor, truth).frames


def test_left_out_the_answer_is_that_of_the_scene_without_the_term() -> None:
    optional = infer(*request({}, {"crosstalk": CROSSTALK}), QUICK)
    without = infer(*request({}, {}), QUICK)
    assert np.array_equal(optional.draws.parameters, without.draws.parameters)
    first, second = optional.to_json(), without.to_json()
    changed = {"selection", "left_out", "runtime"}
    assert {k: v for k, v in first.items() if k not in changed} == {
        k: v for k, v in second.items() if k not in changed
    }
    assert second["selection"] is None
    rows = {row["term"]: row["reason"] for row in first["left_out"]}
    assert rows["background"] == "the scene states none"
    assert "evidence" in rows["crosstalk"]
    assert [c["terms"] for c in first["selection"]["candidates"]] == [[], ["crosstalk"]]
    assert [c["chosen"] for c in first["selection"]["candidates"]] == [True, False]
    assert first["selection"]["decisions"][0]["agree"]


def test_kept_the_answer_is_that_of_the_scene_with_the_term() -> None:
    truth = {"crosstalk": [0.002, 0.01]}
    optional = infer(*request(truth, {"crosstalk": CROSSTALK}), QUICK)
    stated = infer(*request(truth, {"crosstalk": UNKNOWN_CROSSTALK}), QUICK)
    assert np.array_equal(optional.draws.parameters, stated.draws.parameters)
    assert "crosstalk.w1" in optional.parameters
    assert {row.term for row in optional.left_out} == {"background", "discrepancy"}
    assert optional.selection is not None
    assert optional.selection.decisions[0].kept


def test_stopped_before_the_terms_are_decided_all_of_them_are_kept() -> None:
    job = fold.prepare(*request({}, {"crosstalk": CROSSTALK}), QUICK)
    checkpoint = fold.start(job)
    assert fold.progress(job, checkpoint).steps == 0
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    assert not posterior.verdict.converged
    assert "crosstalk.w1" in posterior.parameters
    assert posterior.selection is not None
    assert "no time" in posterior.selection.decisions[0].reason
    assert posterior.to_json()["selection"]["candidates"] == []
