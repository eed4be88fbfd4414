"""Lines of a stream by themselves: cut, read, answered; no network."""

import asyncio
import itertools
import json
import time
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.smoothed_readings import smoothed
from inference.tracking.tracker import Tracker, tracker
from service.errors import MalformedError
from service.streams import room
from service.streams.answered import before_in
from service.streams.cutting import LONGEST, Cutter
from service.streams.digests import split
from service.streams.followers import Plain
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import WINDOW, Line, Place
from service.streams.room import STALE_S, Room
from service.streams.said import MARKS
from service.streams.taking import take
from service.strict_json import decode
from simulator.errors import InvalidInputError
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.service.conftest import SCENE, SENSOR


@pytest.fixture(scope="module")
def model() -> Tracker:
    return tracker(parse_sensor(SENSOR), parse_scene(SCENE | {"discrepancy": 0}))


def frame(n: int, **more: Any) -> bytes:
    return json.dumps({"time_s": 0.1 * n, "w1": 0.02, "w2": 1.7 - 0.01 * n} | more).encode()


def answered(model: Tracker, batches: Sequence[Sequence[bytes | None]]) -> list[dict[str, Any]]:
    place, kept, found = Place(model.first), Kept(), []
    for batch in batches:
        taken = take(Plain(model), place, [Line(raw, time.perf_counter()) for raw in batch],
                     JsonLines(), kept)  # fmt: skip
        kept.add(taken)
        place = taken.place
        found += [json.loads(answer) for answer in taken.answers]
    return [answer | {"latency_s": None} for answer in found]


LINES = [
    frame(1, stamp={"sec": 1}), frame(2), b"junk", frame(3), frame(1), None, frame(5),
    frame(6, sequence=20), frame(6, sequence=20), frame(7, sequence=3), frame(7, sequence=15),
    frame(7, gain=2.0), frame(8, gain=0.0), frame(9, gain=1.0), frame(10, object_present=False),
    frame(11, w1=None), b"[1]", frame(12, w1=1), frame(12, sequence=-1), frame(13, w3=1.0),
]  # fmt: skip


def test_what_is_answered(model: Tracker) -> None:
    found = answered(model, [LINES])
    errors = {n: answer["error"]["pointer"] for n, answer in enumerate(found) if "error" in answer}
    assert errors == {
        2: "", 4: "/time_s", 5: "", 9: "", 10: "", 12: "/gain", 15: "/w1", 16: "", 18: "/sequence",
        19: "/w3",
    }  # fmt: skip
    assert [answer["sequence"] for answer in found] == [
        1, 2, 3, 4, 5, 6, 7, 20, 20, 3, 15, 21, 22, 23, 24, 25, 26, 27, 28, 29
    ]  # fmt: skip
    assert found[0]["stamp"] == {"sec": 1}
    assert found[7]["gap"] == 12
    assert found[8] == found[7]  # a number that came before is answered as before
    # the third line could not be read, and took no number
    assert found[9]["error"]["type"].endswith("conflict")
    assert found[10]["error"]["type"].endswith("conflict")
    # bad lines change nothing of what the others are answered
    good = [raw for n, raw in enumerate(LINES) if n not in errors and n != 8]
    alone = answered(model, [good])
    kept = [answer for n, answer in enumerate(found) if n not in errors and n != 8]
    for one, other in zip(alone, kept, strict=True):
        assert {k: v for k, v in one.items() if k not in ("sequence", "gap")} == {
            k: v for k, v in other.items() if k not in ("sequence", "gap")
        }


@settings(max_examples=8, deadline=None)
@given(cuts=st.sets(st.integers(1, len(LINES) - 1)))
def test_cut_anywhere_is_whole(model: Tracker, cuts: set[int]) -> None:
    ends = [0, *sorted(cuts), len(LINES)]
    batches = [LINES[a:b] for a, b in itertools.pairwise(ends)]
    assert answered(model, batches) == answered(model, [LINES])


def test_a_line_without_a_readable_number_takes_none(model: Tracker) -> None:
    """What a microcontroller says as it starts, and a line that was torn in two."""
    lines: list[bytes | None] = [
        b"rst:0x1 (POWERON_RESET)", b"entry 0x400805e4", frame(1, sequence=0), frame(2, sequence=1),
        b'{"time_s": 0.3, "seq', b'uence": 2, "w1": 0.02, "w2": 1.6}', frame(4, sequence=2),
        frame(5, sequence=3), None, frame(6), frame(7, sequence=6), frame(8, sequence="x"),
    ]  # fmt: skip
    found = answered(model, [lines])
    assert [answer["sequence"] for answer in found] == [1, 2, 0, 1, 2, 3, 2, 3, 4, 5, 6, 7]
    assert [n for n, answer in enumerate(found) if "error" in answer] == [0, 1, 4, 5, 8, 11]
    assert not any("gap" in answer for answer in found)
    assert answered(model, [[line] for line in lines]) == found


