"""``POST /v1/identifiability`` over ASGI, and the command of the same name."""

import copy
import json
from pathlib import Path
from typing import Any

import httpx
import pytest

from service.answers.identifiability import IdentifiabilityResponse
from service.cli import main
from tests.service.conftest import SENSOR
from tests.service.problem_answers import assert_problem, changed

BODY: dict[str, Any] = {
    "sensor": SENSOR,
    "scene": {
        "background": {
            "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
            "distance_m": {"prior": "uniform", "low": 2.0, "high": 8.0},
            "shadow": "object",
        },
        "range_m": {"prior": "stroke", "low": 0.1, "high": 3.0},
    },
    "ranges_m": [0.3, 0.4, 0.6, 0.8, 1.2, 1.6, 2, 1.0],
    "object_present": [True] * 7 + [False],
    "at": {"object.c0": 0.08, "background.distance_m": 3.0},
}
UNKNOWNS = [
    *(f"object.c{k}" for k in range(3)),
    "background.strength",
    "background.distance_m",
    "range_m.centre",
    "range_m.spread",
]


@pytest.fixture
def body() -> dict[str, Any]:
    return copy.deepcopy(BODY)


@pytest.mark.anyio
async def test_shape(client: httpx.AsyncClient, body: dict[str, Any]) -> None:
    response = await client.post("/v1/identifiability", json=body)
    assert response.status_code == 200, response.text
    found = response.json()
    assert IdentifiabilityResponse.model_validate(found).model_dump() == found
    assert (found["rank"], found["unknowns"]) == (5, 5)
    assert (found["distinct_ranges"], found["needed_ranges"]) == (7, 3)  # R and B from one frame
    assert len(found["singular_values"]) == 5
    assert [row["parameter"] for row in found["identifiability"]] == [*UNKNOWNS, "range_m"]
    assert list(found["parameters"]) == UNKNOWNS
    assert found["parameters"]["object.c0"]["value"] == pytest.approx(0.08)
    for name, bound in found["parameters"].items():
        of_the_prior = name.startswith("range_m.")
        assert (bound["cramer_rao_sd"] is None) == of_the_prior
        assert bound["posterior_sd"] > 0
        if not of_the_prior:
            assert bound["posterior_sd"] <= bound["cramer_rao_sd"] * (1 + 1e-9)
    ranges = found["range_m"]
    assert ranges["value"][:7] == pytest.approx(BODY["ranges_m"][:7])
    for column in ("value", "cramer_rao_sd", "posterior_sd"):
        assert ranges[column][7] is None


@pytest.mark.anyio
async def test_what_is_not_identifiable_is_null(
    client: httpx.AsyncClient, body: dict[str, Any]
) -> None:
    body["ranges_m"] = [1.0] * 8
    found = (await client.post("/v1/identifiability", json=body)).json()
    assert found["rank"] == 3  # one number of seven frames, two of the empty one
    assert found["singular_values"][3:] == [0.0, 0.0]
    assert [d["cramer_rao_sd"] is None for d in found["directions"]] == [True, True, False]
    for direction in found["directions"][:2]:
        assert set(direction["parameters"]) <= {"object.c0", "object.c1", "object.c2"}
    assert found["parameters"]["object.c0"]["cramer_rao_sd"] is None
    assert found["parameters"]["background.distance_m"]["cramer_rao_sd"] is not None
    rows = {row["parameter"]: row for row in found["identifiability"]}
    assert rows["object.c1"]["status"] == "not_identified"
    assert "the object must move" in rows["object.c1"]["reason"]


