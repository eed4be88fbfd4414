"""Recorded photons with injected crosstalk: the cells, and what inference is told of them."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.coverage.intervals import interval_row
from benchmarks.resumable import Row
from inference.posterior.settings import SamplerSettings
from service.recordings import pulsed, sine_wave
from tests.recorded.experiment import C2, GAIN, calibration_of, near_recording

__all__ = ["CELLS", "TERMS", "RecordedCell", "recorded_row"]

SUPPORT = {"low": 0.05, "high": 1.0}
TERMS: Mapping[str, Mapping[str, Any]] = {
    "without": {"range_m": {"prior": "loguniform", **SUPPORT}, "discrepancy": 0},
    "with": {"range_m": {"prior": "reference", **SUPPORT}, "discrepancy": "default"},
}


@dataclasses.dataclass(frozen=True)
class RecordedCell:
    """A sensor, a stroke, and crosstalk as a share of the signal at 0.3 m.

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
    """

    kind: str
    low_m: float
    share: float
    housing: bool

    @property
    def name(self) -> str:
        """Name in the table."""
        where = f" from {'the housing' if self.housing else '0.3 m'}" if self.share else ""
        return f"{self.kind}, {self.low_m:g}-0.4 m, crosstalk {self.share:.0%}{where}"


CELLS = tuple(
    RecordedCell(kind, low, share, housing)
    for kind in ("pulsed", "sine wave")
    for low in (0.2, 0.25, 0.3)
    for share, housing in ((0.0, True), (0.1, True), (0.1, False), (0.3, True), (0.3, False))
)


def recorded_row(term: str, number: int, version: str = "") -> Row:
    """Infer the ranges of a cell; nothing is known of object and crosstalk.

    The prior of the crosstalk is as wide as the signal at 0.3 m.
    """
    cell = CELLS[number]
    recording = near_recording()
    calibration = calibration_of(recording)
    recording = recording.select(recording.distance_m >= cell.low_m - 1e-9)
    truth = recording.distance_m
    form = pulsed if cell.kind == "pulsed" else sine_wave
    sensor, clean = form(recording, calibration, gain=GAIN)
    signal = clean.readings[int(np.argmin(np.abs(truth - 0.3)))]
    size = float(np.hypot(*signal))
    direction = signal / size
    if cell.housing:  # the late window sees nothing of it, and its phase is zero
        direction = np.array([0.0, 1.0]) if cell.kind == "pulsed" else np.array([1.0, 0.0])
    readings = clean.readings + cell.share * size * direction
    frames = dataclasses.replace(clean, readings=readings)
    prior: dict[str, Any] = {"prior": "normal", "mean": 0.0, "sd": size}
    scene = {"object": {"c2": C2}, "crosstalk": [prior, prior], **TERMS[term]}
    if cell.kind == "pulsed":  # windows count photons
        scene["crosstalk"] = [{"prior": "halfnormal", "sd": abs(float(s))} for s in signal]
    settings = SamplerSettings(ensembles=2, seed=number, target_ess=200)
    return interval_row(cell.name, sensor, scene, frames, truth, settings, version)
