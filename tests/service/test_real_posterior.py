"""The real posterior through the service: its shape, and what survives a kill."""

import asyncio
import io
import os
import signal
from pathlib import Path
from typing import Any

import h5netcdf
import httpx
import pytest

from inference.posterior import fold
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.answers.posteriors import PosteriorResponse
from service.answers.simulations import simulation_of
from service.app import create_app
from service.jobs import Jobs
from service.process_pool import ProcessPool
from service.requests import PosteriorRequest, SimulationRequest
from service.service_settings import ServiceSettings
from service.store.job_store import JobStore
from service.store.retention import Retention
from simulator.frames import frames_from_columns
from simulator.validated import parse
from tests.service.conftest import SENSOR

# machine code may have to be made first, in every worker
pytestmark = [pytest.mark.anyio, pytest.mark.slow]


FRAMES = 12


def request_body() -> dict[str, Any]:
    """Frames of an object of unknown parameters before known crosstalk."""
    system = {
        "sensor": SENSOR | {"noise": {"read": [1e-4, 1e-4]}},
        "scene": {"crosstalk": [0.01, 0.02]},
    }
    known = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}, "crosstalk": [0.01, 0.02]}
    trajectory = {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": FRAMES, "spacing": "log"}
    simulated = simulation_of(
        parse(SimulationRequest, system | {"scene": known, "trajectory": trajectory, "seed": 1})
    )
    sampler = {"method": "emcee", "seed": 2, "max_seconds": 86_400.0, "target_ess": 100}
    return system | {"frames": simulated["frames"], "sampler": sampler}


async def test_over_http() -> None:
    app = create_app(ServiceSettings(workers=1))
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost") as client,
    ):
        response = await client.post("/v1/posteriors", json=request_body())
        assert response.status_code == 202, response.text
        location = response.headers["location"]
        while (body := (await client.get(location)).json())["status"] in {"queued", "running"}:
            await asyncio.sleep(0.2)
        netcdf = (await client.get(location + "/draws")).content
        calibrated = (await client.get(location + "/scene")).json()
        others = (await client.get(location + "/scene", params={"other_objects": True})).json()
        odd = await client.get(location + "/scene", params={"other_objects": "some"})
        asked = calibrated | {"ranges_m": [0.5, 1.0]}
        foreseen = await client.post("/v1/identifiability", json=asked)
        other = asked | {"sensor": SENSOR | {"pulse_width_s": 2e-7}}
        refused = await client.post("/v1/identifiability", json=other)
    with h5netcdf.File(io.BytesIO(netcdf), "r") as file:
        drawn = file["posterior"]["object.c0"][...].ravel()
        assert file["posterior_predictive"]["range_m"].shape[2] == FRAMES
    # made anew from the checkpoint: the draws that the summary is of
    assert body["parameters"]["object.c0"]["mean"] == pytest.approx(drawn.mean(), rel=1e-12)
    assert body["status"] == "done", body
    # known beforehand what the posterior has told: its interval is the law's
    law = calibrated["scene"]["calibration"]["unknowns"][0]
    assert law["mean"] == pytest.approx(drawn.mean(), rel=1e-12)
    assert calibrated["scene"]["joint"]["unknowns"] == list(body["parameters"])
    # of a scene in which all else is known, nothing is left to other objects
    assert "joint" not in others["scene"]
    assert others["scene"]["crosstalk"] == [0.01, 0.02]
    assert odd.status_code == 422
    assert foreseen.status_code == 200, foreseen.text
    bound = foreseen.json()["parameters"]["object.c0"]
    assert bound["value"] == pytest.approx(law["mean"], abs=law["sd"])
    assert bound["posterior_sd"] < 1.1 * law["sd"]
    assert refused.json()["errors"][0]["pointer"] == "/scene/calibration/sensor"
    assert body["seed"] == 2
    answer = PosteriorResponse.model_validate(body)
    # what OpenAPI says is what is sent, no more and no less
    assert answer.model_dump(exclude={"problem"}) == body
    assert body["verdict"]["converged"], body["verdict"]
    assert body["parameters"].keys() == {"object.c0", "object.c1", "object.c2"}
    for name in ("q05", "q50", "q95", "mean", "sd", "modes"):
        assert len(body["range_m"][name]) == FRAMES


async def test_refusal_over_http() -> None:
    app = create_app(ServiceSettings(workers=1))
    transport = httpx.ASGITransport(app)
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(transport=transport, base_url="http://localhost") as client,
    ):
        body = request_body()
        body["sensor"]["full_scale"] = [1e-9, 1e-9]
        response = await client.post("/v1/posteriors", json=body)
    assert response.status_code == 422
    assert response.json()["type"] == "urn:hybridtof:problem:refused"


@pytest.mark.thorough
async def test_killed_workers_change_nothing(tmp_path: Path) -> None:
    """The answer is that of one call in a process that nobody disturbs."""
    request = parse(PosteriorRequest, request_body())
    frames = frames_from_columns(request.sensor, request.frames)
    settings = SamplerSettings(
        method="emcee", seed=2, ensembles=2, target_ess=2_000, max_seconds=86_400
    )
    pool = ProcessPool(2)
    store = JobStore(f"sqlite:///{tmp_path}/jobs.sqlite", Retention(1))
    jobs = Jobs(fold, store, pool, running=1)
    await jobs.start()
    try:
        record = await jobs.submit(request.sensor, request.scene, frames, settings)
        killed, phases = 0, set()
        async for now in jobs.follow(record.id):
            record = now
            phases.add(now.progress["phase"])
            if killed < 2 and now.progress["steps"] > 0:
                os.kill(pool.pids[0], signal.SIGKILL)
                killed += 1
        assert killed == 2
    finally:
        await jobs.close()
    assert {"queued", "starting", "sampling", "summarising"} <= phases
    assert record.result is not None
    del record.result["runtime"]
    undisturbed = infer(request.sensor, request.scene, frames, settings).to_json()
    del undisturbed["runtime"]
    assert record.result == undisturbed
