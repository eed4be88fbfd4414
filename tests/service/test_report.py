"""The report: its figures, what it keeps, and its page."""

import dataclasses
import functools
import itertools
import json
import math
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import integrate, stats

import service.report.run as run_module
from inference.density.collapsed import collapsed_density
from inference.techniques import ALL_TECHNIQUES
from service.cli import main
from service.report.cells import Cell, Effort, cells_of
from service.report.floors import least_error
from service.report.light import light_rows
from service.report.measure import measure
from service.report.pace import Pace, Spent
from service.report.page import markdown_page, page
from service.report.picture import draw_scene, draw_snr, draw_summary, draw_terms, svg
from service.report.readings import readings_of, told_of_object
from service.report.row import Costs, Row, order_of, row_from
from service.report.run import Report, machine
from service.report.said import in_words
from service.report.scenes import SCENES, ReportScene
from service.report.scores import Scores, crps_of_draws, crps_of_normals, scores_of_roots
from service.report.table import left_out, percent, with_error
from service.report.taking import method_to_take
from service.report.terms import TermCost, operations_of
from service.report.together import together
from service.report.uncertain import blocks_of, error_of_mean, error_of_quantile, share_band
from simulator.catalogue import plate_scene
from simulator.compiled import compiling_at_once
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.parametrisation import fit_shadow
from simulator.optics.surfaces import Shell
from simulator.parameters import parameters_of
from simulator.readings import object_readings

BY_NAME = {scene.name: scene for scene in SCENES}
TINY = Effort(200, 4, 2, (40,), (10,), (), (), (2,))


def rows_of(
    scenes: Sequence[ReportScene],
    effort: Effort,
    seed: int,
    kept: Path,
    tell: Callable[[str], None] = lambda _: None,
) -> Iterator[Row]:
    """Measure as the command does, which compiles at once.

    Compiled while memory is counted, kernels take thrice as long.
    """
    with compiling_at_once():
        yield from (one.row for one in run_module.measured(scenes, effort, seed, kept, tell))


def test_score_of_a_mixture_is_the_integral_that_defines_it() -> None:
    mean, sd, weight = np.array([[1.0, 3.0]]), np.array([[0.2, 0.5]]), np.array([[0.3, 0.7]])

    def missed(x: float) -> float:
        below = float((weight * stats.norm.cdf(x, mean, sd)).sum())
        return (below - (x >= 2.2)) ** 2

    exact = sum(integrate.quad(missed, *ends)[0] for ends in ((-5.0, 2.2), (2.2, 12.0)))
    found = crps_of_normals(np.array([2.2]), mean, sd, weight)
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    # a part that is not there counts for nothing, and weights need not add up to one
    padded = [np.hstack([part, [[np.nan]]]) for part in (mean, sd, 2 * weight)]
    np.testing.assert_allclose(crps_of_normals(np.array([2.2]), *padded), exact, rtol=1e-6)
    assert np.isnan(crps_of_normals(np.ones(1), *[np.full((1, 2), np.nan)] * 3)).all()


def test_score_of_draws_is_that_of_their_law() -> None:
    draws = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)[:, None] * [0.5, 2.0] + [1.0, -1.0]
    truth = np.array([1.3, 2.0])
    normal = crps_of_normals(
        truth, np.array([[1.0], [-1.0]]), np.array([[0.5], [2.0]]), np.ones((2, 1))
    )
    np.testing.assert_allclose(crps_of_draws(truth, draws), normal, rtol=1e-3)


def test_shares() -> None:
    nan = np.nan
    truth, single = np.array([1.0, 1.0, 1.0, 2.0]), np.array([1.1, nan, nan, 2.0])
    roots = np.array([[1.1, nan], [1.0, 2.0], [nan, nan], [2.0, nan]])
    sd = np.array([[0.05, nan], [0.1, 0.1], [nan, nan], [nan, nan]])
    several = np.array([False, True, False, False])
    found = scores_of_roots(truth, single, several, roots, sd, np.ones_like(roots))
    assert (found.single, found.ambiguous, found.refused) == (0.5, 0.25, 0.25)
    assert found.median_error == pytest.approx(0.05)
    # the last has no interval; the first is two standard deviations off
    assert found.coverage == 0.5


