"""The report: what it measures and keeps, its pictures and its page."""

import dataclasses
import functools
import itertools
import json
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import service.report.run as run_module
from inference.techniques import ALL_TECHNIQUES
from service.cli import main
from service.report.cells import Cell, Effort, cells_of
from service.report.floors import least_error
from service.report.light import light_rows
from service.report.measure import measure
from service.report.pace import Pace, Spent
from service.report.page import markdown_page, page
from service.report.picture import draw_scene, draw_snr, draw_summary, draw_terms, svg
from service.report.row import Costs, Row, order_of, row_from
from service.report.run import Report, machine
from service.report.scenes import SCENES, ReportScene
from service.report.scores import Scores
from service.report.terms import TermCost
from simulator.compiled import compiling_at_once
from tests.service.reporting import BY_NAME, TINY


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
    scenes = [BY_NAME[MEASURED[1]]]
    whole = [row for row in measured() if row.scene == MEASURED[1]]
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
    # told the prior of the crosstalk it is as wide as that leaves it open
    honest = by["time of flight alone", False].scores
    assert honest is not None
    assert honest.coverage is not None
    assert honest.coverage > 0.5
    blind = by["brightness of the late window", True].scores
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
    for name in ("fit of everything", "tracker", "brightness of the late window (misinformed)"):
        assert name in pictures["Unknown crosstalk"]
    assert "brightness of the late window, which takes no notice, errs by" in made
    for text in (made, markdown_page(report)):
        assert "Unknown crosstalk: Object known: " in text
        assert "e-0" not in text.split("base64", maxsplit=1)[0]
    draw_summary(report, tmp_path / "report.png")
    assert (tmp_path / "report.png").read_bytes().startswith(b"\x89PNG")


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
