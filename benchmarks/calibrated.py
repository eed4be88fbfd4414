"""A calibrated scene on frames that were not in the calibration: single frames and the tracker.

    python -m benchmarks.calibrated [--sets 10] [--kinds exact optics recorded ruled]

Behind a cover glass of which nothing is known, and of an object of which nothing is known, 24
frames over a stroke and five without the object are what `calibrated_scene` is made from. Then the
object goes there and back again through the stroke in frames of its own, and every technique is
asked with the calibrated scene; `conventional, as if without glass` is what one has without.
`joint_fit` is given every eighth of these frames, with the calibrated scene and with what was
stated before the calibration.

`exact` are objects as the model has them (`"discrepancy": 0`), `optics` are plates and disks of
`benchmarks.coverage` (the default error of the model), of both sensors by turns at a
signal-to-noise ratio of 1000 in the middle of the stroke, with crosstalk of a tenth to three tenths
of the signal there. `recorded` are the photons of `docs/recorded.md` with crosstalk of a tenth of
their signal at 0.2 m: every fourth position calibrates, the others are asked; `ruled` the same with
the ranges of the former known to 0.5 mm.

For every technique: frames that it gives one range, the median relative error, the share of 90 %
intervals that hold the truth (and in the set where that share is least), their median width over
the range, and processor time a frame in microseconds, of the second of two calls with the frames of
the first set a hundred times over.
"""

import argparse
import dataclasses
import time
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate

from benchmarks.coverage.classes import KINDS, SNR, SceneClass, at, surface
from inference.estimate import estimate
from inference.posterior.calibrated import calibrated_scene
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from inference.tracking.track import track
from service.adapters.histograms import pulsed
from simulator.frames import Frames
from simulator.optics.assembly import OpticalScene, read
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from tests.recorded.experiment import GAIN, PATH, calibration_of, near_recording

Array = NDArray[np.float64]

_FITTED = 8  # every so many frames are fitted together
_CALIBRATING, _EMPTY, _ASKED, _STEP_S, _REPEATED = 24, 5, 200, 0.05, 100
_RULER_SD_M = 5e-4
_PHOTONS = ("recorded", "ruled")
_Z = 1.6448536269514722  # of a 90 % interval
_BARE = "conventional, as if without glass"
_UNTOLD = "joint_fit, as stated"
_FITS = ("joint_fit", _UNTOLD)
TECHNIQUES = (_BARE, "conventional", "intensity", "intensity_w1", "differential", "tracker", *_FITS)


@dataclasses.dataclass(frozen=True, eq=False)
class Case:
    """Frames to calibrate with, and frames to be asked of, with their true ranges [m]."""

    sensor: Sensor
    stated: Scene
    calibrating: Frames
    asked: Frames
    range_m: Array


def _case(
    kind: dict[str, Any],
    light: Callable[[Array], Array],
    rng: np.random.Generator,
    discrepancy: object,
) -> Case:
    """Make frames of readings without noise, shape (n, 2), as a function of ranges [m]."""
    low = float(np.exp(rng.uniform(np.log(0.1), np.log(0.4))))
    high = low * float(np.exp(rng.uniform(np.log(2.0), np.log(6.0))))
    middle = float(np.hypot(*light(np.array([np.sqrt(low * high)]))[0]))
    noise = middle / SNR
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    crosstalk = rng.uniform(0.1, 0.3) * middle * np.array([rng.uniform(0.0, 0.3), 1.0])
    stroke = np.exp(np.sort(rng.uniform(np.log(low), np.log(high), _CALIBRATING)))
    swing = np.sin(np.linspace(0.0, 2 * np.pi, _ASKED))
    asked = np.sqrt(low * high) * (high / low) ** (0.49 * swing)

    def noisy(ideal: Array) -> Array:
        return ideal + crosstalk + noise * rng.standard_normal(ideal.shape)

    calibrating = noisy(np.concatenate([light(stroke), np.zeros((_EMPTY, 2))]))
    present = np.arange(len(calibrating)) < _CALIBRATING
    unknown = [{"prior": "normal", "mean": 0.0, "sd": middle}] * 2
    stated = parse_scene({"crosstalk": unknown, "discrepancy": discrepancy})
    times = _STEP_S * np.arange(_ASKED, dtype=np.float64)
    return Case(
        sensor,
        stated,
        Frames(calibrating, object_present=present),
        Frames(noisy(light(asked)), time_s=times),
        asked,
    )