def test_before_the_window(model: Tracker) -> None:
    first, last, again = frame(1), frame(2, sequence=WINDOW + 5), frame(3, sequence=1)
    found = answered(model, [[first], [last], [again]])
    assert found[2]["error"]["type"].endswith("gone")


@given(st.binary(max_size=200), st.lists(st.integers(0, 200)))
def test_a_cutter_cuts_anywhere(data: bytes, cuts: list[int]) -> None:
    ends = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    cutter = Cutter()
    found = [line for a, b in itertools.pairwise(ends) for line in cutter.feed(data[a:b])]
    assert found + cutter.end() == [line for line in data.split(b"\n") if line.strip()]


@pytest.mark.parametrize("block", [7, 4096, 2**20])
def test_a_long_line_is_not_kept(block: int) -> None:
    data = b"a\n" + b"x" * (3 * LONGEST) + b"\nb\n" + b"y" * (LONGEST + 1)
    cutter = Cutter()
    found: list[bytes | None] = []
    for start in range(0, len(data), block):
        found += cutter.feed(data[start : start + block])
        assert len(cutter._rest) <= LONGEST
    assert found + cutter.end() == [b"a", None, b"b", None]


@pytest.mark.parametrize(
    "line",
    [
        b'{"w1": 1, "w1": 2, "w2" :3}',
        b'{"w1": 1, "w2": 2, "stamp": {"a": 1, "a": 2}}',
        b'{"w1": 1, "\\u0077\\u0031": 2}',
        b'{"a": "\\u003a", "a": 1}',
        b'{"w1": NaN}',
        b'{"w1": 1, "x": [1e999]}',
        b"[" * 1000,
        b'{"x": ' + b"[" * 40 + b"]" * 40 + b"}",
        b"\xff\xfe",
        b'{"x": "\\ud800"}',
        b"7",
    ],
)
def test_what_the_quick_reader_must_not_take(line: bytes) -> None:
    with pytest.raises((MalformedError, InvalidInputError)):
        JsonLines().frame_in(line)


@pytest.mark.parametrize(
    "line",
    [
        b'{"w1": 1, "at": "2026-11-22T10:00:00Z", "stamp": {"sec": 1, "frame": "a:b"}}',
        b' { "a" : [1, {"b": null}], "c\\"": "\\u00e9:" } ',
        b'{"big": 18446744073709551616, "small": -9007199254740993}',
    ],
)
def test_the_quick_reader_reads_what_the_strict_one_does(line: bytes) -> None:
    assert JsonLines().frame_in(line) == decode(line)


def test_a_number_beyond_64_bits_is_passed_through(model: Tracker) -> None:
    line = b'{"time_s": 0, "w1": 0.02, "w2": 1.7, "id": 18446744073709551616, "at": "a\\u003ab"}'
    (answer,) = answered(model, [[line]])
    assert answer["id"] == 2**64
    assert answer["at"] == "a:b"


def test_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]  # on a busy machine lines may be stale before they are taken
    monkeypatch.setattr(room, "time", SimpleNamespace(perf_counter=lambda: now_s[0]))

    async def run() -> None:
        every = Room(latest=False)
        putting = asyncio.create_task(every.put([b"%d" % n for n in range(2500)]))
        seen: list[bytes | None] = []
        sizes = []
        while len(seen) < 2500:
            lines = await every.take()
            sizes.append(len(lines))
            seen += [line.raw for line in lines]
        await putting
        assert seen == [b"%d" % n for n in range(2500)]
        assert max(sizes) == 1000  # the rest had to wait outside

        latest = Room(latest=True)
        await latest.put([b"%d" % n for n in range(2500)])
        lines = await latest.take()
        assert (len(lines), lines[0].raw, lines[0].dropped) == (1000, b"1500", 1500)
        await latest.put([b"a", b"b", b"c"])
        now_s[0] += 2 * STALE_S
        await latest.put([b"d"])
        (line,) = await latest.take()
        assert (line.raw, line.dropped) == (b"d", 3)
        latest.end()
        assert await latest.take() == []

    asyncio.run(run())


def test_dropped_lines_have_their_numbers(model: Tracker) -> None:
    now = time.perf_counter()
    lines = [Line(frame(1), now), Line(frame(5), now, 3), Line(frame(6, sequence=9), now, 1)]
    (first,) = take(Plain(model), Place(model.first), lines[1:2], JsonLines(), Kept()).answers
    assert json.loads(first)["sequence"] == 4
    taken = take(Plain(model), Place(model.first), lines, JsonLines(), Kept())
    found = [json.loads(answer) for answer in taken.answers]
    assert [(a["sequence"], a.get("dropped"), a.get("gap")) for a in found] == [
        (1, None, None), (5, 3, None), (9, 1, 2)
    ]  # fmt: skip
    assert (taken.place.dropped, taken.place.gaps, taken.place.answered) == (4, 2, 3)


