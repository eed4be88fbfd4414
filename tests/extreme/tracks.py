"""Tracks at the ends: light over 60 decades, lengths over 12, noise over 14, times over 12."""

import dataclasses
import math
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, track
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings, simulate
from simulator.trajectories import SampledTrajectory
from tests.tracking.reference import GridFilter
from tests.tracking.scenes import wander

__all__ = ["TrackCase", "TrackVerdict", "grid_miss", "holes_of", "random_track", "verdict_of"]

Array = NDArray[np.float64]

_LIGHT_M_S = 299792458.0
_CELLS = 4.0  # of a grid that a standard deviation must be wide


@dataclasses.dataclass(frozen=True, eq=False)
class TrackCase:
    """A stream, as documents, and what is true of it.

    Attributes
    ----------
    number : int
        From which it is drawn again.
    sensor, scene : dict
        Documents.
    settings : TrackingSettings
        The motion from which the path was drawn.
    ranges : ndarray, shape (n,)
        True ranges [m].
    frames : Frames
    snr : float
        Light in the middle of the ranges over the read noise.
    """

    number: int
    sensor: dict[str, Any]
    scene: dict[str, Any]
    settings: TrackingSettings
    ranges: Array
    frames: Frames
    snr: float

    @property
    def parsed(self) -> tuple[Sensor, Scene]:
        """Sensor and scene."""
        return parse_sensor(self.sensor), parse_scene(self.scene)

    @property
    def bright(self) -> NDArray[np.bool_]:
        """Frames whose light is 1e2 to 1e12 times the noise of an empty scene, shape (n,)."""
        sensor, scene = self.parsed
        terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
        empty = mean_readings(sensor, terms, np.full(1, np.inf))
        noise = np.sqrt(np.square(sensor.noise.read) + sensor.noise.shot * np.abs(empty))
        light = np.abs(mean_readings(sensor, terms, self.ranges) - empty) / noise
        return np.asarray((light > 1e2).any(axis=1) & (light < 1e12).all(axis=1))

    def tracked(self) -> Track:
        """Track it; raises what the tracker raises."""
        return track(*self.parsed, self.frames, self.settings)


class TrackVerdict(NamedTuple):
    """What came of a stream: whether it was refused, what is wrong, how far a range is off."""

    refused: str
    wrong: tuple[str, ...]
    worst: float  # standard deviations; nan where no frame has one range


def random_track(number: int, faint: bool = False) -> TrackCase:
    """Draw a stream whose scene, noise and motion are as stated.

    Parameters
    ----------
    number : int
        Of the stream.
    faint : bool
        Whether it is one that a dense grid can follow: read noise alone, an exact model, next to no
        outliers, and signal-to-noise ratios up to 1e3.
    """
    rng = np.random.default_rng([23, number])
    size, unit = 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-30, 30)
    seconds = 10.0 ** rng.uniform(-6, 6)
    rate_time = seconds * 10.0 ** rng.uniform(-2, 2)
    # so far between two frames, in the logarithm
    way = 10.0 ** rng.uniform(-4, -1.3 if faint else 0)
    rate_sd = way / math.sqrt(seconds * min(seconds, rate_time))
    stay = (20 if faint else 1e4) * seconds
    settings = TrackingSettings(
        rate_sd=rate_sd,
        rate_time_s=rate_time,
        visit_s=stay,
        absence_s=stay,
        outlier=1e-9 if faint else 1e-3,
    )
    count = int(rng.choice([1, 2, 8, 20]))
    start = math.log(size), rate_sd * rng.standard_normal()
    ranges = np.exp(wander(rng, count, settings, start, seconds)[0])
    rests = not faint and rng.random() < 0.3
    if rests:
        ranges = np.full(count, size)
    near, far = ranges.min() * 10 ** rng.uniform(-2, -0.1), ranges.max() * 10 ** rng.uniform(0.1, 2)
    scene, light = _scene(rng, size, far, unit, faint)
    scene["range_m"] = {"prior": "loguniform", "low": float(near), "high": float(far)}
    scene["motion"] = "static" if rests else "radial"
    snr = 10.0 ** rng.uniform(-2, 3 if faint else 12)
    read = light / snr
    noise: dict[str, Any] = {"read": [read, read * 10 ** rng.uniform(-1, 1)]}
    if not faint and rng.random() < 0.3:
        noise["shot"] = read * 10 ** rng.uniform(-6, 3)
    if not faint and rng.random() < 0.3:
        noise["relative"] = 10 ** rng.uniform(-6, -0.5)
    # a number below 1e-50 is refused
    if min(noise["read"] + [noise.get("shot", read)]) < 1e-49:
        return random_track(number + 1_000_000, faint)
    sensor: dict[str, Any] = {"gain": unit, "noise": noise}
    if rng.random() < 0.5:
        sensor |= {"kind": "pulsed", "pulse_width_s": 4.4 * float(far) / _LIGHT_M_S}
    else:
        sensor |= {"kind": "sine_wave", "frequency_hz": _LIGHT_M_S / 4.4 / float(far)}
    times = (seconds * np.arange(count)).tolist()
    path = SampledTrajectory(range_m=ranges.tolist(), time_s=times)
    shown = simulate(parse_sensor(sensor), parse_scene(scene), path, number)
    return TrackCase(number, sensor, scene, settings, ranges, shown.frames, snr)


