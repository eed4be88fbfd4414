"""Every technique of the registry keeps what it promises; one that is wrong is noticed at once.

The registry says what is tested: a technique that is added to it is found here without an edit.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from inference.estimates import SdParts, TechniqueResult
from inference.technique import Task, Technique
from inference.techniques import ALL_TECHNIQUES
from tests.contract.scenes import TERMS
from tests.contract.technique_contract import (
    answers_are_right,
    errors_are_right,
    frames_that_cannot_be_used_are_said_to_be,
    immunities_are_those_declared,
    model_errors_are_right,
    model_errors_of_many_frames_are_right,
    needs_are_those_declared,
    of_single_frames,
    settings_of,
)

EVERY = [
    pytest.param(technique, kind, id=f"{technique.name}-{kind}")
    for technique in ALL_TECHNIQUES.values()
    for kind in technique.kinds
]
SINGLE = [case for case in EVERY if of_single_frames(case.values[0])]  # type: ignore[arg-type]
MANY = [case for case in EVERY if case not in SINGLE]


def changed(
    technique: Technique, change: Callable[[TechniqueResult], TechniqueResult]
) -> Technique:
    """Return a copy of a technique with something planted in its answers."""

    def solve(task: Task) -> TechniqueResult:
        return change(technique.solve(task))

    return dataclasses.replace(technique, solve=solve)


def doubled_range(result: TechniqueResult) -> TechniqueResult:
    bounds = None if result.range_bounds_m is None else 2.0 * result.range_bounds_m
    return dataclasses.replace(result, roots_m=2.0 * result.roots_m, range_bounds_m=bounds)


def scaled_sd(result: TechniqueResult, factor: float) -> TechniqueResult:
    parts = result.sd_parts_m
    return dataclasses.replace(
        result,
        roots_sd_m=factor * result.roots_sd_m,
        sd_parts_m=None if parts is None else SdParts(*(factor * part for part in parts)),
    )


def doubled_sd(result: TechniqueResult) -> TechniqueResult:
    return scaled_sd(result, 2.0)


def halved_sd(result: TechniqueResult) -> TechniqueResult:
    return scaled_sd(result, 0.5)


@pytest.mark.parametrize(("technique", "kind"), EVERY)
def test_answers(technique: Technique, kind: str) -> None:
    answers_are_right(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), SINGLE)
def test_errors_of_single_frames(technique: Technique, kind: str) -> None:
    errors_are_right(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), SINGLE)
def test_errors_of_the_model(technique: Technique, kind: str) -> None:
    model_errors_are_right(technique, kind)


@pytest.mark.parametrize("change", [doubled_sd, halved_sd])
@pytest.mark.parametrize(("technique", "kind"), SINGLE)
def test_a_factor_of_two_in_the_model_part_is_noticed(
    technique: Technique, kind: str, change: Callable[[TechniqueResult], TechniqueResult]
) -> None:
    with pytest.raises(AssertionError):
        model_errors_are_right(changed(technique, change), kind)


@pytest.mark.slow
@pytest.mark.parametrize(("technique", "kind"), MANY)
def test_errors_of_many_frames(technique: Technique, kind: str) -> None:
    errors_are_right(technique, kind)


@pytest.mark.slow
@pytest.mark.parametrize(("technique", "kind"), MANY)
def test_errors_of_the_model_of_many_frames(technique: Technique, kind: str) -> None:
    model_errors_of_many_frames_are_right(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), EVERY)
def test_immunities(technique: Technique, kind: str) -> None:
    immunities_are_those_declared(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), SINGLE)
def test_needs(technique: Technique, kind: str) -> None:
    needs_are_those_declared(technique, kind)


@pytest.mark.parametrize(
    ("technique", "kind", "need"),
    [
        pytest.param(*case.values, need, id=f"{case.id}-{need}")
        for case in SINGLE
        for need in case.values[0].needs  # type: ignore[union-attr]
    ],
)
def test_a_need_that_is_not_declared_is_noticed(technique: Technique, kind: str, need: str) -> None:
    needs = tuple(other for other in technique.needs if other != need)
    # wrong, or there is no number to compute with
    with pytest.raises((AssertionError, KeyError, ZeroDivisionError)):
        needs_are_those_declared(dataclasses.replace(technique, needs=needs), kind)


@pytest.mark.parametrize(("technique", "kind"), EVERY)
def test_frames_that_cannot_be_used(technique: Technique, kind: str) -> None:
    frames_that_cannot_be_used_are_said_to_be(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), EVERY)
def test_a_factor_of_two_in_the_range_is_noticed(technique: Technique, kind: str) -> None:
    with pytest.raises(AssertionError, match="sd off"):
        answers_are_right(changed(technique, doubled_range), kind)


@pytest.mark.parametrize("change", [doubled_sd, halved_sd])
@pytest.mark.parametrize(("technique", "kind"), SINGLE)
def test_a_factor_of_two_in_the_sd_is_noticed(
    technique: Technique, kind: str, change: Callable[[TechniqueResult], TechniqueResult]
) -> None:
    with pytest.raises(AssertionError):
        errors_are_right(changed(technique, change), kind)


def keeps_its_word(technique: Technique, kind: str) -> None:
    immunities_are_those_declared(technique, kind)
    answers_are_right(technique, kind)


@pytest.mark.parametrize(("technique", "kind"), SINGLE)
@pytest.mark.parametrize("term", TERMS)
def test_an_immunity_declared_or_denied_wrongly_is_noticed(
    technique: Technique, kind: str, term: str
) -> None:
    """One more than is true: it serves scenes that it is wrong in; one less: scenes it denies."""
    others = tuple(other for other in technique.immune_to if other != term)
    wrong = others if term in technique.immune_to else (*others, term)
    with pytest.raises(AssertionError):
        keeps_its_word(dataclasses.replace(technique, immune_to=wrong), kind)


def test_the_menu_has_scenes_for_every_technique() -> None:
    for technique in ALL_TECHNIQUES.values():
        served = {kind: len(settings_of(technique, kind)) for kind in technique.kinds}
        assert min(served.values()) > 0, (technique.name, served)


def test_an_sd_that_is_not_a_number_is_noticed() -> None:
    def without_sd(result: TechniqueResult) -> TechniqueResult:
        return dataclasses.replace(result, roots_sd_m=np.full_like(result.roots_sd_m, np.nan))

    with pytest.raises(AssertionError):
        answers_are_right(changed(ALL_TECHNIQUES["conventional"], without_sd), "pulsed")
