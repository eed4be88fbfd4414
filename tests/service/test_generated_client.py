"""What OpenAPI says is enough to talk to the service: a client made from it does, and examples."""

import asyncio
import importlib
import json
import subprocess
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import httpx
import jsonschema
import pytest

from service.app import create_app
from service.examples import EXAMPLES
from service.service_settings import ServiceSettings
from tests.service.conftest import listening

pytestmark = pytest.mark.anyio

_FINISHED = {"done", "failed", "cancelled"}


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    database = f"sqlite:///{tmp_path_factory.mktemp('jobs')}/jobs.sqlite"
    return create_app(ServiceSettings(workers=1, database=database)).openapi()


@pytest.fixture(scope="module")
def made(document: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Import modules of a client that openapi-python-client makes of the document."""
    folder = tmp_path_factory.mktemp("client")
    (folder / "openapi.json").write_text(json.dumps(document))
    # what it would run afterwards only makes the code pretty
    (folder / "config.yaml").write_text("post_hooks: []\n")
    command = (sys.executable, "-m", "openapi_python_client", "generate", "--meta", "none")
    paths = ("--path", "openapi.json", "--config", "config.yaml", "--output-path", "made_client")
    told = subprocess.run(
        (*command, *paths),
        cwd=folder,
        check=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ).stdout
    # draws and frames of streams are no JSON documents, and are left to the user
    assert told.count("WARNING") == 2, told
    assert "Unsupported content type application/x-ndjson" in told
    assert "Unsupported content_type application/x-netcdf" in told
    sys.path.insert(0, str(folder))

    def module(name: str) -> ModuleType:
        return importlib.import_module(f"made_client{name}")

    yield module
    sys.path.remove(str(folder))


@pytest.mark.thorough
async def test_a_generated_client_talks_to_the_service(made: Any) -> None:
    models: Any = made(".models")
    sensor = models.PulsedSensor(
        kind="pulsed", pulse_width_s=1e-7, noise=models.Noise(read=[1e-4, 1e-4])
    )
    scene = models.Scene(object_=models.ObjectTerm(c0=0.0769, c1=-0.123, c2=0.1))
    frames = models.FrameColumns(w1=[0.01, 0.02], w2=[1.5, 1.7])
    app = create_app(ServiceSettings(workers=1))
    async with (
        listening(app) as address,
        made(".client").Client(base_url=f"http://{address}") as client,
    ):
        estimates: Any = made(".api.estimates.estimates_create")
        body = models.EstimateRequest(sensor=sensor, scene=scene, frames=frames)
        rows = await estimates.asyncio(client=client, body=body)
        assert rows.chosen == "conventional"
        ranges = [frame.range_m for frame in rows.results[0].frames]
        assert ranges == pytest.approx([0.01 / 1.5 * 14.9896229, 0.02 / 1.7 * 14.9896229])
        shape = models.EstimatesCreateShape.COLUMNS
        columns = await estimates.asyncio(client=client, body=body, shape=shape)
        assert columns.results[0].frames.range_m == ranges

        posteriors = ".api.posteriors.posteriors_"
        crosstalk = models.Normal(prior="normal", mean=0.0, sd=0.1)
        asked = models.PosteriorRequest(
            sensor=sensor,
            scene=models.Scene(
                object_=models.ObjectTerm(c0=0.0769, c1=-0.123, c2=0.1), crosstalk=[crosstalk, 0.0]
            ),
            frames=frames,
            sampler=models.SamplerSettings(
                method=models.SamplerSettingsMethod.IMPORTANCE, max_seconds=5.0, seed=3
            ),
        )
        begun = await made(posteriors + "create").asyncio(client=client, body=asked)
        while True:
            found = await made(posteriors + "get").asyncio(begun.id, client=client)
            if found.status in _FINISHED:
                break
            await asyncio.sleep(0.05)
        assert (found.status, found.seed) == ("done", 3)
        assert found.parameters["crosstalk.w1"].q50 is not None
        refused = await made(posteriors + "get").asyncio("nothing", client=client)
        assert isinstance(refused, models.ProblemDetails)
        assert refused.status == 404


def bodies(document: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    for path, operations in document["paths"].items():
        for operation in operations.values():
            # frames of a stream come a line each
            if "application/json" in operation.get("requestBody", {}).get("content", {}):
                content = operation["requestBody"]["content"]["application/json"]
                yield path, content["schema"], content["examples"]


async def test_examples_are_answered(document: dict[str, Any], client: httpx.AsyncClient) -> None:
    count = 0
    for path, schema, examples in bodies(document):
        whole = schema | {"components": document["components"]}
        for example in examples.values():
            jsonschema.Draft202012Validator(whole).validate(example["value"])
            answer = await client.post(path, json=example["value"])
            assert answer.status_code in (200, 201, 202), answer.text
            count += 1
    assert count == sum(map(len, EXAMPLES.values()))


async def test_the_document_says_what_has_to_be_sent(
    document: dict[str, Any], client: httpx.AsyncClient
) -> None:
    """Tags of unions, links from a posterior to all that is known of it, and patterns."""
    schemas = document["components"]["schemas"]
    for name in ("PulsedSensor", "SineWaveSensor"):
        assert "kind" in schemas[name]["required"]
    for name in ("Normal", "Uniform", "LogUniform", "LogNormal", "HalfNormal", "TruncatedNormal"):
        assert "prior" in schemas[name]["required"]
    for name in ("Stroke", "Reference"):
        assert "prior" in schemas[name]["required"]
    (example,) = document["paths"]["/v1/posteriors"]["post"]["requestBody"]["content"][
        "application/json"
    ]["examples"].values()
    asked = await client.post("/v1/posteriors", json=example["value"])
    made = document["paths"]["/v1/posteriors"]["post"]["responses"]["202"]
    assert made["headers"].keys() == {"Location"}
    ways = {
        operation["operationId"]: (path, method)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
        if "{job_id}" in path
    }
    assert made["links"].keys() == ways.keys()
    assert asked.headers["location"] == f"/v1/posteriors/{asked.json()['id']}"
    patterns = {
        parameter["name"]: parameter["schema"]["pattern"]
        for operation in document["paths"]["/v1/posteriors"].values()
        for parameter in operation.get("parameters", ())
        if "pattern" in parameter["schema"]
    }
    assert patterns.keys() == {"idempotency-key", "cursor"}
    for bad in ("", "x", "1" * 19):
        answer = await client.get("/v1/posteriors", params={"cursor": bad})
        assert answer.status_code == 400
        assert not jsonschema.Draft202012Validator({"pattern": patterns["cursor"]}).is_valid(bad)
