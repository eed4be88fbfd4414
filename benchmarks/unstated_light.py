"""Light that a scene does not state: crosstalk that drifts, a second object, a wall, a tilt.

Five empty frames come first, or come first and last, of 30 frames of a disk of 15 cm radius from
0.25 to 1.8 m behind unknown crosstalk; the noise is 1/300 of the median light. A table says how far
a ``joint_fit`` is off, in its own standard deviations, and in how many sets it says misfit.

    python -m benchmarks.unstated_light --sets 4
"""

import argparse
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

_LIGHT_SPEED = 299_792_458.0
_PULSE_S, _FREQUENCY_HZ = 3e-8, 2e7
_EMPTY, _FRAMES = 5, 30


class Outcome(NamedTuple):
    """What one fit said."""

    worst: float  # largest error, in standard deviations
    misfit: bool


def disk(z: Array, radius: float, reflectance: float) -> tuple[Array, Array]:
    """Return effective distance [m] and flux of a diffuse disk on the axis, by exact integrals."""
    cosine = z / np.sqrt(z * z + radius * radius)
    r = 1.2 * z * (1 - cosine**5) / (1 - cosine**6)
    return r, 2.0 / (6.0 * np.pi * z * z) * (1 - cosine**6) * reflectance


def readings(kind: str, r: Array, flux: Array) -> Array:
    """Return readings without noise, shape (n, 2)."""
    if kind == "pulsed":
        late = np.minimum(r / (_LIGHT_SPEED * _PULSE_S / 2), 1.0)
        return np.asarray(flux[:, None] * np.stack([late, np.ones_like(r)], axis=1))
    phase = 4 * np.pi * _FREQUENCY_HZ / _LIGHT_SPEED * r
    return np.asarray(flux[:, None] * np.stack([np.cos(phase), np.sin(phase)], axis=1))


def one(
    kind: str,
    seed: int,
    drift: float = 0.0,
    last: bool = False,
    second: bool = False,
    wall: bool = False,
    tilt: float = 0.0,
    relative: float = 0.0,
) -> Outcome:
    """Fit one set.

    Parameters
    ----------
    kind : str
        Of the sensor.
    seed : int
        Of the noise.
    drift : float
        Of the crosstalk in the course of the recording, relative.
    last : bool
        Whether empty frames come last, too.
    second : bool
        Whether a disk of 10 cm radius rests at 1.5 m wherever the object is there.
    wall : bool
        Whether a wall of 3 m radius stands at 3 m, which empty frames show.
    tilt : float
        By how much the disk turns to and fro, half a time on its way [degrees]: of a small diffuse
        surface the light follows the square of the cosine.
    relative : float
        Error of the signal that is stated.
    """
    rng = np.random.default_rng(seed)
    z = np.geomspace(0.25, 1.8, _FRAMES)
    r, flux = disk(z, 0.15, 0.6)
    turned = np.radians(tilt) * np.sin(np.linspace(0.0, np.pi, _FRAMES) + seed)
    flux = flux * np.cos(turned) ** 2
    light = readings(kind, r, flux)
    if second:
        light = light + readings(kind, *disk(np.array([1.5]), 0.1, 0.5))
    after = _EMPTY if last else 0
    behind = np.zeros((1, 2))
    if wall:
        behind = readings(kind, *disk(np.array([3.0]), 3.0, 0.5))
        # what the object hides is a disk of the wall, as seen from the sensor
        hidden = [disk(np.array([3.0]), 0.15 * 3.0 / near, 0.5) for near in z]
        light = light + behind - np.vstack([readings(kind, *each) for each in hidden])
    bare = np.vstack([behind.repeat(_EMPTY, 0), light, behind.repeat(after, 0)])
    n = len(bare)
    median = float(np.median(flux))
    crosstalk = median * np.array([0.3, 1.0])
    sd = median / 300.0
    seen = bare + crosstalk * (1 + np.linspace(0.0, drift, n)[:, None])
    present = np.zeros(n, dtype=np.bool_)
    present[_EMPTY : _EMPTY + _FRAMES] = True
    frames = Frames(seen + rng.normal(0.0, sd, (n, 2)), object_present=present)
    timing: dict[str, Any] = (
        {"pulse_width_s": _PULSE_S} if kind == "pulsed" else {"frequency_hz": _FREQUENCY_HZ}
    )
    sensor = parse_sensor(
        {"kind": kind, **timing, "noise": {"read": [sd, sd], "relative": relative}}
    )
    prior = {"prior": "halfnormal", "sd": 3 * median}
    if kind != "pulsed":
        prior = {"prior": "normal", "mean": 0.0, "sd": 3 * median}
    scene = parse_scene({"crosstalk": [prior, prior]})
    (result,) = estimate(sensor, scene, frames, ["joint_fit"]).results
    assert result.fit is not None  # of every fit
    away = np.abs(result.range_m[present] - r) / result.sd_m[present]
    worst = float(np.nanmax(away)) if np.isfinite(away).any() else float("nan")
    return Outcome(worst, bool(result.fit["misfit"]))


def row(name: str, sets: list[Outcome]) -> str:
    """Return a row of the table."""
    silent = [each.worst for each in sets if not each.misfit]
    said = f"{min(silent):.1f} to {max(silent):.1f}" if silent else "-"
    return f"| {name} | {len(sets) - len(silent)} of {len(sets)} | {said} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=4)
    sets = range(parser.parse_args().sets)
    print("| | misfit | off where none is said, standard deviations |\n|---|---|---|")
    for last in (False, True):
        where = "first and last" if last else "first"
        for drift in (0.0, 0.01, 0.03, 0.05, 0.1, 0.2):
            found = [one("pulsed", seed, drift, last) for seed in sets]
            print(row(f"drift {drift:.0%}, empty frames {where}", found), flush=True)
    for kind in ("pulsed", "sine_wave"):
        found = [one(kind, seed, second=True) for seed in sets]
        print(row(f"second object, {kind}", found), flush=True)
        found = [one(kind, seed, wall=True) for seed in sets]
        print(row(f"a wall at 3 m, {kind}", found), flush=True)
        for relative in (0.0, 0.2):
            for tilt in (25.0, 40.0):
                found = [one(kind, seed, tilt=tilt, relative=relative) for seed in sets]
                told = f", noise.relative {relative:g}" if relative else ""
                print(row(f"tilts by {tilt:g} degrees, {kind}{told}", found), flush=True)


if __name__ == "__main__":
    main()
