"""No request gets a 500: whatever the body, the answer is 2xx or a 4xx that says what is wrong."""

import asyncio
import contextlib
import copy
import json
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inference.posterior import fold as real_fold
from inference.posterior.settings import SamplerSettings
from service.app import create_app
from service.service_settings import ServiceSettings
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor
from tests.service import fake_fold
from tests.service.conftest import FRAMES, JSON, SCENE, SENSOR
from tests.thorough import THOROUGH

ROUTES = ("/v1/estimates", "/v1/identifiability", "/v1/posteriors", "/v1/simulations")
SINE_WAVE = {
    "kind": "sine_wave",
    "frequency_hz": 5e6,
    "noise": {"read": [1e-6, 1e-6], "shot": 1e-9},
}
BODIES: tuple[dict[str, Any], ...] = (
    {"sensor": SENSOR, "scene": SCENE, "frames": FRAMES, "techniques": ["conventional"]},
    {
        "sensor": SENSOR | {"full_scale": [1.0, 2.0]},
        "scene": {
            "object": {"c0": 0.08, "c1": {"prior": "normal", "mean": 0.0, "sd": 0.1}},
            "crosstalk": [0.02, {"prior": "uniform", "low": 0.0, "high": 1.0}],
            "background": {"strength": 0.8, "distance_m": 3.0, "shadow": {"c0": 0.06, "c1": 0.01}},
            "range_m": {"prior": "loguniform", "low": 0.02, "high": 5.0},
            "motion": "tangential",
        },
        "frames": FRAMES | {"dw1_dt": [0.1, 0.2], "dw2_dt": [0.3, 0.4], "gain": [1.0, 2.0]},
    },
    {  # techniques of many frames
        "sensor": SENSOR | {"noise": {"read": [1e-6, 1e-6], "derivative": [1e-5, 1e-5]}},
        "scene": {
            "object": {"c0": 0.08, "c1": 0.0},
            "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.1}] * 2,
        },
        "frames": {
            "time_s": [0.0, 0.1, 0.2, 0.3],
            "w1": [0.0147, 0.0119, 0.0099, 0.0085],
            "w2": [0.441, 0.297, 0.212, 0.159],
            "dw1_dt": [-0.033, -0.024, -0.017, -0.012],
            "dw2_dt": [-1.76, -1.13, -0.67, -0.42],
        },
        "techniques": ["crosstalk_fit", "joint_fit", "iterative_differential", "object_fit"],
    },
    {
        "sensor": SINE_WAVE,
        "scene": SCENE | {"background": {"strength": 0.8, "distance_m": 3.0, "shadow": "object"}},
        "frames": {
            "time_s": [0.0, 0.1],
            "i": [0.1, 0.2],
            "q": [0.1, -0.2],
            "object_present": [True, False],
        },
    },
    {
        "sensor": SENSOR,
        "scene": SCENE,
        "trajectory": {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": 5, "spacing": "log"},
        "seed": 1,
    },
    {
        "sensor": SINE_WAVE,
        "scene": {},
        "trajectory": {
            "range_m": [0.5, 1.0],
            "time_s": [0.0, 1.0],
            "object_present": [True, False],
        },
        "seed": 2,
    },
    {
        "sensor": SENSOR,
        "scene": {
            "crosstalk": [0.0, {"prior": "normal", "mean": 0.0, "sd": 0.1}],
            "background": {
                "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
                "distance_m": {"prior": "uniform", "low": 2.0, "high": 8.0},
            },
            "range_m": {"prior": "stroke", "low": 0.1, "high": 3.0},
        },
        "ranges_m": [0.3, 0.6, 1.2, 1.0],
        "object_present": [True, True, True, False],
        "at": {"object.c0": 0.08, "background.distance_m": 3.0},
    },
)
EXTREMES = [0.0, -0.0, 1.0, -1.0, 1e-320, 1e-300, 1e-30, 1e-12, 1e12, 1e30, 1e300, 1.8e308, -1e308]
EXTREMES += [1e-50, -1e-50, 1e50, -1e50]  # the least and the largest that a scene may state
numbers = st.sampled_from(EXTREMES) | st.floats(allow_nan=True) | st.integers(-(2**70), 2**70)
scalars = st.none() | st.booleans() | numbers | st.text(max_size=8)
names = st.sampled_from(
    ["prior", "mean", "sd", "low", "high", "median", "sigma", "values", "optional", "shadow", "c0"]
) | st.text(max_size=5)
anything = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=4),
    max_leaves=12,
)


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    if isinstance(value, dict):
        for name, member in value.items():
            yield from places(member, (*path, name))
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from places(entry, (*path, index))


