"""Bad requests over all routes, and how each is answered: status, problem type, pointers.

After a change of answers that is meant,

    python -m tests.contract.bad_requests

records ``bad_answers.json`` anew: its diff shows what has changed.
"""

import asyncio
import copy
import dataclasses
import json
from pathlib import Path
from typing import Any

import httpx

from service.app import create_app
from service.service_settings import ServiceSettings

ANSWERS = Path(__file__).with_name("bad_answers.json")
MAX_BODY_BYTES = 200_000

NAN, INF = float("nan"), float("inf")
Body = dict[str, Any]
PULSED: Body = {
    "kind": "pulsed",
    "pulse_width_s": 1e-7,
    "gain": 1.0,
    "noise": {"read": [1e-6, 1e-6]},
}
SINE_WAVE: Body = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-6, 1e-6]}}
OBJECT: Body = {"c0": 0.0769, "c1": -0.123, "c2": 0.1}
PRIOR: Body = {"prior": "normal", "mean": 0.0, "sd": 0.02}
TINY: Body = {"prior": "lognormal", "median": 1e-12, "sigma": 0.1}
BASES: dict[str, Body] = {
    "estimates": {
        "sensor": PULSED,
        "scene": {
            "object": OBJECT,
            "background": {"strength": 0.8, "distance_m": 3.0, "shadow": {"c0": 0.06, "c1": 0.01}},
        },
        "frames": {"time_s": [0.0, 0.1], "w1": [0.01, 0.02], "w2": [1.5, 1.7]},
    },
    "estimates of a sine wave": {
        "sensor": SINE_WAVE,
        "scene": {"object": OBJECT},
        "frames": {"i": [0.1, 0.2], "q": [0.1, 0.2]},
    },
    "posteriors": {
        "sensor": PULSED,
        "scene": {"crosstalk": [PRIOR, PRIOR]},
        "frames": {"w1": [0.01, 0.02, 0.03], "w2": [0.5, 0.6, 0.7]},
        "sampler": {"method": "emcee", "seed": 1},
    },
    "posteriors of frames without object": {
        "sensor": PULSED,
        "scene": {"crosstalk": [PRIOR, PRIOR]},
        "frames": {"w1": [0.01], "w2": [0.5], "object_present": [False]},
    },
    "simulations": {
        "sensor": PULSED,
        "scene": {"object": OBJECT},
        "trajectory": {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": 3},
        "seed": 1,
    },
    "identifiability": {
        "sensor": PULSED,
        "scene": {"crosstalk": [0.0, PRIOR]},
        "ranges_m": [0.3, 0.6, 1.2],
        "object_present": [True, True, False],
        "at": {"object.c0": 0.08},
    },
}
REMOVED = object()

# base, pointer, value
SPOILED: tuple[tuple[str, str, Any], ...] = (
    # frames
    ("estimates", "/frames/w1", [0.01]),
    ("estimates", "/frames/w1", []),
    ("estimates", "/frames/w1", [NAN, 1.0]),
    ("estimates", "/frames/w2", [1.0, INF]),
    ("estimates", "/frames/w2", ["1.5", 1.0]),
    ("estimates", "/frames/w2", [1.0, True]),
    ("estimates", "/frames/w2", [1.0, None]),
    ("estimates", "/frames/w2", [[1.0, 2.0]]),
    ("estimates", "/frames/w2", None),
    ("estimates", "/frames/w2", [1.0] * 100 + ["x"]),
    ("estimates", "/frames/w3", [1.0, 2.0]),
    ("estimates", "/frames/W1", [1.0, 2.0]),
    ("estimates", "/frames/i", [1.0, 2.0]),
    ("estimates", "/frames/dw1_dt", [1.0, 2.0]),
    ("estimates", "/frames/gain", [1.0, 0.0]),
    ("estimates", "/frames/object_present", [1, 0]),
    ("estimates", "/frames/object_present", [True]),
    ("estimates", "/frames", []),
    ("estimates", "/frames", REMOVED),
    ("estimates of a sine wave", "/frames/w1", [1.0, 2.0]),
    ("estimates of a sine wave", "/frames/q", REMOVED),
    # sensor
    ("estimates", "/sensor/pulse_width_s", True),
    ("estimates", "/sensor/pulse_width_s", "1e-7"),
    ("estimates", "/sensor/pulse_width_s", 0),
    ("estimates", "/sensor/pulse_width_s", 1e60),
    ("estimates", "/sensor/kind", "radar"),
    ("estimates", "/sensor/kind", REMOVED),
    ("estimates", "/sensor/colour", "red"),
    ("estimates", "/sensor/gain", -1.0),
    ("estimates", "/sensor/noise", {}),
    ("estimates", "/sensor/noise/read", [1e-6]),
    ("estimates", "/sensor/noise/read", [1e-6, -1e-6]),
    ("estimates", "/sensor/noise/shot", -1.0),
    ("estimates", "/sensor/full_scale", [1.0]),
    ("estimates", "/sensor", None),
    ("estimates of a sine wave", "/sensor/frequency_hz", -5e6),
    ("estimates of a sine wave", "/sensor/pulse_width_s", 1e-7),
    # scene
    ("estimates", "/scene/object/c0", 0),
    ("estimates", "/scene/object/c1", -1.0),
    ("estimates", "/scene/object/c3", 1.0),
    ("estimates", "/scene/object/c2", {"prior": "cauchy", "low": 0.0, "high": 1.0}),
    ("estimates", "/scene/object/c2", {"prior": "lognormal", "median": 0.1}),
    ("estimates", "/scene/object/c2", {"prior": "uniform", "low": 2.0, "high": 1.0}),
    ("estimates", "/scene/object/c2", {"prior": "normal", "mean": 0.1, "sd": 0.0}),
    ("estimates", "/scene/object", 1.0),
    ("estimates", "/scene/background/distance_m", REMOVED),
    ("estimates", "/scene/background/distance_m", 16.0),
    ("estimates", "/scene/background/strength", -1.0),
    ("estimates", "/scene/background/shadow", "wall"),
    ("estimates", "/scene/background/shadow/c1", -1.0),
    ("estimates", "/scene/range_m", 1.0),
    ("estimates", "/scene/range_m", {"prior": "uniform", "low": 5.0, "high": 1.0}),
    ("estimates", "/scene/motion", "circular"),
    ("estimates", "/scene/discrepancy", -0.1),
    ("estimates", "/scene/discrepancy", {"range_m": 16.0}),
    ("estimates", "/scene/crosstalk", [0.1]),
    ("estimates", "/scene", None),
    ("estimates", "/scene", REMOVED),
    # what is asked
    ("estimates", "/techniques", ["magic"]),
    ("estimates", "/techniques", []),
    ("estimates", "/techniques", "conventional"),
    ("estimates", "/techniques", ["x" * 65]),
    ("estimates", "/colour", 1),
    ("estimates", "/sampler", {"seed": 1}),
    # posteriors
    ("posteriors of frames without object", "/scene", {}),
    ("posteriors", "/scene/object", {"c0": TINY, "c1": PRIOR | {"mean": -1.0}}),
    ("posteriors", "/sensor", REMOVED),
    ("posteriors", "/frames", REMOVED),
    ("posteriors", "/frames/w1", []),
    ("posteriors", "/frames/w1", [0.1]),
    ("posteriors", "/frames/gain", [1.0, 0.0, 1.0]),
    ("posteriors", "/scene/crosstalk", {"values": [0.0, 0.1], "optional": True}),
    ("posteriors", "/scene/discrepancy", {"range_m": 16.0}),
    ("posteriors", "/scene/object", {"c2": {"prior": "uniform", "low": -2.0, "high": -1.0}}),
    ("posteriors", "/scene/object", {"c2": {"prior": "loguniform", "low": 0.0, "high": 1.0}}),
    ("posteriors", "/scene/range_m", {"prior": "uniform", "low": 100.0, "high": 200.0}),
    ("posteriors", "/scene/motion", "tangential"),
    ("posteriors", "/sensor/full_scale", [1e-3, 1e-3]),
    ("posteriors", "/sampler/method", "nuts"),
    ("posteriors", "/sampler/ensembles", 0),
    ("posteriors", "/sampler/ensembles", 4.5),
    ("posteriors", "/sampler/max_seconds", -1),
    ("posteriors", "/sampler/seed", -1),
    ("posteriors", "/sampler/x", 1),
    ("posteriors", "/sampler", None),
    # simulations
    ("simulations", "/trajectory", REMOVED),
    ("simulations", "/trajectory", {}),
    ("simulations", "/trajectory/kind", "spiral"),
    ("simulations", "/trajectory/frames", 0),
    ("simulations", "/trajectory/from_m", -0.2),
    ("simulations", "/trajectory/spacing", "cubic"),
    ("simulations", "/trajectory", {"range_m": []}),
    ("simulations", "/trajectory", {"range_m": [0.5, 1.0], "time_s": [0.0]}),
    ("simulations", "/seed", -1),
    ("simulations", "/seed", 2**60),
    ("simulations", "/seed", "1"),
    ("simulations", "/frames", {"w1": [1.0], "w2": [1.0]}),
    # identifiability
    ("identifiability", "/ranges_m", REMOVED),
    ("identifiability", "/ranges_m", []),
    ("identifiability", "/ranges_m", [0.3, -0.6, 1.2]),
    ("identifiability", "/ranges_m", [0.3, NAN, 1.2]),
    ("identifiability", "/object_present", [True]),
    ("identifiability", "/at", {"object.c9": 1.0}),
    ("identifiability", "/at", {"object.c0": -1.0}),
    ("identifiability", "/scene/motion", "tangential"),
)
JSON = {"Content-Type": "application/json"}


@dataclasses.dataclass(frozen=True)
class BadRequest:
    """What is sent."""

    method: str
    path: str
    content: bytes | None = None
    headers: dict[str, str] = dataclasses.field(default_factory=dict)


def spoil(base: str, pointer: str, value: Any) -> BadRequest:
    """A good request in which one place is another, or is not there."""
    body = copy.deepcopy(BASES[base])
    *path, last = pointer.strip("/").split("/")
    target = body
    for part in path:
        target = target[part]
    if value is REMOVED:
        del target[last]
    else:
        target[last] = value
    return BadRequest("POST", f"/v1/{base.split()[0]}", json.dumps(body).encode())


def _name(base: str, pointer: str, value: Any) -> str:
    said = "removed" if value is REMOVED else json.dumps(value)
    return f"{base} {pointer} {said if len(said) < 80 else said[:76] + ' ...'}"


def requests() -> dict[str, BadRequest]:
    """Every bad request by its name."""
    found = {_name(*case): spoil(*case) for case in SPOILED}
    good = json.dumps(BASES["estimates"]).encode()
    for content in (
        b"",
        b"{",
        b"\xff\xfe",
        b"[" * 100,
        b"null",
        b"[]",
        b"NaN",
        b'{"a": 1, "a": 2}',
    ):
        for route in ("estimates", "identifiability", "posteriors", "simulations"):
            name = f"{route}: {content[:20].decode('latin-1')!r}"
            found[name] = BadRequest("POST", f"/v1/{route}", content)
    endless = good.replace(b"1.7]", b"1e400]")
    html = {"Content-Type": "text/html"}
    key = {"Idempotency-Key": "a b"}
    length = {"Content-Length": "x"}
    posterior = json.dumps(BASES["posteriors"]).encode()
    return found | {
        "a body of another media type": BadRequest("POST", "/v1/estimates", good, html),
        "a body that is too large": BadRequest("POST", "/v1/estimates", b" " * 200_001),
        "a length that is no number": BadRequest("POST", "/v1/estimates", good, length),
        "a repeated member": BadRequest("POST", "/v1/estimates", good[:-1] + b', "scene": {}}'),
        "a number without end": BadRequest("POST", "/v1/estimates", endless),
        "a lone surrogate": BadRequest("POST", "/v1/estimates", good[:-1] + b', "x": "\\ud800"}'),
        "a path that is not there": BadRequest("GET", "/v1/nothing"),
        "a slash too many": BadRequest("GET", "/v1/estimates/"),
        "a method that is not there": BadRequest("DELETE", "/v1/estimates"),
        "techniques cannot be made": BadRequest("POST", "/v1/techniques", b"{}"),
        "health cannot be made": BadRequest("PUT", "/health/live", b"{}"),
        "a posterior that is not there": BadRequest("GET", "/v1/posteriors/none"),
        "draws that are not there": BadRequest("GET", "/v1/posteriors/none/draws"),
        "draws in no form that is": BadRequest(
            "GET", "/v1/posteriors/none/draws", None, {"Accept": "image/png"}
        ),
        "nothing to cancel": BadRequest("POST", "/v1/posteriors/none/cancel"),
        "nothing to forget": BadRequest("DELETE", "/v1/posteriors/none"),
        "a key that cannot be kept": BadRequest("POST", "/v1/posteriors", posterior, key),
        "a cursor of another": BadRequest("GET", "/v1/posteriors?cursor=x"),
        "a page of none": BadRequest("GET", "/v1/posteriors?limit=0"),
        "a page of too many": BadRequest("GET", "/v1/posteriors?limit=1000"),
        "a page of words": BadRequest("GET", "/v1/posteriors?limit=ten"),
    }


async def answers() -> dict[str, Any]:
    """Send every bad request; return status, problem type and pointers by its name."""
    app = create_app(ServiceSettings(workers=1, threads=1, max_body_bytes=MAX_BODY_BYTES))
    found: dict[str, Any] = {}
    async with (
        app.router.lifespan_context(app),
        httpx.AsyncClient(
            transport=httpx.ASGITransport(app), base_url="http://localhost"
        ) as client,
    ):
        for name, bad in requests().items():
            response = await client.request(
                bad.method, bad.path, content=bad.content, headers=JSON | bad.headers
            )
            body = response.json()
            found[name] = {
                "status": response.status_code,
                "type": body["type"],
                "pointers": [error["pointer"] for error in body["errors"]],
            }
    return found


if __name__ == "__main__":
    recorded = asyncio.run(answers())
    lines = (f"{json.dumps(name)}: {json.dumps(answer)}" for name, answer in recorded.items())
    ANSWERS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