@pytest.mark.anyio
@pytest.mark.parametrize(
    ("pointer", "value", "wanted"),
    [
        ("/ranges_m", [], "/ranges_m"),
        ("/ranges_m", [0.3, 0.0] + [1.0] * 6, "/ranges_m/1"),
        ("/ranges_m", [0.3, 50.0] + [1.0] * 6, "/ranges_m/1"),
        ("/ranges_m", [0.3, "0.4"] + [1.0] * 6, "/ranges_m/1"),
        ("/object_present", [True], "/object_present"),
        ("/at/object.c9", 0.1, "/at/object.c9"),
        ("/at/object.c0", -0.1, "/at/object.c0"),
        ("/at/background.distance_m", 9.0, "/at/background.distance_m"),
        ("/scene/motion", "static", "/ranges_m"),
        ("/scene/object", {"c0": -1.0}, "/scene/object/c0"),
        ("/ranges", [1.0], "/ranges"),
    ],
)
async def test_bad_input(
    client: httpx.AsyncClient, body: dict[str, Any], pointer: str, value: Any, wanted: str
) -> None:
    response = await client.post("/v1/identifiability", json=changed(body, pointer, value))
    assert_problem(response, 422, wanted)


@pytest.mark.anyio
@pytest.mark.parametrize(
    ("pointer", "value"), [("/scene/motion", "tangential"), ("/at", {"object.c2": 1e300})]
)
async def test_refusals_say_what_to_do(
    client: httpx.AsyncClient, body: dict[str, Any], pointer: str, value: Any
) -> None:
    response = await client.post("/v1/identifiability", json=changed(body, pointer, value))
    assert_problem(response, 422)
    assert "state" in response.json()["detail"]


def test_command(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps({"sensor": BODY["sensor"], "scene": BODY["scene"]}))
    ranges = [str(r) for r in BODY["ranges_m"][:7]]
    code = main(
        [
            *("identifiability", "--scene", str(path), "--ranges", *ranges),
            *("--empty", "1", "--at", "object.c0=0.08", "--at", "background.distance_m=3"),
        ]
    )
    out, err = capsys.readouterr()
    assert code == 0
    # seven frames, and a shadow that errs
    assert "range_m, the scale of all ranges, would be weak" in err
    assert json.loads(out)["rank"] == 5
    exact = BODY["scene"] | {"discrepancy": 0}
    path.write_text(json.dumps({"sensor": BODY["sensor"], "scene": exact}))
    common = ["--at", "object.c0=0.08", "--at", "background.distance_m=3"]
    code = main(["identifiability", "--scene", str(path), "--ranges", *ranges, *common])
    assert (code, capsys.readouterr().err) == (0, "")
    for bad in (["--at", "object.c0"], ["--at", "object.c9=1"], ["--empty", "-1"]):
        code = main(["identifiability", "--scene", str(path), "--ranges", "1", *bad])
        out, err = capsys.readouterr()
        assert (code, out) == (2, "")
        assert bad[0] in err


@pytest.mark.anyio
async def test_a_sensor_that_is_not_calibrated_over_http(
    client: httpx.AsyncClient, body: dict[str, Any]
) -> None:
    offset = {"prior": "normal", "mean": 0.0, "sd": 3e-10}
    body["sensor"] = SENSOR | {"timing_offset_s": offset}
    found = (await client.post("/v1/identifiability", json=body)).json()
    assert "sensor.timing_offset_s" in [row["parameter"] for row in found["identifiability"]]
    scene = {"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}}
    stated = {"sensor": body["sensor"], "scene": scene}
    path = {"range_m": [0.5, 0.7], "time_s": [0.0, 0.1]}
    made = await client.post("/v1/simulations", json={**stated, "trajectory": path, "seed": 1})
    assert made.status_code == 200, made.text
    assert set(made.json()["truth"]["parameters"]) == {"sensor.timing_offset_s"}
    asked = {**stated, "frames": made.json()["frames"]}
    answer = (await client.post("/v1/estimates", json=asked)).json()
    assert answer["chosen"] == "intensity"
    (reason,) = (row["reason"] for row in answer["left_out"] if row["technique"] == "conventional")
    assert "needs sensor.timing_offset_s as known numbers" in reason
    wrong = changed(asked, "/sensor/timing_offset_s", offset | {"sd": 0.0})
    assert_problem(
        await client.post("/v1/estimates", json=wrong), 422, "/sensor/timing_offset_s/sd"
    )
    wrong = changed(asked, "/sensor/gain", {"prior": "uniform", "low": -2.0, "high": -1.0})
    assert_problem(await client.post("/v1/estimates", json=wrong), 422, "/sensor/gain")
