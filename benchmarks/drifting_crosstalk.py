"""Tracks beside crosstalk that drifts as stated: what is held, by the light, and what is lost.

    python -m benchmarks.drifting_crosstalk [--tracks 240] [--stated 1.0] [--drift 1.0] [--seed S]

Objects are known exactly, 400 frames at 10 or 30 Hz, their motion the stated law of log r between
0.2 and 4 m, their light 30 to 1,000 noises at 0.8 m. Crosstalk is a random walk of 0.5 to 5 noises
a root second, times `--drift`, and is known to two noises before the first frame; no frame is
stated empty. `--stated` times that drift is what the tracker is told; with `--drift 0` it rests,
and no drift is stated. A track is lost where a frame that is called unique, without `misfit`, lies
more than five standard deviations off.
"""

import argparse
import itertools
import secrets
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, track
from simulator.frames import Frames, frames_from_columns
from simulator.object_model import object_flux
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

__all__ = ["Drifting", "drifting", "followed"]

Array = NDArray[np.float64]

FRAMES = 400
RATES_HZ = (30.0, 10.0)
WIDTH_S, FREQUENCY_HZ = 1e-7, 2e7
SPEED_M_S = 299792458.0
NEAREST_M, FARTHEST_M = 0.2, 4.0
C2 = 0.1
KNOWN_TO = 2.0  # noises
FAR = 5.0
LIGHTS = (0.0, 3.0, 10.0, 30.0, np.inf)  # noises


class Drifting(NamedTuple):
    """One recording and its truth."""

    sensor: Sensor
    scene: Scene
    frames: Frames
    range_m: Array
    light: Array  # of the object [noises]
    shape: tuple[float, float]  # c0, c1
    noise: float
    rate_sd: float
    drift: float  # of the crosstalk [reading units a root second]


def _path(rng: np.random.Generator, step: float, rate_sd: float) -> Array:
    """Draw a path of the tracker's own law that stays between the nearest range and the farthest.

    As of the tracker a rate is remembered for a second.
    """
    decay = np.exp(-step)
    fresh = rate_sd * np.sqrt(1.0 - decay**2)
    while True:
        rate, u = rng.normal(0.0, rate_sd), np.log(rng.uniform(0.4, 1.2))
        path = [u]
        for _ in range(FRAMES - 1):
            following = decay * rate + fresh * rng.standard_normal()
            u += 0.5 * (rate + following) * step
            rate = following
            path.append(u)
        if np.log(NEAREST_M) < min(path) and max(path) < np.log(FARTHEST_M):
            return np.exp(path)