def test_least_error_is_the_noise_over_the_slope() -> None:
    """Of one pulse with all but the range known, by differences, at each range."""
    scene = BY_NAME["Bare object"]
    ranges, noise = np.geomspace(scene.from_m, scene.to_m, 40), np.array(scene.sensor.noise.read)
    sizes = stats.norm.ppf(0.5 + 0.5 * (np.arange(200) + 0.5) / 200)

    def readings(r: float) -> np.ndarray:
        return np.array(object_readings(r, 14.9896229, None, 0.0769 * 0.0957, 0.0769, -0.123))

    slopes = [
        np.linalg.norm(
            (readings(r * 1.0001) - readings(r / 1.0001)) / (2 * math.log(1.0001)) / noise
        )
        for r in ranges
    ]
    expected = np.median(np.outer(1 / np.array(slopes), sizes))
    assert least_error(scene) == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
def test_light_errs_less_by_more_work() -> None:
    errors: dict[str, list[float]] = {}
    for row in light_rows(TINY):
        assert row.scores is not None
        assert row.scores.p95_error is not None
        errors.setdefault(row.method, []).append(row.scores.p95_error)
    fixed, facets = errors["fixed rules"], errors["facets"]
    # 2, 4, 8, 16 points a piece; the facets' sum jumps as their edges cross the plate's
    assert fixed[0] > 100 * fixed[1] > 1e4 * fixed[2] > 1e5 * fixed[3]
    assert max(errors["adaptive rules"]) < 1e-12
    assert facets[0] > 4 * facets[1] > 4 * facets[2]


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


def test_monte_carlo_errors_are_what_repeated_sets_scatter_by() -> None:
    """200 reports of 12 sets of 30 frames whose errors have half their variance in common.

    Each ratio of a mean standard error to the scatter has a standard deviation of 6 %, and the
    estimates lie low by some percent of few sets: 25 % is four of these.
    """
    rng = np.random.default_rng(5)
    sets = np.repeat(np.arange(12), 30)
    shared = rng.standard_normal((200, 12, 1)) + rng.standard_normal((200, 12, 30))
    every = np.abs(shared).reshape(200, -1)
    means = [error_of_mean(values, sets) or 0.0 for values in every]
    assert np.mean(means) == pytest.approx(every.mean(axis=1).std(), rel=0.25)
    medians = [error_of_quantile(values, 0.5, sets) or 0.0 for values in every]
    assert np.mean(medians) == pytest.approx(np.median(every, axis=1).std(), rel=0.25)
    # of 200 bands of 95 %, fewer than 180 hold the true share once in a thousand times
    true = stats.norm.cdf(2.0 / math.sqrt(2)) - stats.norm.cdf(-2.0 / math.sqrt(2))
    bands = [share_band((values < 2.0).astype(float), sets) for values in every]
    assert sum(low <= true <= high for low, high in filter(None, bands)) >= 180
    # of few sets each counts as one frame, and so it does where all sets agree
    assert share_band(np.ones(360), sets) == pytest.approx((0.025 ** (1 / 12), 1.0))
    assert share_band(np.full(3, np.nan), np.arange(3)) is None
    assert error_of_mean(np.ones(4), np.zeros(4, int)) is None
    # along a sweep what changes steadily is no chance: 4 sd of this estimate are 45 % of it, and
    # sets in no order would say seven times as much
    steady = np.linspace(0.0, 3.0, 4000) + rng.standard_normal(4000)
    off = error_of_mean(steady, blocks_of(4000), along=True)
    assert off == pytest.approx(1 / math.sqrt(4000), rel=0.45)