def _scene(
    rng: np.random.Generator, size: float, far: float, unit: float, faint: bool
) -> tuple[dict[str, Any], float]:
    """Draw a scene in numbers, and the light that its object sends from one range."""
    c0 = size**2 * 10 ** rng.uniform(-4, 4)
    lean = 10.0 ** rng.uniform(-4, 1) - 1 if rng.random() < 0.3 else rng.uniform(-0.9, 0.9)
    c1, c2 = 2 * math.sqrt(c0) * lean, 10.0 ** rng.uniform(-6, 6)
    light = unit * c0 * c2 / (size**2 * ((size + c1 / 2) ** 2 + c0 - c1**2 / 4))
    scene: dict[str, Any] = {"object": {"c0": c0, "c1": c1, "c2": c2}, "discrepancy": 0}
    if not faint and rng.random() < 0.5:
        scene["discrepancy"] = {
            "flux": 10 ** rng.uniform(-12, 0),
            "range_m": size * 10 ** rng.uniform(-12, 0),
        }
    if rng.random() < 0.3:
        scene["background"] = {
            "strength": light * 10 ** rng.uniform(-3, 3),
            "distance_m": float(far) * 10 ** rng.uniform(0.01, 0.3),
            "shadow": {"c0": c0 * 0.7, "c1": 0.1 * math.sqrt(c0)},
        }
    if rng.random() < 0.3:
        scene["crosstalk"] = (light * 10 ** rng.uniform(-3, 1, 2)).tolist()
    return scene, float(light)


def holes_of(found: Track) -> tuple[str, ...]:
    """Return what is not finite, or has no status that says so."""
    wrong = [
        name
        for name in ("present", "outlier", "surprise")
        if not np.isfinite(getattr(found, name)).all()
    ]
    one = found.status == Status.UNIQUE
    numbers = (found.range_m, found.sd_m, found.rate_m_s, found.rate_sd_m_s, found.weight)
    if not all(np.isfinite(values[one]).all() for values in numbers):
        wrong.append("a unique range")
    if not (found.sd_m[one] > 0).all():
        wrong.append("a standard deviation of nothing")
    if not (np.isfinite(np.stack(found.sd_parts_m))[:, one]).all():
        wrong.append("parts of a standard deviation")
    listed = np.isfinite(found.hypotheses_m)
    wrong += [
        name
        for name in ("hypotheses_sd_m", "hypotheses_weight")
        if not np.array_equal(np.isfinite(getattr(found, name)), listed)
    ]
    if (~listed.any(axis=1) & (found.status != Status.NONE)).any():
        wrong.append("a status without ranges")
    return tuple(wrong)


def verdict_of(case: TrackCase) -> TrackVerdict:
    """Track a stream; whatever warns, or is not finite without its status, is wrong."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            found = case.tracked()
        except RefusedError as error:
            return TrackVerdict(str(error), (), math.nan)
    lost = tuple(f"frame {i}: lost" for i in np.flatnonzero(case.bright & (found.present < 0.5)))
    miss = np.abs(np.log(found.range_m / case.ranges)) * found.range_m / found.sd_m
    worst = float(np.nanmax(miss)) if np.isfinite(miss).any() else math.nan
    return TrackVerdict("", (*holes_of(found), *lost), worst)


def grid_miss(case: TrackCase) -> float | None:
    """Follow a faint stream with a filter on a dense grid, which leaves nothing out.

    Returns
    -------
    float or None
        By how much P(an object is there, and nearer than r) differs, at worst over all r and all
        frames as long as the grid's cells are finer than what it knows; None where the tracker
        refuses.
    """
    law = case.scene["range_m"]
    try:
        found = case.tracked()
    except RefusedError:
        return None
    grid = GridFilter(*case.parsed, case.settings, (law["low"], law["high"]), 2048, 41)
    share = (np.arange(grid.u.size) + 0.5) / grid.u.size
    assert case.frames.time_s is not None
    worst = 0.0
    for i, readings in enumerate(case.frames.readings):
        if i:
            grid.move(float(case.frames.time_s[i] - case.frames.time_s[i - 1]))
        grid.see(readings)
        weight = np.nan_to_num(found.hypotheses_weight[i])
        listed = weight > 0
        own = weight[listed]
        sd = found.hypotheses_sd_m[i, listed] / found.hypotheses_m[i, listed]
        # of several modes each is narrower than all of them
        narrowest = min(grid.moments()[1], float(sd[own > 0.01].min(initial=np.inf)))
        if narrowest < _CELLS * (grid.u[1] - grid.u[0]):
            break
        cells = grid.mass.sum(axis=1)
        exact = np.cumsum(cells) - 0.5 * cells
        x = (grid.u[:, None] - np.log(found.hypotheses_m[i, listed])) / sd
        # of the rest only that it may be there is known
        below = special.ndtr(x) @ own + (found.present[i] - own.sum()) * share
        worst = max(worst, float(np.abs(below - exact).max()))
    return worst