def drifting(seed: int, number: int, drift: float = 1.0) -> Drifting:
    """Draw a recording.

    Parameters
    ----------
    seed, number : int
        Of the study and of the recording in it: even ones are of pulses, odd ones of sine waves.
    drift : float
        Factor on the crosstalk's drift.
    """
    rng = np.random.default_rng([seed, number])
    step = 1.0 / RATES_HZ[number // 2 % 2]
    c0 = float(np.exp(rng.normal(np.log(0.08), 0.7)))
    c1 = 2.0 * c0**0.5 * (float(np.exp(rng.normal(-0.15, 0.15))) - 1.0)
    rate_sd = float(rng.uniform(0.1, 0.3))
    range_m = _path(rng, step, rate_sd)
    light = np.asarray(object_flux(range_m, c0 * C2, c0, c1))  # type: ignore[arg-type]
    at = float(object_flux(0.8, c0 * C2, c0, c1))
    noise = at / 10.0 ** float(rng.uniform(1.5, 3.0))
    own = drift * noise * 10.0 ** float(rng.uniform(-0.3, 0.7))
    walk = np.cumsum(rng.standard_normal((FRAMES, 2)), axis=0) * own * step**0.5
    crosstalk = at * rng.uniform(0.05, 0.5, 2) + walk
    spec: dict[str, object]
    if number % 2 == 0:
        early = np.minimum(range_m / (0.5 * SPEED_M_S * WIDTH_S), 1.0)
        spec, names = {"kind": "pulsed", "pulse_width_s": WIDTH_S}, ("w1", "w2")
        shares = np.array([early, np.ones(FRAMES)])
    else:
        phase = 4.0 * np.pi * FREQUENCY_HZ / SPEED_M_S * range_m
        spec, names = {"kind": "sine_wave", "frequency_hz": FREQUENCY_HZ}, ("i", "q")
        shares = np.array([np.cos(phase), np.sin(phase)])
    readings = (light * shares).T + crosstalk + noise * rng.standard_normal((FRAMES, 2))
    sensor = parse_sensor({**spec, "noise": {"read": [noise] * 2}})
    means = (crosstalk[0] + KNOWN_TO * noise * rng.standard_normal(2)).tolist()
    scene = parse_scene(
        {
            "object": {"c0": c0, "c1": c1, "c2": C2},
            "crosstalk": [{"prior": "normal", "mean": m, "sd": KNOWN_TO * noise} for m in means],
        }
    )
    columns = {"time_s": step * np.arange(FRAMES), names[0]: readings[:, 0]}
    frames = frames_from_columns(sensor, {**columns, names[1]: readings[:, 1]})
    return Drifting(sensor, scene, frames, range_m, light / noise, (c0, c1), noise, rate_sd, own)


def followed(of: Drifting, stated: float = 1.0) -> Track:
    """Track a recording, told ``stated`` times the drift; none where crosstalk rests."""
    told = (stated * of.drift,) * 2 if of.drift > 0.0 else None
    settings = TrackingSettings(rate_sd=of.rate_sd, crosstalk_drift=told)
    return track(of.sensor, of.scene, of.frames, settings)


def main(arguments: list[str] | None = None) -> None:
    """Print what is held and lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=240)
    parser.add_argument("--stated", type=float, default=1.0)
    parser.add_argument("--drift", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=None)
    stated = parser.parse_args(arguments)
    seed = secrets.randbits(32) if stated.seed is None else stated.seed
    lost, long, worst, said, answered = 0, 0, 0.0, 0, 0
    rows: list[Array] = []
    for number in range(stated.tracks):
        of = drifting(seed, number, stated.drift)
        found = followed(of, stated.stated)
        told = np.isfinite(found.range_m) & ~found.misfit
        off = np.abs(found.range_m - of.range_m) / found.sd_m
        far = int(np.sum(off[told] > FAR))
        lost, long = lost + (far > 0), long + (far >= 5)
        worst = max(worst, float(off[told].max(initial=0.0)))
        said, answered = said + bool(found.misfit.any()), answered + int(told.sum())
        c0, c1 = of.shape
        at = found.range_m[told]
        seen = np.asarray(object_flux(at, c0 * C2, c0, c1)) / of.noise  # type: ignore[arg-type]
        width = found.sd_m[told] / of.range_m[told]
        rows.append(np.column_stack([seen, off[told] < 1.645, width]))
    all_of = np.concatenate(rows)
    print(
        f"seed {seed}, {stated.tracks} tracks: {lost} lost, {long} of them in five frames or more, "
        f"up to {worst:.1f} sd; {said} say misfit; one range in "
        f"{100.0 * answered / (FRAMES * stated.tracks):.1f} % of the frames"
    )
    for low, high in itertools.pairwise(LIGHTS):
        within = all_of[(all_of[:, 0] >= low) & (all_of[:, 0] < high)]
        if len(within):
            print(
                f"light of the told range {low:g} to {high:g} noises: {len(within)} frames, 90 % "
                f"held {100.0 * within[:, 1].mean():.0f} %, median sd "
                f"{100.0 * np.median(within[:, 2]):.2f} % of the range"
            )


if __name__ == "__main__":
    main()