def test_known_ranges_of_lines(model: Tracker) -> None:
    """A known range counts, null is none, and what a line cannot know is an error of that line."""
    lines = [
        frame(1, known_range_m=None, known_range_sd_m=None),
        frame(2, known_range_m=1.0, known_range_sd_m=0.01),
        frame(3, known_range_m=None, known_range_sd_m=None),
        frame(4, known_range_m=1.0, known_range_sd_m=None),
        frame(5, known_range_m=-1.0, known_range_sd_m=0.01),
        frame(6, known_range_m=1.0, known_range_sd_m=0.01, object_present=False),
        frame(7, known_range_m=1.0),
        frame(8, displacement_m=None, displacement_sd_m=None),
        frame(9, displacement_m=0.1, displacement_sd_m=0.01),
        frame(10, known_range_m="far", known_range_sd_m=0.01),
        frame(11),
    ]
    found = answered(model, [lines])
    errors = {n: answer["error"]["pointer"] for n, answer in enumerate(found) if "error" in answer}
    assert errors == {
        3: "/known_range_sd_m", 4: "/known_range_m", 5: "/known_range_m", 6: "/known_range_sd_m",
        8: "/displacement_m", 9: "/known_range_m",
    }  # fmt: skip
    assert answered(model, [[line] for line in lines]) == found
    # 1 m is not what these readings say
    assert found[1]["outlier"] > 0.5
    assert found[1]["range_m"] == pytest.approx(1.0, abs=0.05)
    assert found[1]["present"] == pytest.approx(1.0)


_NUMBER = st.one_of(st.floats(-1.0, 3.0), st.integers(-2, 3))
_COLUMNS = {
    "gain": st.floats(-0.1, 2.0),
    "object_present": st.booleans(),
    "stamp": st.one_of(st.integers(), st.text(max_size=3), st.just({"sec": 1}), st.none()),
    "known_range_m": st.one_of(st.none(), st.floats(0.3, 2.0)),
}


@st.composite
def _alike(draw: st.DrawFn) -> list[bytes]:
    """Lines of one shape that count on, but for what a draw spoils."""
    names = draw(st.sets(st.sampled_from(sorted(_COLUMNS))))
    numbered, start = draw(st.booleans()), draw(st.integers(0, 3))
    lines, time_s = [], 0.0
    for n in range(draw(st.integers(4, 12))):
        time_s += draw(st.sampled_from([1.0, 0.125, 0.3] * 5 + [0.0]))
        members: dict[str, Any] = {"sequence": start + n} if numbered else {}
        members |= {"time_s": time_s, "w1": draw(_NUMBER), "w2": draw(_NUMBER)}
        members |= {name: draw(_COLUMNS[name]) for name in names}
        if "known_range_m" in names:
            known = members["known_range_m"]
            members["known_range_sd_m"] = None if known is None else 0.01
        lines.append(json.dumps(members).encode())
    return lines


@settings(max_examples=60, deadline=None)
@given(lines=_alike(), split=st.integers(0, 12))
def test_all_at_once_is_one_by_one(model: Tracker, lines: list[bytes], split: int) -> None:
    """Batches are read, tracked and written column by column, with the same bytes."""
    alone = answered(model, [[line] for line in lines])
    assert answered(model, [lines]) == alone
    assert answered(model, [part for part in (lines[:split], lines[split:]) if part]) == alone


@pytest.mark.parametrize(
    "lines",
    [
        [b'{"a": 1}', b'{"a": 1},{"a": 2}', b'{"a": "x}', b'{", "b": 1}'],
        [b'{"a": 1},{"a": 2}', b'{"a": [1', b"2]}"],
        [b'{"a": 1, "a": 2}', b'{"a": "x:y"}'],
        [b'{"a": 1}', b'{"a": 1} }'],
        [b'{"a": 1}', b'5, {"a": 2}', b'{"a": 3}'],
        [b'{"a": 1}', b'{"a"', b": 1}"],
    ],
)
def test_lines_read_together_are_lines(lines: list[bytes]) -> None:
    """What two lines make together is no frame."""
    with pytest.raises((MalformedError, InvalidInputError)):
        JsonLines().frames_in(lines)