@st.composite
def spoiled(
    draw: st.DrawFn,
    replacements: st.SearchStrategy[Any],
    bodies: Sequence[dict[str, Any]] = BODIES,
) -> dict[str, Any]:
    """A good body in which one to three places are something else, are gone, or are new."""
    body: dict[str, Any] = copy.deepcopy(draw(st.sampled_from(bodies)))
    for _ in range(draw(st.integers(1, 3))):
        if not body:
            break
        path = draw(st.sampled_from([p for p in places(body) if p]))
        target: Any = body
        for part in path[:-1]:
            target = target[part]
        match draw(st.sampled_from(["replace", "replace", "remove", "add"])):
            case "replace":
                target[path[-1]] = draw(replacements)
            case "remove":
                del target[path[-1]]
            case _ if isinstance(target, dict):
                target[draw(names)] = draw(replacements)
    return body


def prepare(sensor: Sensor, scene: Scene, frames: Frames, settings: SamplerSettings) -> Any:
    """What the real posterior refuses is refused; what it would sample is not sampled here."""
    real_fold.prepare(sensor, scene, frames, settings)
    return fake_fold.prepare(sensor, Scene(), frames, settings)


@pytest.fixture(scope="module")
def loop() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


@contextlib.contextmanager
def answering(loop: asyncio.Runner, **more: Any) -> Iterator[httpx.AsyncClient]:
    """A client of an application that prepares posteriors, and samples none."""
    fake_fold.order()
    fold: Any = SimpleNamespace(**vars(fake_fold) | {"prepare": prepare})
    app = create_app(ServiceSettings(workers=1, max_jobs=100_000, **more), fold)
    lifespan = app.router.lifespan_context(app)
    loop.run(lifespan.__aenter__())
    # an exception that is not answered fails the test with its own traceback
    transport = httpx.ASGITransport(app)
    yield httpx.AsyncClient(transport=transport, base_url="http://localhost", headers=JSON)
    loop.run(lifespan.__aexit__(None, None, None))


@pytest.fixture(scope="module")
def http(
    loop: asyncio.Runner, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[httpx.AsyncClient]:
    database = f"sqlite:///{tmp_path_factory.mktemp('jobs')}/jobs.sqlite"
    with answering(loop, database=database) as client:
        yield client


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} was sent")


def check(response: httpx.Response) -> None:
    assert response.status_code < 500, response.text
    body = json.loads(response.text, parse_constant=no_constant)
    if response.status_code >= 400:
        assert response.headers["content-type"] == "application/problem+json"
        assert body["status"] == response.status_code
        assert body["detail"]
    else:
        assert response.status_code in {200, 201, 202}
        for result in body.get("results", []):
            for frame in result["frames"]:
                assert (frame["range_m"] is not None) == (frame["status"] == "unique")
                assert frame["roots_m"] == sorted(frame["roots_m"])


# each is sent to every route; `make fuzz` sends thousands
relaxed = settings(
    deadline=None,
    max_examples=150 if THOROUGH else 60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def send(loop: asyncio.Runner, http: httpx.AsyncClient, content: bytes) -> None:
    for route in ROUTES:
        check(loop.run(http.post(route, content=content)))


@relaxed
@given(body=anything)
def test_any_json(loop: asyncio.Runner, http: httpx.AsyncClient, body: Any) -> None:
    send(loop, http, json.dumps(body).encode())


@relaxed
@given(
    content=st.binary(max_size=60)
    | st.text(max_size=60).map(lambda t: t.encode("utf-8", "surrogatepass"))
)
def test_any_bytes(loop: asyncio.Runner, http: httpx.AsyncClient, content: bytes) -> None:
    send(loop, http, content)


@relaxed
@given(body=spoiled(anything))
def test_spoiled(loop: asyncio.Runner, http: httpx.AsyncClient, body: dict[str, Any]) -> None:
    send(loop, http, json.dumps(body).encode())


@relaxed
@given(body=spoiled(numbers))
def test_extreme_numbers(
    loop: asyncio.Runner, http: httpx.AsyncClient, body: dict[str, Any]
) -> None:
    send(loop, http, json.dumps(body).encode())


def test_streams_and_models(loop: asyncio.Runner, http: httpx.AsyncClient) -> None:
    """A few of the nearly valid bodies that `make fuzz` sends by the thousand."""
    from benchmarks.fuzz.nearly_valid import LIMIT_S, nearly_valid, targets

    rest = [target for target in targets() if target.path not in ROUTES]
    assert len(rest) == 7
    assert all(nearly_valid(target, 5, loop, http).slowest_s < LIMIT_S for target in rest)
