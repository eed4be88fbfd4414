"""Recorded photons through the public interface: what is held to the robot's truth."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.adapters.histograms import Calibration, calibrate, pulsed, sine_wave
from service.adapters.recordings import Recording, read_recording
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor

__all__ = [
    "CROSSTALK",
    "PATH",
    "Answer",
    "calibration_of",
    "conventional_residual_m",
    "crosstalk_answers",
    "near_recording",
    "zeta_and_power_law",
]

Array = NDArray[np.float64]

PATH = Path(__file__).parents[3] / "shared" / "data" / "tmf8820_plane.json"

# photons per Phi / (Phi0 A_D): nobody calibrated the emitter, so c2 has a wide prior
GAIN = 1e6
C2 = {"prior": "lognormal", "median": 1.0, "sigma": 3.0}
# of the signal at 0.2 m, to w1 and w2
CROSSTALK = {
    "a tenth of w2 alone: light that never left the housing": (0.0, 0.1),
    "a tenth of both readings": (0.1, 0.1),
}
# mean relative error of the object parameter model on the scenes of Appendix B
MODEL_ERROR = 0.016


def near_recording(path: Path = PATH) -> Recording:
    """Positions from 0.1 to 0.4 m."""
    recording = read_recording(path)
    return recording.select((recording.distance_m >= 0.1) & (recording.distance_m <= 0.4))


def conventional(sensor: Sensor, frames: Frames) -> tuple[Array, Array]:
    (result,) = estimate(sensor, parse_scene({}), frames, ["conventional"]).results
    return result.range_m, result.sd_m


def calibration_of(recording: Recording) -> Calibration:
    """One affine calibration of the conventional range to the robot's truth."""
    return calibrate(conventional(*pulsed(recording))[0], recording.distance_m)


def conventional_residual_m(recording: Recording, kind: str) -> Array:
    """Conventional range, calibrated, minus the truth [m]."""
    form = pulsed if kind == "pulsed" else sine_wave
    measured, _ = conventional(*form(recording))
    return calibrate(measured, recording.distance_m)(measured) - recording.distance_m


def zeta_and_power_law(recording: Recording, half_width: int = 3) -> tuple[Array, Array, Array]:
    """Zeta from readings alone, and the power law b from flux and the robot's truth.

    Derivatives are differences over +-half_width positions, sent as derivative columns.

    Returns
    -------
    distance_m, zeta, b : ndarray
        Of all positions that have neighbours on both sides.
    """
    sensor, frames = pulsed(recording, calibration_of(recording))
    assert frames.time_s is not None
    m, n = half_width, len(frames)
    inner = slice(m, n - m)
    change = frames.readings[2 * m :] - frames.readings[: n - 2 * m]
    elapsed = frames.time_s[2 * m :] - frames.time_s[: n - 2 * m]
    rates = dataclasses.replace(frames.select(inner), derivatives=change / elapsed[:, None])
    (result,) = estimate(sensor, parse_scene({}), rates, ["differential"]).results
    assert result.zeta is not None
    r = recording.distance_m
    flux = frames.readings[:, 1]
    b = (change[:, 1] / flux[inner]) / ((r[2 * m :] - r[: n - 2 * m]) / r[inner])
    return r[inner], result.zeta, b


@dataclasses.dataclass(frozen=True, eq=False)
class Answer:
    """One row of the table: 90 % intervals against the truth."""

    name: str
    truth_m: Array
    centre_m: Array
    low_m: Array
    high_m: Array
    remark: str = ""

    @property
    def error_m(self) -> Array:
        return self.centre_m - self.truth_m

    @property
    def inside(self) -> float:
        """Share of all positions whose interval holds the truth; no answer holds nothing."""
        return float(np.mean((self.low_m <= self.truth_m) & (self.truth_m <= self.high_m)))

    @property
    def answered(self) -> float:
        return float(np.mean(np.isfinite(self.centre_m)))


def _gaussian(name: str, truth: Array, centre: Array, sd: Array, remark: str = "") -> Answer:
    half = 1.6448536269514722 * sd
    return Answer(name, truth, centre, centre - half, centre + half, remark)


def _posterior(
    name: str, sensor: Sensor, scene: Mapping[str, object], frames: Frames, truth: Array
) -> tuple[Answer, dict[str, float]]:
    result = infer(sensor, parse_scene(scene), frames, SamplerSettings(seed=1))
    ranges = result.range_m
    scale = next(row.status for row in result.identifiability if row.parameter == "range_m")
    remark = "; ".join(
        [
            "converged" if result.verdict.converged else "not converged",
            "misfit" if result.fit.misfit else f"fit p = {result.fit.p_value:.2g}",
            f"scale {scale.replace('_', ' ')}",
        ]
    )
    medians = {key: value.q50 for key, value in result.parameters.items()}
    return Answer(name, truth, ranges.q50, ranges.q05, ranges.q95, remark), medians


def crosstalk_answers(recording: Recording, share: tuple[float, float]) -> list[Answer]:
    """Answers with static crosstalk added: a share of the signal at 0.2 m.

    The object's c0, c1, where they count as known, are the medians of a posterior of the same
    recording without crosstalk.
    """
    truth = recording.distance_m
    sensor, clean = pulsed(recording, calibration_of(recording), gain=GAIN)
    at = int(np.argmin(np.abs(truth - 0.2)))
    signal = clean.readings[at]
    frames = dataclasses.replace(clean, readings=clean.readings + np.array(share) * signal)
    unknown = [{"prior": "halfnormal", "sd": float(value)} for value in signal]
    support = {"prior": "loguniform", "low": 0.05, "high": 1.0}
    free = {"object": {"c2": C2}, "crosstalk": unknown, "range_m": support}

    answers = [_gaussian("conventional", truth, *conventional(sensor, frames))]
    _, medians = _posterior(
        "object", sensor, {"object": {"c2": C2}, "range_m": support}, clean, truth
    )
    c0, c1 = medians["object.c0"], medians["object.c1"]
    known = {"object": {"c0": c0, "c1": c1}, "crosstalk": unknown}
    (result,) = estimate(sensor, parse_scene(known), frames, ["differential"]).results
    remark = f"c0 = {c0:.4g}, c1 = {c1:.4g} known"
    answers.append(_gaussian("differential", truth, result.range_m, result.sd_m, remark))
    answers.append(_posterior("posterior", sensor, free, frames, truth)[0])
    known = {"object": {"c0": c0, "c1": c1, "c2": C2}, "crosstalk": unknown, "range_m": support}
    answer, _ = _posterior("posterior, c0 and c1 known", sensor, known, frames, truth)
    answers.append(answer)
    noise = sensor.noise.model_copy(update={"relative": MODEL_ERROR})
    wide = sensor.model_copy(update={"noise": noise})
    name = f"posterior, relative error {MODEL_ERROR:.1%}"
    answers.append(_posterior(name, wide, free, frames, truth)[0])
    return answers
