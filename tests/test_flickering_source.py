"""A source that flickers moves all of its light: `noise.relative_of`, and what is said without it.

Readings are drawn by the law itself, not by the project's simulator. Of n independent errors a
share 0.9545 lies within two standard deviations, with a standard error of sqrt(0.0434 / n).
"""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.empty_frames import covariance_of_empty
from inference.estimate import estimate
from inference.estimates import Status
from inference.frame.arguments import Instrument, instrument_of
from inference.frame.gaussian import covariance_slope, empty_gaussian, gaussian
from inference.frame.light_by_arrays import gaussian as gaussian_by_arrays
from inference.frame.noise import covariances
from inference.tracking.light import noise_at_light
from inference.tracking.readings_table import ReadingsNoise, noise_root
from inference.tracking.roots import Root
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from service.c_export import export_c
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 3e-8},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7},
}
C0, C1, C2 = 0.06, 0.04, 0.5
OBJECT = {"c0": C0, "c1": C1, "c2": C2}
CROSSTALK = {"pulsed": (0.2, 1.0), "sine_wave": (0.8, -0.6)}
READ, RELATIVE = 1e-4, 5e-3
WAVES = {"pulsed": None, "sine_wave": (1.3, 0.2)}


def sensor_of(kind: str, of: str | None = "source", **more: Any) -> Sensor:
    noise = {"read": [READ, READ], "relative": RELATIVE, **more}
    return parse_sensor(
        {**KINDS[kind], "noise": noise | ({} if of is None else {"relative_of": of})}
    )


def light_of(kind: str, r: Array) -> Array:
    """What an object at these ranges reads, shape (n, 2)."""
    flux = C0 * C2 / (r**2 * (r**2 + C1 * r + C0))
    if kind == "pulsed":
        share = r / (299792458.0 * 3e-8 / 2)
        return np.column_stack([flux * share, flux])
    angle = 4 * math.pi * 2e7 / 299792458.0 * r
    return np.column_stack([flux * np.cos(angle), flux * np.sin(angle)])


def drawn(kind: str, r: Array, rng: np.random.Generator, gain: Array | None = None) -> Array:
    x = light_of(kind, r) + np.array(CROSSTALK[kind])
    x = x if gain is None else x * gain[:, None]
    x = x * (1.0 + RELATIVE * rng.standard_normal((r.size, 1)))
    return np.asarray(x + READ * rng.standard_normal(x.shape))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shot", [None, 3e-3])
def test_all_light_has_the_error(kind: str, shot: float | None) -> None:
    instrument = Instrument(15.0, WAVES[kind], (2e-3, 1e-3), shot, 0.02, True)
    bare = instrument._replace(relative=None)
    rng = np.random.default_rng(1)
    signals = rng.uniform(0.1, 1.0, (20, 2))
    means = signals + rng.uniform(-2.0, 2.0, (20, 2))
    found = covariances(instrument, means, signals)
    without = covariances(bare, means, signals)
    wanted = without + 4e-4 * means[:, :, None] * means[:, None, :]
    assert found == pytest.approx(wanted, rel=1e-13)
    empty = covariances(instrument, means, np.zeros_like(means))
    assert empty == pytest.approx(wanted, rel=1e-13)


def log_density(e: Array, matrix: Array, read: tuple[float, float]) -> float:
    """Of a residual, over the top of the read noise's density."""
    log_size = np.linalg.slogdet(matrix)[1] - 2 * math.log(read[0] * read[1])
    return float(-0.5 * e @ np.linalg.solve(matrix, e) - 0.5 * log_size)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("of_source", [False, True])
