"""How often a tracker says misfit of healthy streams, and how soon where a fault is planted.

    python -m benchmarks.track_misfits [--tracks 56] [--frames 900]

Objects are as their model, or bare plates and disks of exact optics (diffuse and glossy, square-on
and tilted), known as a calibration knows them: c0, c1, c2 fitted to 40 distances from 0.1 to 2.4 m.
Frames are 1/30 s apart; pulses of 30 ns and waves of 20 MHz by turns. The signal-to-noise ratio in
the middle of the stroke goes from 30 to 3000, the constant light from nothing to as much as the
signal there, the path from at rest to faster than is stated; every third object leaves and returns.

A line a class and fault: tracks that say misfit at all, and quantiles of the time until they
first do (10, 50, 90 %).
"""

import argparse
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from benchmarks.coverage.calibrated_object import calibrated_object
from benchmarks.coverage.classes import CLASSES, at, surface
from inference.tracking.track import track
from simulator.frames import Frames
from simulator.object_model import object_flux
from simulator.optics.assembly import OpticalScene, read
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

Objects = dict[tuple[int, bool], tuple[dict[str, float], Array] | None]

STEP_S = 1 / 30
KNOWN = {"c0": 0.036, "c1": -0.038, "c2": 0.118}
SNRS = (30.0, 100.0, 300.0, 1000.0, 3000.0)
KINDS: tuple[dict[str, Any], ...] = (
    {"kind": "pulsed", "pulse_width_s": 3e-8},
    {"kind": "sine_wave", "frequency_hz": 2e7},
)
# factors on the noise, on the constant light and on the object's, beside what is stated
FAULTS = {
    "healthy": (1.0, 1.0, 1.0),
    "noise 1.5": (1.5, 1.0, 1.0),
    "noise 2": (2.0, 1.0, 1.0),
    "noise 3": (3.0, 1.0, 1.0),
    "crosstalk +3 %": (1.0, 1.03, 1.0),
    "crosstalk +10 %": (1.0, 1.1, 1.0),
    "object +50 %": (1.0, 1.0, 1.5),
    "object +100 %": (1.0, 1.0, 2.0),
}
_SILENT = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1.0, 1.0]}})
_PLATES = [g for g in CLASSES.values() if not (g.crosstalk or g.background)]


def light_of(number: int, exact: bool) -> tuple[dict[str, float], Array] | None:
    """Return what is known of an object, and log range and log light along log distance."""
    distances = np.geomspace(0.1, 2.4, 60)
    if exact:
        c0, c1, c2 = KNOWN["c0"], KNOWN["c1"], KNOWN["c2"]
        flux = [object_flux(r, c0 * c2, c0, c1) for r in distances.tolist()]
        return KNOWN, np.log([distances, np.array(flux)])
    group = _PLATES[number % len(_PLATES)]
    _, plate, radius = surface(group, np.random.default_rng(number))
    known = calibrated_object(plate, radius)
    if known is None:
        return None
    scenes = [OpticalScene(surfaces=(at(plate, radius, d),)) for d in distances.tolist()]
    seen = np.array([read(scene, _SILENT, tolerance=1e-6).mean for scene in scenes])
    return known, np.log([_SILENT.max_range_m * seen[:, 0] / seen[:, 1], seen[:, 1]])


def path_of(rng: np.random.Generator, number: int, count: int) -> Array:
    """Return distances: at rest, slow or fast, between 0.12 and 2.3 m."""
    t = STEP_S * np.arange(count)
    half = 0.5 * rng.uniform(0.2, 1.0) * np.log(2.3 / 0.12)
    middle = rng.uniform(np.log(0.12) + half, np.log(2.3) - half)
    speed = (0.0, 0.1, 0.5, 1.0, 1.5)[number % 5] / half
    rest = rng.uniform(0.0, 6.3)
    return np.asarray(np.exp(middle + half * np.sin(rest + speed * t)))


def first_said(
    number: int, exact: bool, count: int, faults: tuple[float, float, float], objects: Objects
) -> float | None:
    """Return when a track first says misfit [s], infinite: never; None: no such object."""
    if (number, exact) not in objects:
        objects[number, exact] = light_of(number, exact)
    seen = objects[number, exact]
    if seen is None:
        return None
    known, (log_range, log_light) = seen
    rng = np.random.default_rng([number, 7])
    kind = KINDS[number % 2]
    distances = path_of(rng, number, count)
    u = np.log(distances)
    grid = np.log(np.geomspace(0.1, 2.4, 60))
    ranges = np.exp(scipy.interpolate.CubicSpline(grid, log_range)(u))
    light = np.exp(scipy.interpolate.CubicSpline(grid, log_light)(u))
    if number % 3 == 0:
        light = np.where((np.arange(count) // 150) % 2, 0.0, light)
    sensor = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}})
    if kind["kind"] == "pulsed":
        means = np.column_stack([light * ranges / sensor.max_range_m, light])
    else:
        turn = 4 * np.pi * kind["frequency_hz"] / 299792458.0 * ranges
        means = np.column_stack([light * np.cos(turn), light * np.sin(turn)])
    middle = float(np.median(light[light > 0]))
    noise = middle / SNRS[rng.integers(len(SNRS))]
    crosstalk = middle * (0.0, 0.1, 0.3, 1.0)[rng.integers(4)] * np.array([0.6, 0.8])
    if faults[1] != 1.0:
        crosstalk = middle * np.array([0.6, 0.8])
    more, shift, brighter = faults
    readings = brighter * means + shift * crosstalk + more * noise * rng.standard_normal((count, 2))
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    stated = {"object": known, "crosstalk": crosstalk.tolist()}
    frames = Frames(readings, time_s=STEP_S * np.arange(count, dtype=np.float64))
    said = track(sensor, parse_scene(stated), frames).misfit
    return STEP_S * float(np.argmax(said)) if said.any() else float("inf")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=56)
    parser.add_argument("--frames", type=int, default=900)
    arguments = parser.parse_args()
    objects: Objects = {}
    print("| objects | fault | tracks | say misfit | first after s: 10, 50, 90 % |")
    print("|---|---|---|---|---|")
    for exact in (True, False):
        for name, fault in FAULTS.items():
            numbers = range(arguments.tracks)
            every = [first_said(n, exact, arguments.frames, fault, objects) for n in numbers]
            told = np.array([each for each in every if each is not None])
            when = np.quantile(told, [0.1, 0.5, 0.9], method="nearest").round(1)
            of = "as their model" if exact else "plates and disks"
            said = int(np.isfinite(told).sum())
            print(f"| {of} | {name} | {told.size} | {said} | {when} |", flush=True)


if __name__ == "__main__":
    main()
