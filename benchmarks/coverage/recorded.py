"""Recorded photons with injected crosstalk: the cells, and what inference is told of them."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.classes import TERMS, settings_of
from benchmarks.coverage.intervals import interval_row
from benchmarks.resumable import Row
from service.adapters.histograms import pulsed, sine_wave
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.recorded.experiment import C2, GAIN, calibration_of, near_recording

__all__ = ["CELLS", "EMPTY", "RecordedCell", "recorded_frames", "recorded_row"]

EMPTY = 5  # frames without object, where there are any
_RANGE_M = 0.3  # of the signal that crosstalk is compared with


@dataclasses.dataclass(frozen=True)
class RecordedCell:
    """A sensor, a stroke, crosstalk as a share of the signal at 0.3 m, and frames without object.

    Attributes
    ----------
    kind : "pulsed" or "sine wave"
        Which readings are formed of the photons.
    low_m : float
        Where the stroke to 0.4 m begins [m].
    share : float
        Modulus of the crosstalk over that of the signal at 0.3 m.
    housing : bool
        Whether it is light that never left the housing, at zero distance; otherwise it looks as if
        it came from 0.3 m.
    empty : int
        Frames of the crosstalk alone, with noise as the sensor states it.
    """

    kind: str
    low_m: float
    share: float
    housing: bool
    empty: int

    @property
    def name(self) -> str:
        """Name in the table."""
        where = f" from {'the housing' if self.housing else '0.3 m'}" if self.share else ""
        light = f"crosstalk {self.share:.0%}{where}, {self.empty} empty"
        return f"{self.kind}, {self.low_m:g}-0.4 m, {light}"


CELLS = tuple(
    RecordedCell(kind, low, share, housing, empty)
    for empty in (EMPTY, 0)
    for low in (0.1, 0.2)
    for share, housing in ((0.1, True), (0.1, False), (0.3, True), (0.3, False))
    for kind in ("pulsed", "sine wave")
)


def recorded_row(term: str, number: int, version: str = "") -> Row:
    """Infer the ranges of a cell; intervals are those of the frames with an object."""
    cell = CELLS[number]
    sensor, scene, frames, truth = recorded_frames(cell, number)
    settings, told = settings_of(term, number), {**scene, **TERMS[term]}
    return interval_row(cell.name, sensor, told, frames, truth, settings, version)


def recorded_frames(
    cell: RecordedCell, seed: int
) -> tuple[Sensor, dict[str, Any], Frames, NDArray[np.float64]]:
    """Return the sensor, what is told of the scene, the frames, and their ranges [m].

    Nothing is told of object and crosstalk. The prior of the crosstalk is as wide as the signal at
    0.3 m. Frames without an object are drawn from the seed; their range is nan.
    """
    recording = near_recording()
    calibration = calibration_of(recording)
    recording = recording.select(recording.distance_m >= cell.low_m - 1e-9)
    truth = recording.distance_m
    form = pulsed if cell.kind == "pulsed" else sine_wave
    sensor, clean = form(recording, calibration, gain=GAIN)
    signal = clean.readings[int(np.argmin(np.abs(truth - _RANGE_M)))]
    size = float(np.hypot(*signal))
    direction = signal / size
    if cell.housing:  # the late window sees nothing of it, and its phase is zero
        direction = np.array([0.0, 1.0]) if cell.kind == "pulsed" else np.array([1.0, 0.0])
    crosstalk = cell.share * size * direction
    absent = SampledTrajectory(range_m=[1.0] * EMPTY, object_present=[False] * EMPTY)
    known = parse_scene({"crosstalk": crosstalk.tolist()})
    empty = simulate(sensor, known, absent, seed).frames.readings[: cell.empty]
    present = np.arange(truth.size + cell.empty) < truth.size
    frames = Frames(
        np.concatenate([clean.readings + crosstalk, empty]),
        object_present=present if cell.empty else None,
    )
    truth = np.concatenate([truth, np.full(cell.empty, np.nan)])
    prior: dict[str, Any] = {"prior": "normal", "mean": 0.0, "sd": size}
    scene = {"object": {"c2": C2}, "crosstalk": [prior, prior]}
    if cell.kind == "pulsed":  # windows count photons
        scene["crosstalk"] = [{"prior": "halfnormal", "sd": abs(float(s))} for s in signal]
    return sensor, scene, frames, truth
