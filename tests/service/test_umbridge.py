"""UM-Bridge 1.0: densities against those that posteriors use, errors in the protocol's own form."""

import asyncio
import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from inference.posterior.job import prepare
from inference.posterior.settings import SamplerSettings
from service import umbridge
from service.app import create_app
from service.service_settings import ServiceSettings
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service.conftest import listening, speaking, told

CONFIG: dict[str, Any] = {
    "sensor": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-4, 2e-4]}},
    "scene": {
        "object": {"c0": 0.08, "c1": 0.01},
        "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1e-3}, 0.0],
    },
    "frames": {"w1": [0.0242, 0.012, 0.006], "w2": [0.423, 0.1, 0.03]},
}
POINTS = np.random.default_rng(4).normal(size=(5, 2))


def asked(operation: str, **members: Any) -> tuple[int, Any]:
    status, body = umbridge.answer(operation, json.dumps(members).encode())
    return status, json.loads(body)


def evaluated(name: str, point: Any, **config: Any) -> tuple[int, Any]:
    return asked("Evaluate", name=name, input=[list(point)], config=CONFIG | config)


def test_densities_are_those_of_posteriors() -> None:
    sensor, scene = parse_sensor(CONFIG["sensor"]), parse_scene(CONFIG["scene"])
    frames = frames_from_columns(sensor, CONFIG["frames"])
    density = prepare(sensor, scene, frames, SamplerSettings(seed=1)).density()
    sizes = {"log_posterior": 1, "log_likelihood": 1, "parameters": 2}
    for name, size in sizes.items():
        assert asked("InputSizes", name=name, config=CONFIG) == (200, {"inputSizes": [2]})
        assert asked("OutputSizes", name=name, config=CONFIG) == (200, {"outputSizes": [size]})
    assert density.parameters.names == ("object.c2", "crosstalk.w1")
    for z in POINTS:
        assert evaluated("log_posterior", z)[1]["output"] == [density(z[None]).tolist()]
        status, said = evaluated("parameters", z)
        natural = density.parameters.natural(z[None])[0]
        assert (status, said["output"]) == (200, [natural.tolist()])
        (found,) = evaluated("log_likelihood", natural)[1]["output"]
        # to what there and back rounds, which the slope magnifies
        np.testing.assert_allclose(found, density.log_likelihood(z[None]), rtol=1e-9)


def test_no_light_has_the_value_that_is_stated() -> None:
    dark = [-1.0, 0.0]  # a negative reflectance
    assert evaluated("log_likelihood", dark)[0] == 400
    assert evaluated("log_likelihood", dark)[1]["error"]["type"] == "InvalidOutput"
    assert evaluated("log_likelihood", dark, nonfinite=-1e9)[1] == {"output": [[-1e9]]}
    said = evaluated("log_likelihood", dark, nonfinite="-Infinity")[1]
    assert said == {"output": [[-np.inf]]}


@pytest.mark.parametrize(
    ("operation", "members", "kind", "told"),
    [
        ("Evaluate", {}, "ModelNotFound", "log_posterior"),
        ("Evaluate", {"name": "other"}, "ModelNotFound", "log_posterior"),
        ("ModelInfo", {"name": 3}, "ModelNotFound", "log_posterior"),
        ("InputSizes", {"name": "parameters"}, "InvalidInput", "/config/sensor: "),
        ("InputSizes", {"name": "parameters", "config": 3}, "InvalidInput", "/config: "),
        ("Evaluate", {"name": "parameters", "config": CONFIG}, "InvalidInput", "/input: "),
        *(
            ("Evaluate", {"name": "parameters", "config": CONFIG, "input": point}, kind, told)
            for point, kind, told in (
                ([[1.0]], "InvalidInput", "/input/0: must have 2 numbers, has 1"),
                ([[1.0, True]], "InvalidInput", "/input/0/1: "),
                ([[1.0, float("nan")]], "InvalidInput", "/input/0/1: "),
                ([[1e300, 0.0]], "InvalidOutput", "not finite"),
            )
        ),
        ("ModelInfo", {"name": "parameters", "more": 1}, "InvalidInput", "/more: "),
    ],
)
def test_errors(operation: str, members: dict[str, Any], kind: str, told: str) -> None:
    status, said = asked(operation, **members)
    assert status == 400
    assert said["error"].keys() == {"type", "message"}
    assert said["error"]["type"] == kind
    assert told in said["error"]["message"]


def test_faults_of_a_config_are_named() -> None:
    for place, value, message in (
        (("frames", "w1"), [1.0], "/config/frames/"),
        (("scene", "crosstalk"), 3, "/config/scene/crosstalk"),
        (("scene", "motion"), "tangential", "amplitude"),
        (("sampler",), {}, "/config/sampler"),
    ):
        config = copy.deepcopy(CONFIG)
        here = config
        for name in place[:-1]:
            here = here[name]
        here[place[-1]] = value
        status, said = asked("InputSizes", name="log_posterior", config=config)
        assert (status, said["error"]["type"]) == (400, "InvalidInput")
        assert message in said["error"]["message"]
    status, body = umbridge.answer("Evaluate", b"{")
    assert (status, json.loads(body)["error"]["type"]) == (400, "InvalidInput")


def called(address: str) -> tuple[list[float], str]:
    """Ask as the protocol's own client does."""
    client = pytest.importorskip("umbridge", reason="the package umbridge is not installed")
    root = f"http://{address}/umbridge"
    assert client.supported_models(root) == ["log_posterior", "log_likelihood", "parameters"]
    model = client.HTTPModel(root, "log_posterior")
    assert model.supports_evaluate()
    assert not model.supports_gradient()
    assert model.get_input_sizes(CONFIG) == [2]
    assert model.get_output_sizes(CONFIG) == [1]
    with pytest.raises(Exception, match="InvalidInput: /input/0: must have 2 numbers") as refused:
        model([[0.0]], CONFIG)
    return [model([point.tolist()], CONFIG)[0][0] for point in POINTS], str(refused.value)


@pytest.mark.anyio
async def test_over_http(tmp_path: Path) -> None:
    limits = ServiceSettings(database=f"sqlite:///{tmp_path}/jobs.sqlite", threads=1)
    async with (
        listening(create_app(limits)) as address,
        speaking(f"http://{address}/umbridge") as http,
    ):
        assert (await http.get("/Info")).json()["protocolVersion"] == 1.0
        for name in umbridge.UNSUPPORTED:
            bare = await http.post(f"/{name}")  # whatever is sent with it
            assert (bare.status_code, bare.json()["error"]["type"]) == (400, "UnsupportedFeature")
        body = json.dumps({"name": "log_posterior"}).encode()
        # as C++ does: without a word of what it is
        head = (f"Host: {address}", f"Content-Length: {len(body)}")
        status, _, said = await told(address, "POST /umbridge/ModelInfo HTTP/1.1", *head, body=body)
        assert (status, json.loads(said)["support"]["Evaluate"]) == (200, True)
        strange = await http.post(
            "/ModelInfo", content=body, headers={"Origin": "https://example.com"}
        )
        assert strange.status_code == 403
        values, _ = await asyncio.to_thread(called, address)
    assert values == [evaluated("log_posterior", point)[1]["output"][0][0] for point in POINTS]
