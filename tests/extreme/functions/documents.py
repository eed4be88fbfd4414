"""Sensors, scenes and frames from documents, columns and files: numbers come in as they stand."""

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from flint import arb
from numpy.typing import NDArray

import hybridtof
from simulator.sensor import PulsedSensor
from tests.extreme.functions.held import Held
from tests.extreme.functions.units import EPSILON, between, units

__all__ = ["DOCUMENTS"]

Array = NDArray[np.float64]

_LIGHT_M_S = 299792458
_ROWS = 12


def _rounded(found: Array, stated: Array) -> float:
    """Return the worst relative error in roundings."""
    there = stated != 0
    if not np.array_equal(found[~there], stated[~there]):
        return math.inf
    return float(np.max(np.abs(found[there] / stated[there] - 1), initial=0.0)) / EPSILON


def _sensor(number: int) -> float:
    rng = np.random.default_rng([41, number])
    read = [between(rng, -12, 12), between(rng, -12, 12)]
    gain = between(rng, -12, 12)
    about: dict[str, Any] = {"gain": gain, "noise": {"read": read}}
    if number % 2:
        width = between(rng, -12, 0)
        found = hybridtof.parse_sensor({"kind": "pulsed", "pulse_width_s": width, **about})
        assert isinstance(found, PulsedSensor)
        length = units(lambda of: of["t"] * _LIGHT_M_S / 2, {"t": width}, found.r0)
    else:
        frequency = between(rng, 0, 12)
        wave = hybridtof.parse_sensor({"kind": "sine_wave", "frequency_hz": frequency, **about})
        assert not isinstance(wave, PulsedSensor)
        found = wave
        length = units(
            lambda of: 4 * arb.pi() * of["f"] / _LIGHT_M_S, {"f": frequency}, wave.wave_number
        )
    kept = np.array([found.known_gain, *found.noise.read])
    return max(length, _rounded(kept, np.array([gain, *read])))


def _scene(number: int) -> float:
    rng = np.random.default_rng([42, number])
    size = between(rng, -6, 6)
    shape = {
        "c0": size * size,
        "c1": -2 * size * (1 - between(rng, -15, 0)),
        "c2": between(rng, -12, 12),
    }
    hidden = {"c0": between(rng, -12, 12), "c1": between(rng, -12, 12)}
    wall = {"strength": between(rng, -12, 12), "distance_m": between(rng, -6, 6)}
    crosstalk = [between(rng, -12, 12), -between(rng, -12, 12)]
    document = {
        "object": shape,
        "crosstalk": crosstalk,
        "background": {**wall, "shadow": hidden},
        "discrepancy": 0,
    }
    found = hybridtof.parse_scene(document).model_dump(mode="json", exclude_unset=True)
    again = hybridtof.parse_scene(found).model_dump(mode="json", exclude_unset=True)
    if found != again:
        return math.inf
    kept = [*found["object"].values(), *found["crosstalk"]]
    kept += [found["background"][name] for name in wall]
    kept += found["background"]["shadow"].values()
    stated = [*shape.values(), *crosstalk, *wall.values(), *hidden.values()]
    return _rounded(np.array(kept), np.array(stated))


def _columns(number: int) -> tuple[hybridtof.Frames, Array, str, Any]:
    rng = np.random.default_rng([43, number])
    kind: dict[str, Any] = (
        {"kind": "pulsed", "pulse_width_s": 1e-7}
        if number % 2
        else {"kind": "sine_wave", "frequency_hz": 5e6}
    )
    sensor = hybridtof.parse_sensor({**kind, "noise": {"read": [1e-6, 1e-6]}})
    # down to subnormal numbers, and up to where sums of squares overflow
    size = 10.0 ** rng.uniform(-322, 300, (_ROWS, 2))
    readings = size * rng.choice([-1.0, 1.0], size.shape)
    first, second = sensor.columns
    columns = {
        "time_s": np.cumsum(10.0 ** rng.uniform(-6, 6, _ROWS)).tolist(),
        first: readings[:, 0].tolist(),
        second: readings[:, 1].tolist(),
    }
    suffix = (".csv", ".ndjson", ".json")[number % 3]
    if suffix == ".json":
        text = json.dumps(columns)
    elif suffix == ".ndjson":
        rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
        text = "\n".join(map(json.dumps, rows))
    else:
        text = "\n".join(",".join(map(repr, row)) for row in zip(*columns.values(), strict=True))
        text = ",".join(columns) + "\n" + text
    frames = hybridtof.frames_from_columns(sensor, columns)
    stated = np.column_stack([readings, columns["time_s"]])
    return frames, stated, suffix, (sensor, text)


def _kept(frames: hybridtof.Frames, stated: Array) -> float:
    assert frames.time_s is not None
    found = np.column_stack([frames.readings, frames.time_s])
    # a ratio of subnormal numbers has no roundings to count
    return 0.0 if np.array_equal(found, stated) else math.inf


def _from_columns(number: int) -> float:
    frames, stated, _, _ = _columns(number)
    return _kept(frames, stated)


def _from_file(number: int) -> float:
    _, stated, suffix, (sensor, text) = _columns(number)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"frames{suffix}"
        path.write_text(text + "\n")
        return _kept(hybridtof.read_frames(sensor, path), stated)


DOCUMENTS = (
    Held(
        "parse_sensor",
        "numbers that were stated; r0 and wave number in balls",
        "1: lengths are products",
        2_000,
        _sensor,
    ),
    Held(
        "parse_scene",
        "numbers that were stated, and what is written and read again",
        "1: nothing is computed",
        2_000,
        _scene,
    ),
    Held(
        "frames_from_columns",
        "numbers that were stated, 5e-324 to 1e300",
        "1: nothing is computed",
        1_000,
        _from_columns,
    ),
    Held(
        "read_frames",
        "numbers that were written, CSV, NDJSON and JSON",
        "1: nothing is computed",
        1_000,
        _from_file,
    ),
)