def test_densities_and_slopes_are_of_that_covariance(kind: str, of_source: bool) -> None:
    """Slopes against central differences, whose error is some 1e-7 of what they differ by."""
    instrument = Instrument(15.0, WAVES[kind], (2e-3, 1e-3), 3e-3, 0.02, of_source)
    rng = np.random.default_rng(2)
    for _ in range(20):
        mean, signal, slope, own = rng.uniform(0.3, 2.0, (4, 2))
        e = 0.01 * rng.standard_normal(2)

        def density(t: float, m: Array = mean, s: Array = signal, d: Array = slope,
                    o: Array = own, e: Array = e) -> float:  # fmt: skip
            whole, its = m + t * d, s + t * o
            matrix = covariances(instrument, whole[None], its[None])[0]
            return log_density(e, matrix, instrument.read)

        pairs = [(float(a), float(b)) for a, b in (e, mean, signal, slope, own)]
        residual, whole, its, by_whole, by_its = pairs
        assert gaussian(residual, whole, its, instrument) == pytest.approx(density(0.0), rel=1e-9)
        away, all_, part = ((x[:1], x[1:]) for x in (e, mean, signal))
        assert gaussian_by_arrays(away, all_, part, instrument)[0] == pytest.approx(
            density(0.0), rel=1e-9
        )
        found = covariance_slope(residual, whole, by_whole, its, by_its, instrument)
        step = 1e-5
        wanted = (density(step) - density(-step)) / (2 * step)
        assert found == pytest.approx(wanted, rel=1e-5, abs=1e-5)
        nothing = covariances(instrument, mean[None], np.zeros((1, 2)))[0]
        dark = log_density(e, nothing, instrument.read)
        assert empty_gaussian(residual, whole, instrument) == pytest.approx(dark, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_without_crosstalk_nothing_changes(kind: str) -> None:
    """All light is the object's: equal but for rounding, of the ratio and of likelihoods."""
    rng = np.random.default_rng(3)
    ranges = np.linspace(0.3, 1.2, 30)
    x = light_of(kind, ranges)
    x = x * (1.0 + RELATIVE * rng.standard_normal((30, 1))) + READ * rng.standard_normal(x.shape)
    frames = Frames(x)
    scene = parse_scene({"object": OBJECT, "discrepancy": 0})
    found = {}
    for of in ("source", "object"):
        sensor = sensor_of(kind, of)
        singles = ("conventional", "intensity")
        parts = [estimate(sensor, scene, frames, [name]).results[0] for name in singles]
        fit = estimate(sensor, parse_scene({}), frames, ["joint_fit"]).results[0]
        found[of] = np.concatenate([np.column_stack([p.range_m, p.sd_m]) for p in [*parts, fit]])
    # a sine wave's modulus is the square root of a variance along and across the light
    assert found["source"] == pytest.approx(found["object"], rel=2e-3, nan_ok=True)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("technique", ["conventional", "intensity"])
def test_single_frames_are_as_wide_as_they_err(kind: str, technique: str) -> None:
    """2000 frames: within 0.0047, one standard error, and five of them; 0.93 to 0.98."""
    rng = np.random.default_rng(4)
    ranges = rng.uniform(0.3, 0.9, 2000)
    frames = Frames(drawn(kind, ranges, rng))
    scene = parse_scene({"object": OBJECT, "crosstalk": CROSSTALK[kind], "discrepancy": 0})
    held = {}
    for of in ("source", "object"):
        found = estimate(sensor_of(kind, of), scene, frames, [technique]).results[0]
        unique = found.status == Status.UNIQUE
        held[of] = np.mean(np.abs(found.range_m - ranges)[unique] < 2 * found.sd_m[unique])
    assert 0.93 < held["source"] < 0.98
    assert held["object"] < 0.9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("learnt", [False, True])
def test_tracks_and_fits_hold_their_ranges(kind: str, learnt: bool) -> None:
    """Beyond four standard deviations lies one of 16,000; a track smooths what is independent."""
    rng = np.random.default_rng(5)
    n, empty = 100, 8
    ranges = 0.6 * np.exp(0.3 * np.sin(np.linspace(0.0, 6.0, n)))
    dark = np.array(CROSSTALK[kind]) * (1.0 + RELATIVE * rng.standard_normal((empty, 1)))
    dark += READ * rng.standard_normal(dark.shape)
    readings = np.vstack([dark, drawn(kind, ranges, rng)])
    present = np.arange(empty + n) >= empty
    frames = Frames(readings, time_s=np.linspace(0.0, 5.0, empty + n), object_present=present)
    wide = {"prior": "normal", "mean": 0.0, "sd": 2.0}
    crosstalk = [wide, wide] if learnt else CROSSTALK[kind]
    scene = parse_scene({"object": OBJECT, "crosstalk": crosstalk})
    found = track(sensor_of(kind), scene, frames, TrackingSettings())
    assert not found.misfit.any()
    away = np.abs(found.range_m[empty:] - ranges) / found.sd_m[empty:]
    assert np.nanmax(away) < 4.0
    assert np.mean(np.isfinite(away)) > 0.9
    if learnt:
        fit = estimate(sensor_of(kind), scene, frames, ["joint_fit"]).results[0]
        assert fit.fit is not None
        assert not fit.fit["misfit"]


def test_the_flicker_of_learnt_crosstalk_is_that_of_the_light_read() -> None:
    """Where crosstalk is open the light is the reading, with its sign; a prior's mean has none."""
    noise = ReadingsNoise(False, 0.0, 1.0, RELATIVE, False, True)
    wide = Root(1e9, 0.0, 1e9)
    for light in ((4e3, -3e3), (-4e3, -3e3)):
        found = noise_at_light((0.0, 0.0), (0.0, 0.0), light, wide, noise)
        wanted = noise_root(*light, 0.0, 0.0, noise)
        assert np.array(found) == pytest.approx(np.array(wanted), rel=1e-6)


def test_a_window_that_nearly_drowns_knows_of_the_flicker() -> None:
    """Crosstalk ten times the light: the share that is told is open on both sides."""
    rng = np.random.default_rng(6)
    ranges = np.full(4000, 1.5)
    scene = parse_scene({"crosstalk": (2.0, 10.0), "discrepancy": 0})
    x = light_of("pulsed", ranges) + np.array([2.0, 10.0])
    x = x * (1.0 + RELATIVE * rng.standard_normal((4000, 1))) + READ * rng.standard_normal(x.shape)
    found = estimate(sensor_of("pulsed"), scene, Frames(x), ["conventional"]).results[0]
    unique = found.status == Status.UNIQUE
    assert unique.sum() > 1000
    # bounded by twice its diagonal it is wider than it errs, not narrower
    assert np.mean(np.abs(found.range_m - ranges)[unique] < 2 * found.sd_m[unique]) > 0.93


@pytest.mark.parametrize("kind", KINDS)
def test_simulated_readings_flicker_as_stated(kind: str) -> None:
    """The variance along the whole light, of 4000 frames to 2.2 %, one standard error; five."""
    scene = parse_scene({"object": OBJECT, "crosstalk": CROSSTALK[kind], "discrepancy": 0})
    where = SampledTrajectory(range_m=[0.7] * 4000)
    for of in ("source", "object"):
        sensor = sensor_of(kind, of)
        readings = simulate(sensor, scene, where, np.random.default_rng(7)).frames.readings
        mean = light_of(kind, np.array([0.7]))[0]
        mean = mean + np.array(CROSSTALK[kind]) if of == "source" else mean
        wanted = READ**2 + RELATIVE**2 * mean @ mean
        found = np.var(readings @ (mean / np.linalg.norm(mean)))
        assert found == pytest.approx(wanted, rel=0.11)


@pytest.mark.parametrize("kind", KINDS)
def test_empty_frames_flicker(kind: str) -> None:
    light = np.array(CROSSTALK[kind])
    at = sensor_of(kind)
    wanted = covariances(instrument_of(at), light[None], np.zeros((1, 2)))[0]
    assert covariance_of_empty(at, light) == pytest.approx(wanted, rel=1e-12)


def said(of: str | None, scene: dict[str, Any], gain: Array | None = None) -> list[str]:
    ranges = np.linspace(0.5, 0.8, 6)
    x = drawn("sine_wave", ranges, np.random.default_rng(8))
    told = estimate(sensor_of("sine_wave", of), parse_scene(scene), Frames(x, gain=gain))
    return [text for text in told.assumptions if "relative" in text or "gain" in text]


def test_what_is_supposed_of_other_light_is_said() -> None:
    crosstalk = {"crosstalk": CROSSTALK["sine_wave"]}
    (told,) = said(None, crosstalk)
    assert '"relative_of": "source"' in told
    (told,) = said(None, {"background": {"strength": 0.5, "distance_m": 3.0}})
    assert "relative_of" in told
    assert said(None, {}) == said("object", crosstalk) == said("source", crosstalk) == []
    (told,) = said("source", crosstalk, np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]))
    assert "divided by gain" in told
    assert said("source", crosstalk, np.full(6, 0.5)) == []
    assert said("source", {}, np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])) == []


