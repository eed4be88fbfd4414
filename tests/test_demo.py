"""The demo as its users run it."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.demo.answers import Answer, Episode, Point, of_estimates, of_posterior
from service.demo.episodes import nearest
from service.demo.running import Client, running_service
from service.demo.table import table

ROOT = Path(__file__).parents[1]
RECORDINGS_HERE = (ROOT.parent / "shared/data/tmf8820_plane.json").exists()  # the default
SIGNATURE = b"\x89PNG\r\n\x1a\n"


@pytest.mark.slow
def test_demo(tmp_path: Path) -> None:
    """In a process of its own: it starts the real service on an unused port."""
    command = [sys.executable, "-m", "service.cli", "demo", "--out", str(tmp_path / "new" / "out")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    for word in ("90 % interval", "unique", "ambiguous", "differential", "posterior (converged"):
        assert word in done.stdout
    assert ("recorded" in done.stdout) == RECORDINGS_HERE
    assert (tmp_path / "new" / "out" / "demo.png").read_bytes().startswith(SIGNATURE)


@pytest.mark.thorough
@pytest.mark.skipif(not RECORDINGS_HERE, reason="no recorded photons: the whole demo is without")
def test_without_recordings_a_plate_is_simulated(tmp_path: Path) -> None:
    """The one scene of the demo that recordings change."""
    with running_service() as address, httpx.Client(base_url=address, timeout=None) as http:  # noqa: S113
        episode = nearest(Client(http), tmp_path / "none.json")
    assert (episode.title, episode.source) == ("A plate of unknown size", "simulated")
    text = table([episode])
    for word in ("90 % interval", "unique", "posterior (converged"):
        assert word in text


def test_estimates_and_posteriors_as_answers() -> None:
    frames: list[dict[str, Any]] = [
        {"status": "unique", "range_m": 1.0, "sd_m": 0.1, "roots_m": [1.0]},
        {"status": "ambiguous", "range_m": None, "sd_m": None, "roots_m": [1.0, 2.0]},
        {"status": "none", "range_m": None, "sd_m": None, "roots_m": []},
    ]
    unique, ambiguous, none = of_estimates("conventional", [1.0, 1.5, 2.0], frames).points
    # 90 % of a normal law lie within 1.645 standard deviations
    assert unique.low_m == pytest.approx(0.83551, abs=1e-5)
    assert unique.high_m == pytest.approx(1.16449, abs=1e-5)
    assert ambiguous.roots == ((1.0, 0.5), (2.0, 0.5))
    assert math.isnan(ambiguous.range_m)
    assert none.roots == ()
    posterior = {
        "range_m": {
            "q05": [0.9, 0.9, None],
            "q50": [1.0, 1.0, None],
            "q95": [2.1, 1.1, None],
            "near_fold": [False, True, False],
            "modes": [
                [{"range_m": 1.0, "weight": 0.7}, {"range_m": 2.0, "weight": 0.3}],
                [{"range_m": 1.0, "weight": 1.0}],
                [],
            ],
        },
        "verdict": {"converged": False, "reasons": ["too few steps"]},
        "fit": {"misfit": True, "reasons": ["the worst frame"]},
        "identifiability": [{"parameter": "range_m", "status": "not_identified"}],
        "runtime": {"wall_s": 1.0},
    }
    answer = of_posterior("posterior", [1.0, 1.0, 1.0], posterior)
    assert [point.status for point in answer.points] == ["ambiguous", "near fold", "none"]
    assert math.isnan(answer.points[2].low_m)
    assert answer.misfit
    for word in ("too few steps", "MISFIT", "the worst frame", "range_m is not identified"):
        assert word in answer.remark


def test_table() -> None:
    nan = math.nan
    points = (
        Point(1.0, 1.01, 0.99, 1.03, "unique", ((1.01, 1.0),)),
        Point(1.5, nan, nan, nan, "ambiguous", ((1.4, 0.5), (2.0, 0.5))),
        Point(2.0, 1.9, 1.3, 2.1, "ambiguous", ((1.4, 0.25), (2.0, 0.75))),
        Point(2.5, nan, nan, nan, "none", ()),
    )
    text = table([Episode("A scene", "simulated", (Answer("posterior", points, "a remark"),))])
    rows = [line.split() for line in text.splitlines() if line.strip()[:2] in ("1.", "2.")]
    assert rows[0] == ["1.0000", "1.0100", "0.9900", "to", "1.0300", "unique"]
    assert rows[1] == ["1.5000", "-", "-", "ambiguous", "1.4000,", "2.0000"]
    # one number for two answers would be none of them
    assert rows[2][1] == "-"
    assert rows[2][-4:] == ["1.4000", "(25%),", "2.0000", "(75%)"]
    assert rows[3] == ["2.5000", "-", "-", "none"]
    assert "a remark" in text
