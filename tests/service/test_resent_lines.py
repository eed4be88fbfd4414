"""Numbers that come again: the same line is answered as before, another one is in conflict."""

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.streams import system
from inference.tracking.tracker import Tracker, tracker
from service.app import create_app
from service.service_settings import ServiceSettings
from service.streams.digests import digests_of, split, with_digests
from service.streams.followers import Plain
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Line, Place, Taken
from service.streams.taking import take
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service import fake_fold
from tests.service.conftest import SCENE, SENSOR, listening, speaking
from tests.service.streaming import sent

CONFLICT = "urn:hybridtof:problem:conflict"


@pytest.fixture(scope="module")
def model() -> Tracker:
    return tracker(parse_sensor(SENSOR), parse_scene(SCENE | {"discrepancy": 0}))


def frame(n: int, **more: Any) -> dict[str, Any]:
    return {"sequence": n, "time_s": 0.1 * n, "w1": 0.02, "w2": 1.7 - 0.01 * n} | more


def taken(model: Tracker, place: Place, earlier: Kept, *frames: dict[str, Any]) -> Taken:
    lines = [Line(json.dumps(frame).encode(), 0.0) for frame in frames]
    return take(Plain(model), place, lines, JsonLines(), earlier)


FIRST = [
    *(frame(n) for n in range(1, 7)),  # read together
    frame(7, w1=1, stamp={"sec": 5, "nanosec": [1, 2.0]}),
    frame(8, object_present=False, gain=2.0),
    frame(9, gain=0.0),  # answered by an error
    frame(10, note="a", huge=10**40, latency_s=3.0),
]
SAME = [
    frame(3), dict(reversed(frame(4).items())),
    frame(7, w1=1.0, stamp={"nanosec": [1.0, 2], "sec": 5}),
    frame(8, gain=2, object_present=False), FIRST[8],
    frame(10, note="a", huge=10**40, latency_s=4.0),
]  # fmt: skip
OTHER = [
    frame(1, w1=0.0200000000001), frame(2, w2=1.7), frame(3, time_s=0.30000001), frame(4, gain=1.0),
    frame(5, w1=1.68, w2=0.02), {"sequence": 6, "time_s": 0.6, "w2": 1.64}, frame(7, w1=1),
    frame(7, w1=1, stamp={"sec": 5, "nanosec": [2, 1]}), frame(8, object_present=True, gain=2.0),
    frame(9), frame(10, note="b", huge=10**40), frame(10, note="a", huge=10**41),
]  # fmt: skip


@pytest.mark.parametrize("size", [1, 2, 10])
def test_what_comes_again_is_the_line_that_was_answered(model: Tracker, size: int) -> None:
    """However lines are cut: those that are kept by their numbers, and those that are not."""
    answers: dict[int, bytes] = {}
    place, kept = Place(model.first), Kept()
    for at in range(0, len(FIRST), size):
        found = taken(model, place, kept, *FIRST[at : at + size])
        kept.add(found)
        place = found.place
        answers |= {json.loads(answer)["sequence"]: answer for answer in found.answers}
    again = taken(model, place, kept, *SAME)
    assert again.answers == [answers[frame["sequence"]] for frame in SAME]
    for frames in (OTHER, *([one] for one in OTHER)):
        refused = taken(model, place, kept, *frames)
        assert refused.place == place
        assert not refused.changed
        for frame_, raw in zip(frames, refused.answers, strict=True):
            answer = json.loads(raw)
            assert answer["sequence"] == frame_["sequence"]
            assert (answer["error"]["type"], answer["error"]["pointer"]) == (CONFLICT, "/sequence")
            assert "make a new stream" in answer["error"]["detail"]


def test_of_one_request_the_first_line_counts(model: Tracker) -> None:
    found = taken(model, Place(model.first), Kept(), frame(1), frame(1, w2=1.0), frame(1), frame(2))
    first, other, same, last = found.answers
    assert same == first
    assert json.loads(other)["error"]["type"] == CONFLICT
    assert "error" not in json.loads(last)


def test_of_lines_without_digests_the_number_counts(model: Tracker) -> None:
    """Those that were answered before digests were kept."""
    found = taken(model, Place(model.first), Kept(), *FIRST)
    kept = Kept()
    kept.add(found._replace(kept=split(found.kept)[0]))
    assert taken(model, found.place, kept, frame(1, w2=1.0)).answers == found.answers[:1]


def test_digests_are_the_same_of_one_line_and_of_many() -> None:
    rng = np.random.default_rng(4)
    rows = [
        {"a": float(rng.normal()), "b": n, "c": [n, {"d": 2.5}], "e": n % 2 == 0, "f": str(n)}
        for n in range(50)
    ]
    many = digests_of(list("abcef"), lambda name: [row[name] for row in rows], len(rows))
    alone = [int(digests_of(list("fecba"), lambda name: [row[name]], 1)[0]) for row in rows]  # noqa: B023
    assert many.tolist() == alone
    assert len(set(alone)) == len(rows)
    assert split(with_digests(b"text", many)) == (b"text", alone)
    assert with_digests(b"", []) == b""


def test_digests_stay_what_they_are() -> None:
    """They are kept: those of another version would be conflicts of lines that are the same."""

    def mixed(word: int) -> int:  # splitmix64's finaliser in integers of any size
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            word = (word ^ word >> shift) * factor % 2**64
        return word ^ word >> 31

    name = int.from_bytes(hashlib.blake2b(b"w1", digest_size=8).digest(), "big")
    (bits,) = struct.unpack("<Q", struct.pack("<d", -2.5))
    (found,) = digests_of(["w1"], lambda _: [-2.5], 1).tolist()
    assert found == mixed((bits + name) % 2**64)
    assert digests_of(["w1"], lambda _: [0], 1) == digests_of(["w1"], lambda _: [-0.0], 1)


@pytest.mark.anyio
async def test_a_device_that_counts_anew_is_told_so_over_a_restart(tmp_path: Path) -> None:
    limits = ServiceSettings(workers=1, database=f"sqlite:///{tmp_path}/s.sqlite")
    lines = [json.dumps(frame(n)).encode() for n in range(1, 9)]
    anew = [json.dumps(frame(n, time_s=50.0 + 0.1 * n, w2=0.3)).encode() for n in range(1, 9)]
    async with (
        listening(create_app(limits, fake_fold)) as address,
        speaking(f"http://{address}") as http,
    ):
        path = (await http.post("/v1/streams", json=system())).headers["Location"]
        answers = await sent(http, path, *lines)
        stands = (await http.get(path)).json()
    async with (
        listening(create_app(limits, fake_fold)) as address,
        speaking(f"http://{address}") as http,
    ):
        refused = await sent(http, path, *anew)
        assert [answer["sequence"] for answer in refused] == list(range(1, 9))
        errors = [answer["error"] for answer in refused]
        assert {(e["type"], e["pointer"]) for e in errors} == {(CONFLICT, "/sequence")}
        assert (await http.get(path)).json() == stands
        assert await sent(http, path, *lines) == answers
        # the stream goes on
        (on,) = await sent(http, path, json.dumps(frame(9)).encode())
        assert (on["sequence"], "error" in on) == (9, False)
