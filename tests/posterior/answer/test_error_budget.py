"""The error budget of answers: parts and whole, and what each is told by."""

import numpy as np
import pytest

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

SETTINGS = SamplerSettings(seed=1, method="importance")
KNOWN = {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}
FRAMES = data(sensor_of("pulsed", 1e5), frames=6, seed=2, span=(0.3, 1.2)).frames


def answer(discrepancy: object, **more: object) -> Posterior:
    scene = {"object": KNOWN, "discrepancy": discrepancy, **more}
    return infer(sensor_of("pulsed", 1e5), parse_scene(scene), FRAMES, SETTINGS)


@pytest.fixture(scope="module")
def answers() -> dict[str, Posterior]:
    stated = {"flux": 0.072, "range_m": 8e-4}
    return {"none": answer(0), "default": answer("default"), "stated": answer(stated)}


def test_squares_of_the_parts_add_up(answers: dict[str, Posterior]) -> None:
    for each in answers.values():
        parts = each.range_m.sd_parts
        squares = np.square([parts.noise, parts.scene, parts.model]).sum(axis=0)
        assert np.sqrt(squares) == pytest.approx(each.range_m.sd)
        row = each.parameters["object.c2"]
        of = row.sd_parts
        assert np.hypot(np.hypot(of.noise, of.scene), of.model) == pytest.approx(row.sd)
        document = each.to_json()
        assert document["range_m"]["sd_parts"]["model"] == pytest.approx(parts.model)
        assert document["parameters"]["object.c2"]["sd_parts"]["noise"] == pytest.approx(of.noise)
        assert document["parameters"]["object.c2"]["sd"] == row.sd


def test_the_default_is_the_error_integrated_out(answers: dict[str, Posterior]) -> None:
    """At a thousand draws a standard deviation is known to 2.3 %, and the stated answer is wider by
    what an error twice as large would move it."""
    none, default, stated = answers["none"], answers["default"], answers["stated"]
    assert np.all(none.range_m.sd_parts.model == 0.0)
    assert np.all(default.range_m.sd > 2 * none.range_m.sd)
    ratio = default.range_m.sd / stated.range_m.sd
    assert np.all((ratio > 0.75) & (ratio < 1.15))
    a, b = default.parameters["object.c2"], stated.parameters["object.c2"]
    assert 0.75 < a.sd / b.sd < 1.15
    assert abs(a.mean - b.mean) < b.sd


def test_no_interval_is_below_the_error_of_the_range(answers: dict[str, Posterior]) -> None:
    """Five standard errors of 2.3 % each."""
    for name in ("default", "stated"):
        assert np.all(answers[name].range_m.sd > 0.88 * 8e-4)
    assert np.all(answers["none"].range_m.sd < 4e-4)


def test_a_range_that_its_prior_tells_does_not_follow_the_error() -> None:
    law = {"prior": "normal", "mean": 0.7, "sd": 1e-5}
    wide = data(sensor_of("pulsed", 30.0), frames=3, span=(0.7, 0.7000001)).frames
    scene = parse_scene({"object": OBJECT, "range_m": law})
    found = infer(sensor_of("pulsed", 30.0), scene, wide, SETTINGS).range_m
    assert np.all(found.sd < 2e-5)
