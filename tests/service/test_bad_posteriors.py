"""Posteriors that are refused: as problem documents over HTTP, as messages on the command line."""

import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.app import create_app
from service.cli import main
from service.service_settings import ServiceSettings
from tests.service.conftest import SENSOR

FRAMES = {"w1": [0.01, 0.02, 0.03], "w2": [0.5, 0.6, 0.7]}
Body = dict[str, Any]


def body(scene: Body, frames: Body | None = None, sensor: Body | None = None) -> Body:
    return {"sensor": SENSOR | (sensor or {}), "scene": scene, "frames": FRAMES | (frames or {})}


BROKEN: dict[str, tuple[Body, str]] = {
    "a prior that physics excludes": (
        body({"object": {"c2": {"prior": "uniform", "low": -2.0, "high": -1.0}}}),
        "/scene/object/c2",
    ),
    "an improper prior": (
        body({"object": {"c2": {"prior": "loguniform", "low": 0.0, "high": 1.0}}}),
        "/scene/object/c2/low",
    ),
    "a range prior beyond the sensor": (
        body({"range_m": {"prior": "uniform", "low": 100.0, "high": 200.0}}),
        "/scene/range_m",
    ),
    "no frame": (body({}, {"w1": [], "w2": []}), "/frames/w1"),
    "columns of two lengths": (body({}, {"w1": [0.1]}), "/frames/w2"),
    "a gain of zero": (body({}, {"gain": [1.0, 0.0, 1.0]}), "/frames/gain/1"),
}
REFUSED: dict[str, tuple[Body, str]] = {
    "tangential motion": (body({"motion": "tangential"}), "differential"),
    "all saturated": (body({}, sensor={"full_scale": [1e-3, 1e-3]}), "lower the gain"),
    "empty frames that teach nothing": (
        body({}, {"object_present": [False] * 3}),
        "object_present",
    ),
    "priors that exclude one another": (
        body(
            {
                "object": {
                    "c0": {"prior": "lognormal", "median": 1e-12, "sigma": 0.1},
                    "c1": {"prior": "normal", "mean": -1.0, "sd": 0.1},
                }
            }
        ),
        "bring them into agreement",
    ),
    "too many frames": (
        body({"motion": "static"}, {"w1": [0.01] * 2001, "w2": [0.5] * 2001}),
        "send means of 2 frames each",
    ),
}


@pytest.mark.anyio
async def test_over_http() -> None:
    app = create_app(ServiceSettings(workers=1))
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://localhost"
        ) as client,
    ):
        for name, (request, pointer) in BROKEN.items():
            response = await client.post("/v1/posteriors", json=request)
            assert response.status_code == 422, name
            assert response.headers["content-type"] == "application/problem+json"
            pointers = [error["pointer"] for error in response.json()["errors"]]
            assert any(found.startswith(pointer) for found in pointers), (name, pointers)
        for name, (request, remedy) in REFUSED.items():
            response = await client.post("/v1/posteriors", json=request)
            assert response.status_code == 422, name
            assert response.headers["content-type"] == "application/problem+json"
            assert remedy in response.json()["detail"], name
        # nothing was started
        assert (await client.get("/v1/posteriors")).json()["items"] == []


@pytest.mark.parametrize("name", [*BROKEN, *REFUSED])
def test_on_the_command_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    request, words = (BROKEN | REFUSED)[name]
    scene, frames = tmp_path / "scene.json", tmp_path / "frames.json"
    scene.write_text(json.dumps({key: request[key] for key in ("sensor", "scene")}))
    frames.write_text(json.dumps(request["frames"]))
    code = main(["infer", str(frames), "--scene", str(scene)])
    out, err = capsys.readouterr()
    assert code in (2, 3)
    assert out == ""
    assert "Traceback" not in err
    wanted = words.removeprefix("/scene").removeprefix("/frames") if name in BROKEN else words
    assert wanted in err