def exact(number: int) -> Case:
    """An object as the model has it, drawn from the default prior but for its extremes."""
    rng, kind = np.random.default_rng([1, number]), KINDS[number % 2]
    silent = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}})
    parameters = parameters_of(silent, parse_scene({}))
    z = parameters.sample(rng, 1) * 0.5
    shape = parameters.terms(z).object[0]

    def light(ranges: Array) -> Array:
        return np.array([_light(silent, shape, r) for r in ranges.tolist()])

    return _case(kind, light, rng, 0)


def _light(sensor: Sensor, shape: Array, range_m: float) -> tuple[float, float]:
    c0, c1, c2 = shape.tolist()
    flux = sensor.known_gain * c0 * c2 / (range_m**2 * (range_m**2 + c1 * range_m + c0))
    return _of_flux(sensor, flux, range_m)


def _of_flux(sensor: Sensor, flux: float, range_m: float) -> tuple[float, float]:
    if sensor.kind == "pulsed":
        return flux * range_m / sensor.r0, flux
    phase = sensor.wave_number * range_m
    return flux * float(np.cos(phase)), flux * float(np.sin(phase))


def optics(number: int) -> Case:
    """A plate or a disk, diffuse or glossy, square-on or tilted, through exact optics."""
    group = SceneClass("calibrated")
    rng = np.random.default_rng([zlib.crc32(group.slug.encode()), number])
    kind = KINDS[number % 2]
    _, plate, radius = surface(group, rng)
    silent = parse_sensor({**KINDS[0], "noise": {"read": [1.0, 1.0]}})
    sensor = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}})
    # light over the effective distance, by which ranges are told, from a fine table
    table = []
    for distance in np.geomspace(0.04, 3.5, 120).tolist():
        scene = OpticalScene(surfaces=(at(plate, radius, distance),))
        first, second = read(scene, silent, tolerance=1e-6).mean
        table.append((np.log(silent.max_range_m * first / second), np.log(second)))
    log_r, log_flux = np.array(table).T
    spline = interpolate.CubicSpline(log_r, log_flux)

    def light(ranges: Array) -> Array:
        flux = np.exp(spline(np.log(ranges)))
        return np.array(
            [_of_flux(sensor, f, r) for f, r in zip(flux.tolist(), ranges.tolist(), strict=True)]
        )

    return _case(kind, light, rng, "default")


def recorded(number: int, ruler_sd_m: float | None = None) -> Case:
    """Recorded photons; the number says which of four positions calibrates."""
    recording = near_recording()
    truth = recording.distance_m
    sensor, clean = pulsed(recording, calibration_of(recording), gain=GAIN)
    signal = clean.readings[int(np.argmin(np.abs(truth - 0.2)))]
    crosstalk = 0.1 * signal
    readings = clean.readings + crosstalk
    rng = np.random.default_rng([3, number])
    mine = np.arange(len(truth)) % 4 == number % 4
    read_sd = np.sqrt(np.square(sensor.noise.read) + sensor.noise.shot * crosstalk)
    dark = crosstalk + read_sd * rng.standard_normal((_EMPTY, 2))
    calibrating = np.concatenate([readings[mine], dark])
    present = np.arange(len(calibrating)) < mine.sum()
    stated = parse_scene(
        {
            "object": {"c2": {"prior": "lognormal", "median": 1.0, "sigma": 3.0}},
            "crosstalk": [{"prior": "halfnormal", "sd": float(value)} for value in signal],
        }
    )
    asked = Frames(readings[~mine], time_s=_STEP_S * np.arange((~mine).sum()))
    frames = Frames(calibrating, object_present=present)
    if ruler_sd_m is not None:
        known = np.where(present, np.append(truth[mine], np.zeros(_EMPTY)), np.nan)
        sd = np.where(present, ruler_sd_m, np.nan)
        frames = dataclasses.replace(frames, known_range_m=known, known_range_sd_m=sd)
    return Case(sensor, stated, frames, asked, truth[~mine])


def ruled(number: int) -> Case:
    """The same, with a ruler beside the positions that calibrate."""
    return recorded(number, _RULER_SD_M)


KINDS_OF_DATA: dict[str, Callable[[int], Case]] = {
    "exact": exact,
    "optics": optics,
    "recorded": recorded,
    "ruled": ruled,
}


