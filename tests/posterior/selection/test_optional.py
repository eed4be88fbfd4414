"""Optional terms: kept where the data demand them, left out where they do not, with the numbers."""

import math
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.posterior import fold
from inference.posterior.infer import infer
from inference.posterior.selection.consequence import Reported
from inference.posterior.selection.models import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import decide
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

QUICK = SamplerSettings(method="emcee", seed=7, target_ess=50, max_seconds=3600)
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
    says: Reported | None = None,
) -> Candidate:
    """Make a candidate of 16 frames."""
    frames = np.full(16, predictive / 16)
    return Candidate(terms, evidence, error, None, frames, k_hat, 100, says)


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


def says(moved: float = 0.0, shrunk: float = 0.0, names: tuple[str, ...] = ()) -> Reported:
    """Make what a model reports of c2 and two ranges, one of them moved or narrow."""
    mean, width = np.array([0.1, 1.0, 2.0]), np.array([0.01, 0.1, 0.2])
    mean[1] += 0.05 * moved
    width[2] *= 1.0 - shrunk
    extra = np.zeros(len(names))
    mean, width = np.concatenate([extra, mean]), np.concatenate([extra + 1.0, width])
    names = (*names, "object.c2")
    return Reported(names, mean, 0.5 * width, mean - 0.5 * width, mean + 0.5 * width)


@pytest.mark.parametrize(
    ("moved", "shrunk", "stays"),
    [(0.25, 0.3, False), (0.35, 0.0, True), (-0.35, 0.0, True), (0.0, 0.4, True)],
)
def test_a_term_stays_where_the_answer_hangs_on_it(
    moved: float, shrunk: float, stays: bool
) -> None:
    """By evidence and predictive density alone it is left out: nothing demands it."""
    without = candidate((), 0.0, 0.0, says=says(moved, shrunk))
    with_it = candidate(("crosstalk",), -9.0, -1.0, says=says(names=("crosstalk.w1",)))
    (decision,) = decide(ONE, [without, with_it])
    assert decision.kept is stays
    assert ("the answer hangs on it" in decision.reason) is stays
    assert f"moves by {abs(moved):.2g} of" in decision.reason
    assert f"shrinks by {shrunk:.0%}" in decision.reason
    if moved > 0:
        assert "the range of usable frame 0 moves" in decision.reason


def test_of_two_terms_the_one_goes_on_which_nothing_hangs() -> None:
    names = candidate_terms(BOTH)
    # without crosstalk the ranges are other ones, with or without a background
    found = [
        candidate(terms, -3.0 * len(terms), -1.0, says=says(0.0 if "crosstalk" in terms else 2.0))
        for terms in names
    ]
    assert kept(BOTH, *found) == ("crosstalk",)


def observed(sensor: Sensor, strength: float, seed: int, empty: int) -> Frames:
    """Ten frames of the plate before crosstalk in read noises, and frames without the plate."""
    read = sensor.noise.read[0]
    seen = data(sensor, {"crosstalk": [strength * read] * 2}, frames=10, seed=seed).frames
    noise = np.random.default_rng([seed, 1]).standard_normal((empty, 2))
    readings = np.concatenate([seen.readings, read * (strength + noise)])
    return Frames(readings, object_present=np.arange(10 + empty) < 10)


def rate(strength: float, sets: int, empty: int) -> float:
    """Share of data sets in which crosstalk stays; of the object c2 is unknown."""
    sensor = sensor_of("pulsed", 300.0)
    prior = {"prior": "normal", "mean": 0.0, "sd": 100 * sensor.noise.read[0]}
    terms = {"crosstalk": {"values": [prior, prior], "optional": True}}
    scene = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, **terms})
    count = 0
    for seed in range(sets):
        frames = observed(sensor, strength, seed, empty)
        rng = np.random.default_rng(seed)
        found = [
            assess(terms, collapsed_density(sensor, reduced(scene, terms), frames), rng)
            for terms in candidate_terms(scene)
        ]
        count += bool(kept(scene, *found))
    return count / sets


def test_an_absent_term_is_left_out_where_empty_frames_show_it_and_a_real_one_is_kept() -> None:
    """With a hundred empty frames crosstalk is known to a tenth of a read noise: without it means
    move by about 0.2 of their sd, by more than 0.3 in a tenth of data sets, and in four of six once
    in a thousand runs. One read noise is then ten standard deviations."""
    assert rate(0.0, 6, empty=100) <= 3 / 6
    assert rate(1.0, 2, empty=100) == 1.0


def test_without_empty_frames_ranges_hang_on_crosstalk_that_nothing_demands() -> None:
    assert rate(0.0, 2, empty=0) == 1.0


def request(scene: dict[str, Any], strength: float) -> tuple[Sensor, Scene, Frames]:
    sensor = sensor_of("pulsed")
    stated = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, **scene})
    return sensor, stated, observed(sensor, strength, 1, 100)


def test_left_out_the_answer_is_that_of_the_scene_without_the_term() -> None:
    optional = infer(*request({"crosstalk": CROSSTALK}, 0.0), QUICK)
    without = infer(*request({}, 0.0), QUICK)
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
    optional = infer(*request({"crosstalk": CROSSTALK}, 300.0), QUICK)
    stated = infer(*request({"crosstalk": UNKNOWN_CROSSTALK}, 300.0), QUICK)
    assert np.array_equal(optional.draws.parameters, stated.draws.parameters)
    assert "crosstalk.w1" in optional.parameters
    assert {row.term for row in optional.left_out} == {"background"}
    assert optional.selection is not None
    assert optional.selection.decisions[0].kept


def test_stopped_before_the_terms_are_decided_all_of_them_are_kept() -> None:
    job = fold.prepare(*request({"crosstalk": CROSSTALK}, 0.0), QUICK)
    checkpoint = fold.start(job)
    assert fold.progress(job, checkpoint).steps == 0
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    assert not posterior.verdict.converged
    assert "crosstalk.w1" in posterior.parameters
    assert posterior.selection is not None
    assert "no time" in posterior.selection.decisions[0].reason
    assert posterior.to_json()["selection"]["candidates"] == []
