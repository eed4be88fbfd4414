"""Errors of a shadow against the readings that they make, by finite differences."""

import numpy as np
import pytest

from inference.frame.arguments import instrument_of
from inference.frame.sensitivity import Value
from inference.frame.shadow_error import shadow_error
from simulator.sensor import parse_sensor

SENSORS: dict[str, dict[str, object]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 3e-8},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 1e7, "phase_offset_rad": 0.3},
}
VALUES = np.array([0.08, -0.03, 0.1, 0.0, 0.0, 0.05, 2.5, 0.06, -0.1])
LOG_R = np.log([0.15, 0.3, 0.6, 1.2, 2.4, np.nan])
FACTORS = np.array([1.0, 2.0, 0.5, 1.0, 1.0, 3.0])
STEP = 1e-5


def moved(kind: str, values: np.ndarray, log_r: np.ndarray, a: np.ndarray) -> np.ndarray:
    instrument = instrument_of(parse_sensor({**SENSORS[kind], "noise": {"read": [1.0, 1.0]}}))
    at = shadow_error(values, log_r, FACTORS, instrument, (0.05, 4.0), 0.2)
    return np.asarray(at.columns @ a)


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_a_wall_that_is_lighter_and_farther_reads_as_such(kind: str) -> None:
    """Of the visible light (1 - S)/sqrt(S), of its distance 1 - S, a tenth each."""
    sensor = parse_sensor({**SENSORS[kind], "noise": {"read": [1.0, 1.0]}})
    instrument = instrument_of(sensor)
    at = shadow_error(VALUES, LOG_R, FACTORS, instrument, (0.05, 4.0), 0.2)
    r, present = np.exp(LOG_R), np.isfinite(LOG_R)
    share = r * (r + VALUES[8]) / (r * (r + VALUES[8]) + VALUES[7])
    share[~present] = 1.0
    phi = at.basis.values(np.where(present, LOG_R, 0.0))
    a = np.random.default_rng(1).standard_normal((2, phi.shape[1]))
    errors = 0.2 * phi @ a.T
    distance = VALUES[6] * (1.0 + STEP * errors[:, 1] * (1.0 - share))
    light = FACTORS * VALUES[5] * share * (1.0 + STEP * errors[:, 0] * (1.0 - share) / share**0.5)

    def read(flux: np.ndarray, far: np.ndarray) -> np.ndarray:
        if instrument.wave is None:
            return np.stack([flux * far / instrument.r0, flux], axis=1)
        phase = instrument.wave[0] * far + instrument.wave[1]
        return np.stack([flux * np.cos(phase), flux * np.sin(phase)], axis=1)

    bare = read(FACTORS * VALUES[5] * share, np.full(6, VALUES[6]))
    expected = (read(light, distance) - bare) / STEP
    # differences of first order err as the step
    np.testing.assert_allclose(at.columns @ a.ravel(), expected, rtol=0, atol=20 * STEP * 0.1)


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_what_errors_do_to_derivatives_is_the_derivative_of_what_they_do(kind: str) -> None:
    instrument = instrument_of(parse_sensor({**SENSORS[kind], "noise": {"read": [1.0, 1.0]}}))
    at = shadow_error(VALUES, LOG_R, FACTORS, instrument, (0.05, 4.0), 0.2)
    a = np.random.default_rng(2).standard_normal((at.columns.shape[2],))
    by_value, along = at.changes(a)
    for k in range(Value.LOG_RANGE):
        step = np.zeros(VALUES.size)
        step[k] = STEP * abs(VALUES[k])
        ends = [moved(kind, VALUES + sign * step, LOG_R, a) for sign in (1.0, -1.0)]
        expected = (ends[0] - ends[1]) / (2.0 * max(step[k], 1e-300))
        # central differences err as the step's square, and roundings as eps over the step
        np.testing.assert_allclose(by_value[:, :, k], expected, rtol=1e-5, atol=1e-9)
    ends = [moved(kind, VALUES, LOG_R + sign * STEP, a) for sign in (1.0, -1.0)]
    np.testing.assert_allclose(along, (ends[0] - ends[1]) / (2 * STEP), rtol=1e-5, atol=1e-9)


def test_what_is_hidden_and_what_is_not_has_no_error_that_is_no_number() -> None:
    """c1' < 0 and r < -c1': nothing is left visible, nor is anything of an empty frame hidden."""
    instrument = instrument_of(parse_sensor({**SENSORS["pulsed"], "noise": {"read": [1.0, 1.0]}}))
    log_r = np.append(np.log([0.05, 0.09]), [*LOG_R[:3], np.nan])
    at = shadow_error(VALUES, log_r, FACTORS, instrument, (0.05, 4.0), 0.2)
    assert not at.columns[[0, 1, 5]].any()
    by_value, along = at.changes(np.ones(at.columns.shape[2]))
    assert np.isfinite(by_value).all()
    assert np.isfinite(along).all()