def test_kept_numbers_are_the_same_answers(model: Tracker) -> None:
    """Numbers take less than half of the bytes of the text that follows from them."""
    lines = [frame(n, stamp=None if n % 2 else {"at": "ä\n"}) for n in range(1, 40)]
    batch = [Line(raw, time.perf_counter()) for raw in lines]
    taken = take(Plain(model), Place(model.first), batch, JsonLines(), Kept())
    assert split(taken.kept)[0].startswith(MARKS)
    assert [of.answer for of in before_in(taken.kept).values()] == taken.answers
    assert list(before_in(taken.kept)) == list(range(1, 40))
    plain = [Line(frame(n), 0.0) for n in range(1, 40)]
    small = take(Plain(model), Place(model.first), plain, JsonLines(), Kept())
    assert 2 * len(small.kept) < sum(map(len, small.answers))


def _noisy(n: int) -> list[dict[str, float]]:
    """Readings of an object at rest, with the stated noise."""
    light = [0.02, 1.7] + 1e-6 * np.random.default_rng(1).standard_normal((n, 2))
    return [{"w1": w1, "w2": w2} for w1, w2 in light.tolist()]


def test_readings_that_a_driver_smooths_are_told_of_once(model: Tracker) -> None:
    """With the 32nd frame, however the lines are cut."""
    late = smoothed(np.array([list(row.values()) for row in _noisy(50)]), 0.25)
    lines = [frame(n, w1=w1, w2=w2) for n, (w1, w2) in enumerate(late.tolist())]
    whole = answered(model, [lines])
    assert [n for n, line in enumerate(whole) if "assumptions" in line] == [31]
    (said,) = whole[31]["assumptions"]
    assert said.startswith("w1 and w2 differ from frame to frame by less than read noise alone")
    cut = [lines[at : at + 7] for at in range(0, len(lines), 7)]
    assert answered(model, cut) == whole


def test_noise_below_the_rounding_is_told_once(model: Tracker) -> None:
    """With the 32nd frame, however the lines are cut, and none of readings that are not rounded."""
    lines = [frame(n, w1=round(0.02 + 1e-3 * (n % 7), 3)) for n in range(1, 50)]
    lines.insert(3, b"junk")
    whole = answered(model, [lines])
    assert [n for n, line in enumerate(whole) if "assumptions" in line] == [32]
    late, light = whole[32]["assumptions"]
    assert late.startswith("w1 is rounded to 0.001, and its stated noise is 1e-06: state 0.00029")
    assert light.startswith("w2 is rounded to 0.01")
    for size in (1, 7, 32, 33):
        cut = [lines[at : at + size] for at in range(0, len(lines), size)]
        assert answered(model, cut) == whole
    fine = [frame(n, **readings) for n, readings in enumerate(_noisy(50))]
    assert not any("assumptions" in line for line in answered(model, [fine]))


def test_times_in_milliseconds_are_told_once(model: Tracker) -> None:
    """With the 32nd frame, however the lines are cut."""
    fine = _noisy(50)
    lines = [frame(n, time_s=33 * n + n // 3, **fine[n]) for n in range(1, 50)]
    whole = answered(model, [lines])
    assert [n for n, line in enumerate(whole) if "assumptions" in line] == [31]
    (said,) = whole[31]["assumptions"]
    assert said == "time_s holds whole numbers in steps of 33: are these milliseconds?"
    for size in (1, 31, 32):
        cut = [lines[at : at + size] for at in range(0, len(lines), size)]
        assert answered(model, cut) == whole
    seconds = [frame(n, time_s=n, **fine[n]) for n in range(1, 50)]
    assert not any("assumptions" in line for line in answered(model, [seconds]))


def test_a_temperature_that_nothing_uses_is_told_once(model: Tracker) -> None:
    """With the first frame that has one, however the lines are cut."""
    kelvin = [None, None, 300.0, 301.0, 302.0, None, 303.0, 304.0]
    lines = [frame(n, temperature_k=value) for n, value in enumerate(kelvin, start=1)]
    whole = answered(model, [lines])
    assert ["assumptions" in line for line in whole] == [n == 2 for n in range(8)]
    (said,) = whole[2]["assumptions"]
    assert "temperature_k is given and not used" in said
    for cuts in ([1], [2], [3, 4], [1, 2, 3, 4, 5, 6, 7]):
        edges = [0, *cuts, len(lines)]
        parts = [lines[a:b] for a, b in itertools.pairwise(edges)]
        assert answered(model, parts) == whole
    warm = SENSOR | {"temperature": {"reference_k": 300.0, "gain_drift_per_k": 1e-3}}
    follows = tracker(parse_sensor(warm), parse_scene(SCENE | {"discrepancy": 0}))
    assert not any("assumptions" in line for line in answered(follows, [lines]))
    assert not any("assumptions" in line for line in answered(model, [[frame(1), frame(2)]]))
