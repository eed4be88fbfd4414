"""The report's scenes, methods and words."""

import dataclasses
import functools
import itertools
import math

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.techniques import ALL_TECHNIQUES
from service.report.cells import cells_of
from service.report.readings import readings_of, told_of_object
from service.report.said import in_words
from service.report.scenes import SCENES
from service.report.terms import operations_of
from simulator.catalogue import plate_scene
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.parametrisation import fit_shadow
from simulator.optics.surfaces import Shell
from simulator.parameters import parameters_of
from tests.service.reporting import BY_NAME, TINY


def test_every_method_is_in_the_report() -> None:
    for scene in SCENES:
        cells = list(cells_of(scene, dataclasses.replace(TINY, posterior_sets=((8, 1),))))
        assert {cell.name for cell in cells} - {""} == set(ALL_TECHNIQUES)
        assert {"tracker", "emcee", "importance"} <= {cell.family for cell in cells}
        assert len({cell.key for cell in cells}) == len(cells)


def test_readings_have_what_the_scene_says() -> None:
    for name in (
        "Unknown crosstalk, 5 empty frames",
        "Real plate, unknown crosstalk, 5 empty frames",
    ):
        made = readings_of(BY_NAME[name], 7, 1, 5)
        assert made.frames.object_present is not None
        assert made.frames.object_present.tolist() == [False] * 5 + [True] * 7
        assert np.isnan(made.range_m[:5]).all()
        # the crosstalk alone, to within five standard deviations of the mean of five
        noise = np.array(BY_NAME[name].sensor.noise.read)
        off = made.frames.readings[:5].mean(axis=0) - [2e-4, 4e-3]
        assert np.all(np.abs(off) < 5 * noise / math.sqrt(5))
        # the mean way to a plate is longer than that to its middle, and most so near by
        longer = made.range_m[5:] / np.geomspace(0.2, 2.0, 7)
        assert np.all(np.diff(longer) < 1e-12)
        assert longer[0] == (1.0 if not BY_NAME[name].plate else pytest.approx(1.19, abs=0.01))


def test_catalogue_has_what_was_asked_for() -> None:
    kinds = itertools.product(("pulsed", "sine_wave"), (False, True))
    assert {(s.sensor.kind, bool(s.plate)) for s in SCENES} == set(kinds)
    for start in ("Known wall", "Near", "Far", "Through the fold", "Known crosstalk", "Bare"):
        assert {s.sensor.kind for s in SCENES if s.name.startswith(start)} == {
            "pulsed",
            "sine_wave",
        }
    for kind in ("pulsed", "sine_wave"):
        ratios = {s.snr for s in SCENES if s.sensor.kind == kind}
        assert ratios == {10.0**k for k in range(1, 7)}
    plates = [s.free.background for s in SCENES if s.plate and s.free.background]
    assert any(not isinstance(wall.strength, float | int) for wall in plates)
    assert {s.empty for s in SCENES} == {0, 5}


def test_what_is_told_allows_what_is_true() -> None:
    """A prior that excluded the truth would make every honest interval miss it.

    The coordinates of unknowns are standard normal under their priors: within four of the middle.
    """
    told_something = 0
    for scene in SCENES:
        truth = scene.truth.model_dump(mode="json", exclude_unset=True)
        parameters = parameters_of(scene.sensor, scene.free)
        values = {f"object.{name}": value for name, value in truth["object"].items()}
        wall = truth.get("background", {})
        shadow = truth["object"] if wall.get("shadow") == "object" else wall.get("shadow", {})
        values |= {f"background.shadow.{name}": value for name, value in shadow.items()}
        values |= {"background.strength": wall.get("strength")}
        values |= dict(zip(parameters.crosstalk or (), truth.get("crosstalk", ()), strict=False))
        point = np.array([[values[name] for name in parameters.names]])
        z = parameters.standard(point)
        assert np.all(np.abs(z) < 4.0), scene.name
        told_something += z.size
    assert told_something > 3 * len(SCENES)


@pytest.mark.parametrize("name", ["Real plate", "Real plate, sine wave"])
def test_a_calibration_of_a_plate_fits_what_a_sensor_reads_of_it(name: str) -> None:
    """Model errors of a plate are some percent of its light, 2.0 in the mean over 98 plates."""
    scene = BY_NAME[name]
    made = readings_of(scene, 12, 1)
    body = told_of_object(scene).model_dump(mode="json")["object"]
    r, (one, other) = made.range_m, made.frames.readings.T
    light = np.hypot(one, other) if scene.sensor.kind == "sine_wave" else other
    told = body["c0"] * body["c2"] / (r**2 * (r**2 + body["c1"] * r + body["c0"]))
    np.testing.assert_allclose(light, told, rtol=0.1)


def test_the_wall_behind_a_plate_is_as_it_is_told() -> None:
    """To the digits that are told: the plate's shadow at 40 distances, and the bare wall."""
    scene = BY_NAME["Real plate before a known wall"]
    wall = scene.known.model_dump(mode="json")["background"]
    shell, plate = Shell(radius_m=wall["distance_m"]), plate_scene(scene.plate)
    bare = read(OpticalScene(background=shell), scene.sensor).mean
    assert bare[1] == pytest.approx(wall["strength"], rel=1e-9)
    lights = [
        read(OpticalScene(surfaces=(plate.plate(r),), background=shell), scene.sensor).light
        for r in np.geomspace(0.1, 2.4, 40).tolist()
    ]
    ranges = np.array([light.objects.distance_m for light in lights])
    shadow = fit_shadow(ranges, np.array([light.visible_share for light in lights]))
    assert shadow.c0 == pytest.approx(wall["shadow"]["c0"], abs=1e-5)
    assert shadow.c1 == pytest.approx(wall["shadow"]["c1"], abs=1e-4)


def test_reasons_are_in_words() -> None:
    for reason, said in (
        (
            "needs object.c0 and object.c1 as known",
            "needs the object's size and the object's shape as known",
        ),
        (
            "needs a background that is known, and background.strength, background.shadow.c0, "
            "background.shadow.c1 is not",
            "needs a background that is known, and the background's strength, the shadow's size "
            "and the shadow's shape are not",
        ),
        ("made for more: take joint_fit", "made for more: take the fit of everything"),
        ('its shadow ("shadow": "object"): take', "its shadow: take"),
        ("crosstalk.w1 unknown: R-hat 1.2", "the crosstalk of the late window unknown: R-hat 1.2"),
    ):
        assert in_words(reason) == said


def test_what_a_scene_lacks_costs_nothing() -> None:
    """Counted work of the density: known crosstalk is subtracted, unknown terms are looked at."""
    counts = {}
    for name in ("Bare object", "Known crosstalk", "Unknown crosstalk"):
        scene = BY_NAME[name]
        made = readings_of(scene, 3, 1)
        density = collapsed_density(scene.sensor, scene.free, made.frames)
        z = np.zeros((1, len(density.parameters)))
        evaluate = functools.partial(density.frame_log_likelihoods, z)
        # the first call of all may prepare something
        counts[name] = [operations_of(evaluate) for _ in range(3)][1:]
    for first, second in counts.values():
        assert first == second > 1000
    assert counts["Known crosstalk"][0] < 1.1 * counts["Bare object"][0]
    assert counts["Unknown crosstalk"][0] > 1.1 * counts["Bare object"][0]
    # 2,068 a frame: a quarter more would be a slower algorithm
    assert counts["Bare object"][0] < 1.25 * 3 * 2_068
