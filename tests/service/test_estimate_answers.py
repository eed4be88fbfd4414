"""The columnwise encoder against one dictionary a frame."""

import dataclasses
import json
import math
from collections.abc import Generator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inference.estimates import Estimates, LeftOut, SdParts, Status, TechniqueResult
from inference.techniques import ALL_TECHNIQUES
from service.answers.encoding import AnswerShape, encode_estimates
from service.answers.in_parts import AnswerPart, encode_in_parts, joined

REASONS = ("", 'a "quoted" {brace} reason', "beyond the background: é")


def number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def slow(result: TechniqueResult) -> list[dict[str, Any]]:
    frames = []
    for n in range(len(result)):
        count = int(result.root_count[n])
        frame: dict[str, Any] = {
            "status": Status(int(result.status[n])).name.lower(),
            "range_m": number(result.range_m[n]),
            "sd_m": number(result.sd_m[n]),
            "roots_m": [number(x) for x in result.roots_m[n, :count]],
            "roots_sd_m": [number(x) for x in result.roots_sd_m[n, :count]],
            "near_fold": bool(result.near_fold[n]),
        }
        if frame["sd_m"] is not None and result.sd_parts_m is not None:
            parts = zip(SdParts._fields, result.sd_parts_m, strict=True)
            frame["sd_parts_m"] = {name: number(part[n, 0]) for name, part in parts}
        if result.reason[n]:
            frame["reason"] = result.reasons[result.reason[n]]
        for name in ("power_law", "power_law_sd", "zeta", "zeta_sd"):
            if getattr(result, name) is not None:
                frame[name] = number(getattr(result, name)[n])
        if result.range_bounds_m is not None:
            low, high = (number(x) for x in result.range_bounds_m[n])
            frame["range_bounds_m"] = None if low is None else [low, high]
        frames.append(frame)
    return frames


def assert_same_as_rows(columns: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    """What a row lacks is null in its column; no row has a member without a column."""
    parts = columns.pop("sd_parts_m", None)
    assert all(row.keys() <= columns.keys() | {"sd_parts_m"} for row in rows)
    for name, column in columns.items():
        assert column == [row.get(name) for row in rows]
    for name in SdParts._fields if parts else ():
        assert parts[name] == [(row.get("sd_parts_m") or {}).get(name) for row in rows]


@st.composite
def results(draw: st.DrawFn) -> TechniqueResult:
    n = draw(st.integers(0, 30))
    most = draw(st.integers(1, 3))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = rng.integers(0, most + 1, n)
    unique = (count == 1) & (rng.random(n) < 0.8)
    status = np.where(unique, 0, np.where(count > 1, 1, rng.integers(2, 4, n))).astype(np.uint8)
    roots = np.sort(10.0 ** rng.uniform(-320, 300, (n, most)), axis=1)
    roots[np.arange(most) >= count[:, None]] = np.nan
    sds = np.where(rng.random((n, most)) < 0.3, np.nan, roots)
    bounds = 10.0 ** rng.uniform(-3, 3, (n, 2))
    bounds[rng.random(n) < 0.4] = np.nan
    sees_motion = draw(st.booleans())
    parts = SdParts(0.8 * sds, np.broadcast_to(0.0, sds.shape), 0.6 * sds)
    return TechniqueResult(
        technique="conventional",
        status=status,
        roots_m=roots,
        roots_sd_m=sds,
        root_count=count.astype(np.intp),
        near_fold=rng.random(n) < 0.2,
        reason=rng.integers(0, 3, n).astype(np.uint8),
        reasons=REASONS,
        range_bounds_m=bounds if draw(st.booleans()) else None,
        power_law=np.where(rng.random(n) < 0.5, np.nan, -2.0) if sees_motion else None,
        power_law_sd=rng.random(n) if sees_motion else None,
        zeta=rng.random(n) if sees_motion else None,
        zeta_sd=np.full(n, np.nan) if sees_motion else None,
        sd_parts_m=parts if draw(st.booleans()) else None,
        runtime_s=1e-5,
    )


@given(result=results())
def test_same_as_one_dictionary_a_frame(result: TechniqueResult) -> None:
    estimates = Estimates(None, (result, result), (LeftOut("intensity", 'needs "c0"'),))
    body = json.loads(encode_estimates(estimates))
    assert body["chosen"] is None
    assert body["left_out"] == [{"technique": "intensity", "reason": 'needs "c0"'}]
    assert len(body["results"]) == 2
    columns = json.loads(encode_estimates(estimates, "columns"))
    assert columns | {"results": None} == body | {"results": None}
    for item in columns["results"]:
        assert_same_as_rows(item["frames"], slow(result))
    for item in body["results"]:
        assert item.keys() == {"technique", "frames", "parameters", "runtime_s"}
        assert item["frames"] == slow(result)


@pytest.mark.parametrize("shape", ["rows", "columns"])
@given(found=st.lists(results(), min_size=1, max_size=4))
def test_parts_are_the_whole_at_any_time(found: list[TechniqueResult], shape: AnswerShape) -> None:
    """Techniques answer in another order than they stand in, and each is encoded once."""
    names = list(ALL_TECHNIQUES)[: len(found)]
    pairs = zip(found, names, strict=True)
    named = [dataclasses.replace(result, technique=name) for result, name in pairs]

    def upto(number: int) -> Estimates:
        waiting = tuple(LeftOut(name, "is slow") for name in names[: len(names) - number])
        return Estimates(names[-1], tuple(named[len(names) - number :]), waiting)

    whole = [upto(number) for number in range(1, len(names) + 1)]

    def turns() -> Generator[Estimates, None, Estimates]:
        yield from whole[:-1]
        return whole[-1]

    parts: list[AnswerPart] = []
    encoding = encode_in_parts(turns(), shape)
    while len(parts) < len(whole) - 1:
        parts.append(next(encoding))
    with pytest.raises(StopIteration) as end:
        next(encoding)
    parts.append(end.value.value)
    for number, estimates in enumerate(whole, 1):
        assert joined(parts[:number]) == encode_estimates(estimates, shape)
    assert [len(part.results) for part in parts] == [1] * len(names)


def test_no_result() -> None:
    body = json.loads(encode_estimates(Estimates(None, (), ())))
    assert body == {"chosen": None, "results": [], "left_out": [], "assumptions": []}


def test_parameters_hold_no_nan() -> None:
    empty = np.empty(0)
    result = TechniqueResult(
        "object_fit",
        empty.astype(np.uint8),
        empty.reshape(0, 1),
        empty.reshape(0, 1),
        empty.astype(np.intp),
        empty.astype(bool),
        empty.astype(np.uint8),
        REASONS,
        parameters={"object.c0": math.nan},
    )
    with pytest.raises(ValueError, match="JSON compliant"):
        encode_estimates(Estimates(None, (result,), ()))
