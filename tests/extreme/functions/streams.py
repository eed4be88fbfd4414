"""Streams: ranges of frames that tell all, held to the truth; streams that are cut."""

import math
from typing import Any

import numpy as np
from flint import arb, ctx
from numpy.typing import NDArray

import hybridtof
from inference.tracking.track import Track
from simulator.errors import RefusedError
from tests.extreme.balls import exact
from tests.extreme.functions.held import Held
from tests.extreme.functions.light import Light, draw_light, information, mean
from tests.extreme.functions.units import EPSILON, slope
from tests.extreme.tracks import random_track

__all__ = ["STREAMS"]

_FRAMES = 3
_ANSWERS = ("status", "range_m", "sd_m", "hypotheses_m", "hypotheses_weight", "present")
_BITS = 256


def _condition(light: Light) -> float:
    """Return by how many relative roundings of all that goes in the likeliest log range moves."""
    ctx.prec = _BITS
    of = {name: exact(x) for name, x in light.numbers.items()}
    along = [of["r"] * slope(lambda at, j=j: mean(at)[j], of, "r") for j in range(2)]  # type: ignore[misc]
    weights = [a / of[f"read{j + 1}"] ** 2 for j, a in enumerate(along)]
    readings = mean(of)
    moved = sum((abs(w * m) for w, m in zip(weights, readings, strict=True)), arb(0))
    for name, x in of.items():
        if name in ("r", "read1", "read2"):
            continue
        each = (x * slope(lambda at, j=j: mean(at)[j], of, name) for j in range(2))  # type: ignore[misc]
        moved += abs(sum((w * m for w, m in zip(weights, each, strict=True)), arb(0)))
    return 1.0 + float((moved / information(of)).mid())


def _seen(light: Light, number: int) -> tuple[Any, Any, hybridtof.Frames, Any]:
    """Return what a tracker takes: frames without noise."""
    low, high = light.range_m / 3, light.range_m * 3
    far = light.scene.get("background", {}).get("distance_m", math.inf)
    high = min(high, far, getattr(light.parsed, "r0", high), light.parsed.max_range_m)
    law = {"prior": "loguniform", "low": low, "high": max(high, light.range_m * 1.0001)}
    scene = hybridtof.parse_scene({**light.scene, "range_m": law})
    path = hybridtof.SampledTrajectory(
        range_m=[light.range_m] * _FRAMES, time_s=np.arange(float(_FRAMES)).tolist()
    )
    silent = {**light.sensor, "noise": {"read": [1e-20 * x for x in light.parsed.noise.read]}}
    frames = hybridtof.simulate(hybridtof.parse_sensor(silent), scene, path, number).frames
    return light.parsed, scene, frames, hybridtof.TrackingSettings()


def _followed(number: int) -> float | None:
    """An object at rest in readings without noise, which are told to have a little."""
    rng = np.random.default_rng([49, number])
    light = draw_light(rng, rng.uniform(-12, -11))
    given = _seen(light, number)
    if (np.abs(given[2].readings) > 1e13 * np.array(light.parsed.noise.read)).any():
        return None  # noise below the rounding of such readings is not stated as it is
    try:
        found = hybridtof.track(*given)
    except RefusedError:
        return None
    off = np.abs(np.log(found.hypotheses_m / light.range_m))
    # of several ranges that explain a frame the true one is among them
    nearest = np.nanmin(off, axis=1, initial=math.inf)
    return float(nearest.max() / EPSILON / _condition(light))


def _same(one: Track, whole: Track, row: int = 0) -> bool:
    """Compare the answer to a frame with that to a frame of a longer stream."""

    def there(found: Track, name: str, at: int) -> NDArray[Any]:
        values = np.atleast_1d(getattr(found, name)[at])
        # a stream has as many columns as its frame of most ranges has
        return np.asarray(values[np.isfinite(values)])

    return all(np.array_equal(there(one, name, 0), there(whole, name, row)) for name in _ANSWERS)


def _stepped(number: int) -> float | None:
    """A stream frame by frame beside the whole of it."""
    case = random_track(number)
    try:
        whole = case.tracked()
        model = hybridtof.tracker(*case.parsed, case.settings)
    except RefusedError:
        return None
    state, pieces = model.first, []
    for k in range(len(case.frames)):
        state, one = hybridtof.step(model, state, case.frames.select(slice(k, k + 1)))
        pieces.append(one)
    same = all(_same(one, whole, k) for k, one in enumerate(pieces))
    return 0.0 if same else math.inf


def _kept(number: int) -> float | None:
    """A stream whose state is written and read again at every frame."""
    case = random_track(number)
    try:
        model = hybridtof.tracker(*case.parsed, case.settings)
        state = other = model.first
        for k in range(len(case.frames)):
            frame = case.frames.select(slice(k, k + 1))
            raw = hybridtof.state_to_bytes(other)
            other = hybridtof.state_from_bytes(raw)
            if hybridtof.state_to_bytes(other) != raw:
                return math.inf
            state, one = hybridtof.step(model, state, frame)
            other, again = hybridtof.step(model, other, frame)
            if not _same(one, again):
                return math.inf
    except RefusedError:
        return None
    return 0.0


_NOTHING = "1: the same bits, or none"
STREAMS = (
    Held(
        "track",
        "the true range, in readings without noise",
        "relative changes of all that goes in, at the likeliest range",
        500,
        _followed,
    ),
    Held("tracker", "what it makes, by `step`", _NOTHING, 150, _stepped),
    Held("step", "`track` of the whole stream", _NOTHING, 150, _stepped),
    Held("state_to_bytes", "a stream that is never written", _NOTHING, 150, _kept),
    Held("state_from_bytes", "a stream that is never read", _NOTHING, 150, _kept),
)
