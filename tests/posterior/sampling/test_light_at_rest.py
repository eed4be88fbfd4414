"""The whole light as a coordinate: an object at one known range before unknown crosstalk."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

import hybridtof
from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.static import with_common_range
from inference.posterior.archive import pack_parts, unpack_parts
from inference.posterior.infer import infer
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.flux_coordinate import FluxCoordinate
from inference.posterior.sampling.light_at_rest import LightAtRest
from inference.posterior.sampling.transport import fit_map
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.posterior.scenes import KINDS, data, sensor_of

Array = NDArray[np.float64]

RANGE_M, RULER_M = 0.4, 1e-3
READ, WIDE = 1e-4, 0.3
C0, C2 = (0.1, 1.0), (0.1, 1.0)  # medians and sigmas
HALF: dict[str, Any] = {"prior": "halfnormal", "sd": WIDE}
NORMAL: dict[str, Any] = {"prior": "normal", "mean": 0.0, "sd": WIDE}
CROSSTALK = {"pulsed": [HALF, HALF], "sine_wave": [NORMAL, NORMAL], "mixed": [HALF, NORMAL]}


def laws(sigma: float, median: float) -> dict[str, Any]:
    return {"prior": "lognormal", "median": median, "sigma": sigma}


def scene_of(law: str) -> dict[str, Any]:
    c0, c2 = laws(C0[1], C0[0]), laws(C2[1], C2[0])
    known = {"object": {"c0": c0, "c1": 0.0, "c2": c2}, "crosstalk": CROSSTALK[law]}
    return {**known, "motion": "static", "discrepancy": 0}


def units(kind: str, range_m: Array | float) -> Array:
    """Readings of a flux of one: of a pulse of 100 ns, or a sine wave of 5 MHz."""
    if kind == "pulsed":
        share = np.asarray(range_m) / (0.5 * 299792458.0 * 1e-7)
        return np.stack([share, np.ones_like(share)], axis=-1)
    phase = 4 * math.pi * 5e6 / 299792458.0 * np.asarray(range_m)
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1)


def density_of(kind: str, law: str, known: bool = True, **columns: Any) -> CollapsedDensity:
    sensor = sensor_of(kind)
    names = ("w1", "w2") if kind == "pulsed" else ("i", "q")
    readings = dict(zip(names, 0.05 * np.ones((2, 4)), strict=True))
    if known:
        columns |= {"known_range_m": [RANGE_M, None, None, None]}
        columns |= {"known_range_sd_m": [RULER_M, None, None, None]}
    frames = hybridtof.frames_from_columns(sensor, {**readings, **columns})
    return with_common_range(collapsed_density(sensor, parse_scene(scene_of(law)), frames))


@pytest.mark.parametrize("law", list(CROSSTALK))
@pytest.mark.parametrize("kind", list(KINDS))
def test_it_can_be_undone_and_its_volume_is_what_it_says(kind: str, law: str) -> None:
    density = density_of(kind, law)
    changed = coordinates_of(density)
    assert isinstance(changed, LightAtRest)
    z = 1.5 * np.random.default_rng(1).standard_normal((300, len(density.parameters)))
    y = changed.forward(z)
    # of light that is all but the object's the crosstalk is a difference: 1e-9 of it at least
    np.testing.assert_allclose(changed.backward(y), z, rtol=0, atol=1e-7)
    arrays: dict[str, Any] = {}
    again = unpack_parts(pack_parts(changed, "coordinates", arrays), arrays)
    np.testing.assert_array_equal(again.forward(z), y)
    transport = fit_map(z, changed)
    x, log_det = transport.unbend(z)
    back, log_back = transport.bend(x)
    np.testing.assert_allclose(back, z, rtol=0, atol=1e-6)
    np.testing.assert_allclose(log_back, -log_det, rtol=0, atol=1e-6)
    h, d = 1e-6, z.shape[1]
    for k in range(20):
        steps = np.concatenate([z[k] + h * np.eye(d), z[k] - h * np.eye(d)])
        ends = transport.unbend(steps)[0]
        jacobian = (ends[:d] - ends[d:]) / (2 * h)
        # tables are linear between knots: beside one the two sides differ by a hundredth
        assert np.linalg.slogdet(jacobian)[1] == pytest.approx(log_det[k], abs=0.05)


@pytest.mark.parametrize("kind", list(KINDS))
def test_equal_sums_of_light_are_one_place(kind: str) -> None:
    density = density_of(kind, kind)
    changed = coordinates_of(density)
    assert isinstance(changed, LightAtRest)
    rng, n = np.random.default_rng(2), 500
    c0 = C0[0] * np.exp(rng.standard_normal(n))
    whole = np.array([0.02, 0.03])
    u = units(kind, RANGE_M)
    flux = rng.uniform(0.01, 0.99, n) * float((whole / u).min())
    c2 = flux * RANGE_M**2 * (RANGE_M**2 + c0) / c0
    z = density.parameters.standard(np.column_stack([c0, c2, whole - flux[:, None] * u]))
    # tables of 100 knots a standard deviation, linear between
    assert np.ptp(changed.forward(z)[:, changed.crosstalk], axis=0).max() < 1e-3
    assert np.ptp(z[:, changed.crosstalk], axis=0).max() > 0.05


@pytest.mark.parametrize(
    "columns",
    [{"known": False}, {"object_present": [True, True, True, False]}],
    ids=["range unknown", "an empty frame"],
)
def test_without_one_known_range_of_all_frames_it_is_the_flux_alone(columns: Any) -> None:
    assert isinstance(coordinates_of(density_of("pulsed", "pulsed", **columns)), FluxCoordinate)


def exact(kind: str, readings: Array, noise: float) -> tuple[Array, Array]:
    """Return the mean crosstalk and its standard deviation, shape (2,) each, from prior draws.

    Crosstalk is integrated out of each draw in closed form.
    """
    rng, n = np.random.default_rng(3), 1_000_000
    c0, c2 = (m * np.exp(s * rng.standard_normal(n)) for m, s in (C0, C2))
    r = RANGE_M + RULER_M * rng.standard_normal(n)
    flux = c0 * c2 / (r**2 * (r**2 + c0))
    left = readings - flux[:, None] * units(kind, r)
    wide = math.hypot(WIDE, noise)
    middle, sd = left * (WIDE / wide) ** 2, WIDE * noise / wide
    log_weight = stats.norm.logpdf(left, scale=wide).sum(axis=1)
    mean, square = middle, middle**2 + sd**2
    if kind == "pulsed":  # half normal: the normal law is cut at zero
        log_tail = stats.norm.logcdf(middle / sd)
        hazard = np.exp(stats.norm.logpdf(middle / sd) - log_tail)
        log_weight += log_tail.sum(axis=1)
        mean = middle + sd * hazard
        square = middle**2 + sd**2 + middle * sd * hazard
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    first = weight @ mean
    return first, np.sqrt(weight @ square - first**2)


@pytest.mark.parametrize("kind", list(KINDS))
def test_crosstalk_beside_one_ruled_frame_is_as_by_direct_integration(kind: str) -> None:
    """Eight means, each within 5 of its standard errors: a false alarm in 200,000 runs.

    In the coordinates of the flux alone a mean of these data was six of them off, and the standard
    deviation of the sine wave's crosstalk a fifth too small.
    """
    sensor = sensor_of(kind, snr=7.72e-3 / READ)
    truth = {"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}, "crosstalk": [0.004, 0.02]}
    simulated = data(sensor, truth, frames=10, span=(RANGE_M, RANGE_M * (1 + 1e-12)))
    names = ("w1", "w2") if kind == "pulsed" else ("i", "q")
    columns: dict[str, Any] = dict(zip(names, simulated.frames.readings.T, strict=True))
    told = [RANGE_M] + [None] * 9
    columns |= {"known_range_m": told, "known_range_sd_m": [RULER_M] + [None] * 9}
    frames = hybridtof.frames_from_columns(sensor, columns)
    mean, sd = exact(kind, frames.readings.mean(axis=0), READ / math.sqrt(10))
    for seed in (1, 2):
        settings = SamplerSettings(method="auto", seed=seed, max_seconds=60)
        answer = infer(sensor, parse_scene(scene_of(kind)), frames, settings)
        assert answer.verdict.converged
        for name, wanted, wide in zip(names, mean, sd, strict=True):
            found = answer.parameters[f"crosstalk.{name}"]
            # an ESS of 400 tells its own error to a tenth; the reference adds a thousandth
            error = math.hypot(found.mcse_mean, 2e-3 * float(wide))
            assert abs(found.mean - wanted) < 5 * error
            assert found.sd == pytest.approx(float(wide), rel=0.15)