@pytest.mark.parametrize("kind", KINDS)
def test_readings_divided_by_a_gain_that_crosstalk_follows(kind: str) -> None:
    """What `assumptions` ask for holds: noise over the smallest gain is nowhere too small."""
    rng = np.random.default_rng(9)
    ranges = np.geomspace(0.3, 0.9, 2000)
    gain = np.where(ranges < 0.5, 0.25, 1.0)
    x = drawn(kind, ranges, rng, gain)
    scene = parse_scene({"object": OBJECT, "crosstalk": CROSSTALK[kind], "discrepancy": 0})
    wider = sensor_of(kind, read=[READ / 0.25, READ / 0.25])
    divided = estimate(wider, scene, Frames(x / gain[:, None]), ["conventional"]).results[0]
    unscaled = estimate(sensor_of(kind), scene, Frames(x, gain=gain), ["conventional"]).results[0]
    low = gain < 1.0
    held = np.abs(divided.range_m - ranges) < 2 * divided.sd_m
    assert held.mean() > 0.93
    away = np.abs(unscaled.range_m - ranges)[low] > 4 * unscaled.sd_m[low]
    assert np.isnan(unscaled.range_m[low]).any() or away.any()


def test_the_export_to_c_refuses_it() -> None:
    scene = parse_scene({"crosstalk": [0.0, 0.1]})
    with pytest.raises(RefusedError, match="flickers"):
        export_c("conventional", sensor_of("pulsed"), scene)