def test_time_left_is_told_by_kind_of_method() -> None:
    cells = [c for s in SCENES for c in cells_of(s, dataclasses.replace(TINY, draws=(10,)))]
    cheap = [cell for cell in cells if cell.family == "single"]
    dear = [cell for cell in cells if cell.family == "emcee"]
    pace = Pace()
    for cell in cheap[: len(cheap) // 2]:
        pace.learn(cell, 0.1 * cell.seconds)
    for cell in dear[: len(dear) // 2]:
        pace.learn(cell, 5.0 * cell.seconds)
    ahead = [*cheap[len(cheap) // 2 :], *dear[len(dear) // 2 :]]
    exact = 0.1 * sum(c.seconds for c in ahead if c.family == "single") + 5.0 * sum(
        c.seconds for c in ahead if c.family == "emcee"
    )
    assert 0.5 * exact < pace.left_s(ahead) < 1.5 * exact


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


MEASURED = ("Unknown crosstalk", "Through the fold")


@functools.cache
def measured() -> tuple[Row, ...]:
    scenes = [BY_NAME[name] for name in MEASURED]
    with tempfile.TemporaryDirectory() as folder:
        return tuple(rows_of(scenes, TINY, 1, Path(folder) / "part"))


def uncosted(rows: Sequence[Row]) -> list[Row]:
    """What depends on the seed alone."""
    return [dataclasses.replace(row, costs=Costs()) for row in rows]


def test_same_seed_same_errors_and_a_killed_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = measured()
    scenes = [BY_NAME[name] for name in MEASURED]
    first = list(itertools.islice(rows_of(scenes, TINY, 1, tmp_path / "part"), 9))
    with (tmp_path / "part").open("a") as file:
        file.write('{"key": "cut sh')
    counted: list[Cell] = []

    def counting(cell: Cell, seed: int) -> Row:
        counted.append(cell)
        return measure(cell, seed)

    monkeypatch.setattr(run_module, "measure", counting)
    said: list[str] = []
    again = list(rows_of(scenes, TINY, 1, tmp_path / "part", said.append))
    assert len(counted) == len(whole) - len(first)
    assert uncosted(again) == uncosted(whole)
    assert again[: len(first)] == first
    assert "goes on after 9 of" in said[0]
    # what other sources measured is not mixed with what these measure
    monkeypatch.setattr(run_module, "sources_digest", lambda: "others")
    counted.clear()
    said.clear()
    next(rows_of(scenes, TINY, 1, tmp_path / "part", said.append))
    assert len(counted) == 1
    assert said[0].startswith("begins anew: ")
    assert said[0].endswith("was measured with other sources")
    # another seed is another report
    counted.clear()
    next(rows_of(scenes, TINY, 2, tmp_path / "part"))
    assert len(counted) == 1
    for row in whole:
        assert row_from(json.loads(json.dumps(row.to_json(), allow_nan=False))) == row


def test_what_is_not_told_misleads() -> None:
    rows = [row for row in measured() if row.scene == "Unknown crosstalk"]
    by = {(row.method, row.told != ""): row for row in rows if row.scores is not None}
    blind = by["time of flight alone", True].scores
    # crosstalk of half the signal: no interval of the noise has room for it
    assert blind is not None
    assert blind.coverage is not None
    assert blind.coverage < 0.1
    for name in ("rates of change", "fit of everything", "tracker"):
        found = by[name, False].scores
        assert found is not None
        assert blind.median_error is not None
        assert found.median_error is not None
        assert found.median_error < 0.2 * blind.median_error
        assert found.coverage is not None
        assert blind.coverage is not None
        assert found.coverage > 0.5 > blind.coverage
    out = [row for row in rows if row.scores is None]
    assert out
    assert all(row.remark for row in out)
    for row in measured():
        assert not re.search(r"[a-z]\.[a-z]|_|\bemcee\b", row.remark), row.remark


@pytest.mark.slow
def test_a_posterior_is_scored_and_counted() -> None:
    effort = dataclasses.replace(TINY, draws=(10,))
    (cell,) = (c for c in cells_of(BY_NAME["Bare object"], effort) if c.family == "emcee")
    row = measure(cell, 3)
    assert row.remark == "verdict passed"
    assert row.likelihood_calls is not None
    assert row.likelihood_calls > 1000
    assert row.scores is not None
    # 40 frames whose errors go together: fewer than half happens once in a thousand sets
    assert row.scores.coverage is not None
    assert row.scores.coverage > 0.5
    assert row.costs.draws_per_s is not None
    assert row.costs.draws_per_s > 0
    assert row.costs.p50_s == row.costs.p99_s == row.costs.frame_s


def test_more_draws_of_a_posterior_are_a_curve_of_their_own() -> None:
    scores, costs = Scores(1e-4, 1e-3, 0.9, 1e-4, 1.0, 0.0, 0.0, median_se=2e-4), Costs(1.0)
    few = [(8, 400), (40, 400), (100, 400)]
    rows = [
        Row("x", "posterior", "posterior", order=order_of(*knobs), scores=scores, costs=costs)
        for knobs in [*few, (40, 6400)]
    ]
    report = Report(machine(), 1, tuple(rows), {"x": 1e-5}, 3e-10, (), Spent())
    (axes,) = draw_scene(report, "x").axes
    curves = [line for line in axes.lines if line.get_marker() == "o"]
    assert [np.size(curve.get_xdata()) for curve in curves] == [3, 2]
    assert {"posterior", "posterior, more draws"} <= {text.get_text() for text in axes.texts}


def test_error_against_noise_has_a_panel_a_kind_of_sensor() -> None:
    scores = Scores(1e-4, 1e-3, 0.9, 1e-4, 1.0, 0.0, 0.0, median_se=2e-4)
    ratios = {"Pulse": {"a": 10.0, "b": 100.0}, "Sine wave": {"c": 10.0, "d": 1e3}, "None": {}}
    names = [name for those in ratios.values() for name in those]
    rows = [
        Row(name, "brightness", "single frames", scores=scores, costs=Costs(1e-6)) for name in names
    ]
    report = Report(machine(), 1, tuple(rows), dict.fromkeys(names, 1e-5), 3e-10, (), Spent())
    drawn = draw_snr(report, ratios)
    assert drawn is not None
    assert [axes.get_title(loc="left") for axes in drawn.axes] == ["Pulse", "Sine wave"]
    assert draw_snr(report, {"Pulse": {"a": 10.0, "gone": 100.0}}) is None


def scored(
    method: str,
    family: str,
    error: float,
    band: tuple[float, float],
    frame_s: float,
    remark: str = "",
) -> Row:
    scores = Scores(error, error, sum(band) / 2, error, 1.0, 0.0, 0.0)
    scores = scores._replace(coverage_low=band[0], coverage_high=band[1], sets=10)
    costs = Costs(frame_s)
    return Row("x", method, family, knob="k", scores=scores, costs=costs, remark=remark)


def test_the_method_to_take_is_cheap_near_the_best_and_shown_to_be_honest() -> None:
    sure, wrong, few = (0.85, 0.95), (0.4, 0.6), (0.5, 0.99)
    rows = [
        scored("fast", "single frames", 1e-2, sure, 1e-8),
        scored("liar", "single frames", 1e-9, wrong, 1e-9),
        dataclasses.replace(scored("blind", "single frames", 1e-9, sure, 1e-9), told="nothing"),
        scored("good", "tracker", 1.9e-4, sure, 1e-6),
        scored("best", "many frames", 1e-4, sure, 1e-3, "told the object"),
        scored("hardly better", "many frames", 1e-4, few, 1e-9, "told the object"),
        scored("free", "posterior", 5e-7, few, 0.1),
    ]
    assert method_to_take(rows) == (
        "Object known: good, k (0.019 %, 1 us a frame). "
        "Object unknown: too few sets to tell of free, k (0.00005 %, 100 ms a frame)"
    )
    assert method_to_take(rows[1:3]) == ""


def test_shares_can_be_read() -> None:
    assert percent(0.0123) == "1.2 %"
    assert percent(4.2e-5) == "0.0042 %"
    assert percent(2e-16) == "below 0.0000001 %"
    assert percent(0.0) == "0 %"
    assert with_error(0.012345, 0.00067) == "1.234 ± 0.067 %"
    assert with_error(0.012345, None) == "1.2 %"


def test_settings_that_are_left_out_are_listed_with_their_reason() -> None:
    served = scored("posterior", "posterior", 1e-4, (0.9, 1.0), 1.0)
    refused = dataclasses.replace(served, knob="100 frames", scores=None, remark="too slow")
    other = dataclasses.replace(refused, method="brightness", remark="not immune")
    assert left_out([served, refused, other]) == {
        "posterior, 100 frames": "too slow",
        "brightness": "not immune",
    }


def test_intervals_are_put_together_by_sets_and_data_count_once() -> None:
    first = scored("fit", "many frames", 1e-4, (0.9, 1.0), 1.0)
    rows = [
        dataclasses.replace(first, knob="10 frames, 5 draws"),
        dataclasses.replace(first, knob="10 frames, 50 draws"),
        dataclasses.replace(first, knob="20 frames"),
        dataclasses.replace(first, told="nothing"),
        dataclasses.replace(first, scene="y, told that the model is exact"),
        scored("fit", "many frames", 1e-4, (0.3, 0.7), 1.0),
    ]
    (found,) = together(rows)
    assert (found.sets, found.scenes, found.misled) == (30, 1, ("x",))
    assert found.coverage == pytest.approx((2 * 0.95 + 0.5) / 3)
    assert stats.binom.cdf(24, 30, found.high) == pytest.approx(0.025, abs=1e-9)


def test_page(tmp_path: Path) -> None:
    rows = measured()
    scenes = [BY_NAME[name] for name in dict.fromkeys(row.scene for row in rows)]
    least = {scene.name: least_error(scene) for scene in scenes}
    terms = (TermCost("object alone", 3, 9000.0, 5e-6), TermCost("+ wall", 4, 9500.0, 6e-6))
    report = Report(machine(), 1, rows, least, 3e-10, terms, Spent())
    pictures = {name: svg(draw_scene(report, name)) for name in report.scenes}
    made = page(report, pictures, svg(draw_terms(terms)), None)
    # one file, and nothing from elsewhere
    assert "<script" not in made
    assert 'src="http' not in made
    assert "href" not in made
    assert made.count("data:image/svg+xml;base64,") == 3
    assert len(made) < 500_000
    for text in (made, markdown_page(report), *pictures.values()):
        for name in ALL_TECHNIQUES:
            assert "_" not in name or name not in text.split("base64", maxsplit=1)[0]
    # the figures of two sets, whose frames err together, are no verdict
    assert made.count('class="few"') > 0
    coloured = {line.split("<td>")[1] for line in made.split("<tr>") if 'class="bad"' in line[:600]}
    assert coloured
    assert not any("fit of everything" in name for name in coloured)
    for scene in report.scenes:
        assert f"<h2>{scene}</h2>" in made
        assert f"## {scene}" in markdown_page(report)
    for name in ("fit of everything", "tracker", "time of flight alone (misinformed)"):
        assert name in pictures["Unknown crosstalk"]
    assert "time of flight alone, which takes no notice, errs by" in made
    for text in (made, markdown_page(report)):
        assert "Unknown crosstalk: Object known: " in text
        assert "e-0" not in text.split("base64", maxsplit=1)[0]
    draw_summary(report, tmp_path / "report.png")
    assert (tmp_path / "report.png").read_bytes().startswith(b"\x89PNG")


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


@pytest.mark.slow
def test_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As its users run it, on one scene and few frames."""
    monkeypatch.setattr("service.report.cells.QUICK", TINY)
    monkeypatch.setattr("service.report.scenes.SCENES", (BY_NAME["Bare object"],))
    monkeypatch.setattr("service.report.run.term_costs", list)
    monkeypatch.setattr("service.report.light.light_rows", lambda _: [])
    monkeypatch.setattr("service.report.picture.draw_terms", lambda _: Figure())
    assert main(["report", "--quick", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "scene: Bare object" in said.out
    assert "tracker" in said.out
    assert "Bare object: measurement 1 of" in said.err
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"report.html", "report.md", "report.json", "report.png"}
    found = json.loads((tmp_path / "report.json").read_text())
    assert found["machine"]["numpy"] == np.__version__
    assert [row for row in found["rows"] if row["scores"] is None and not row["remark"]] == []