def answers(case: Case, calibrated: Scene) -> Iterator[tuple[str, Array]]:
    """Yield of each technique errors over the range, the same over sd, and sd over the range."""
    for name in TECHNIQUES:
        found = asked(case, calibrated, name, case.asked)
        if found is None:
            continue
        told = np.isfinite(found.sd_m)
        truth = case.range_m[:: _FITTED if name in _FITS else 1]
        error = np.where(told, found.range_m - truth, np.nan)
        with np.errstate(invalid="ignore"):
            yield (
                name,
                np.array([error / truth, error / found.sd_m, found.sd_m / truth]),
            )


def asked(case: Case, calibrated: Scene, name: str, frames: Frames) -> Any:
    """Ask a technique with the calibrated scene; None where it cannot serve."""
    scene = calibrated
    if name == _BARE:
        nothing = dict.fromkeys(("joint", "calibration", "crosstalk"))
        scene = calibrated.model_copy(update=nothing)
    if name in _FITS:
        frames = dataclasses.replace(frames, time_s=None).select(slice(None, None, _FITTED))
        scene = case.stated if name == _UNTOLD else scene
    if name == "tracker":
        return track(case.sensor, scene, frames)
    results = estimate(case.sensor, scene, frames, [name.partition(",")[0]]).results
    return results[0] if results else None


def cost_us(case: Case, calibrated: Scene, name: str) -> float:
    """Return the processor time that a technique takes for a frame [us]."""
    n = _REPEATED * len(case.asked)
    frames = Frames(
        np.tile(case.asked.readings, (_REPEATED, 1)),
        time_s=_STEP_S * np.arange(n, dtype=np.float64),
    )
    seconds = 0.0
    for _ in range(2):
        begin = time.process_time()
        asked(case, calibrated, name, frames)
        seconds = time.process_time() - begin
    return seconds / n * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=10)
    parser.add_argument("--kinds", nargs="+", choices=KINDS_OF_DATA, default=list(KINDS_OF_DATA))
    parser.add_argument("--verbose", action="store_true", help="say what each posterior says")
    args = parser.parse_args()
    print("| frames | technique | told | error | held | width | us |\n|" + "---|" * 7)
    for kind in args.kinds:
        if kind in _PHOTONS and not PATH.exists():
            continue
        rows: dict[str, list[Array]] = defaultdict(list)
        costs: dict[str, float] = {}
        distances, verdicts = [], []
        count = min(args.sets, 4) if kind in _PHOTONS else args.sets
        for number in range(count):
            case = KINDS_OF_DATA[kind](number)
            posterior = infer(
                case.sensor, case.stated, case.calibrating, SamplerSettings(seed=number)
            )
            scene = calibrated_scene(case.sensor, case.stated, case.calibrating, posterior)
            assert scene.calibration is not None
            verdicts.append((scene.calibration.converged, scene.calibration.misfit))
            distances.append(scene.calibration.distance)
            accept = scene.calibration.model_copy(update={"accept": ("not_converged", "misfit")})
            if args.verbose:
                print(kind, number, posterior.verdict, posterior.fit.reasons, flush=True)
                print(scene.calibration.learnt_error, scene.discrepancy, flush=True)
            taken = scene.model_copy(update={"calibration": accept})
            for name, row in answers(case, taken):
                rows[name].append(row)
                if number == 0 and name not in _FITS:
                    costs[name] = cost_us(case, taken, name)
            if number + 1 == count or args.verbose:
                _print(kind, rows, costs)
        converged, misfit = np.sum(verdicts, axis=0)
        print(
            f"\n{kind}: {len(verdicts)} calibrations, {converged} converged, {misfit} misfits, "
            f"distance from normal {np.median(distances):.3f}, at most {max(distances):.3f}\n",
            flush=True,
        )


def _print(kind: str, rows: Mapping[str, list[Array]], costs: Mapping[str, float]) -> None:
    for name in TECHNIQUES:
        if rows.get(name):
            cost = f"{costs[name]:.2g}" if name in costs else ""
            print(f"| {kind} | {name} | {_cells(rows[name])} | {cost} |", flush=True)


def _cells(rows: list[Array]) -> str:
    error, z, width = np.concatenate(rows, axis=1)
    told = np.isfinite(z)
    if not told.any():
        return "0% | | |"
    held = float(np.mean(np.abs(z[told]) < _Z))
    by_set = [float(np.nanmean(np.abs(row[1]) < _Z)) for row in rows if np.isfinite(row[1]).any()]
    return (
        f"{told.mean():.0%} | {np.median(np.abs(error[told])):.2%} | {held:.0%} "
        f"({min(by_set):.0%} at least) | {2 * _Z * np.median(width[told]):.1%}"
    )


if __name__ == "__main__":
    main()
