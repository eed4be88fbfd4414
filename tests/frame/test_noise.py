"""Covariance, whitener and root of two readings' noise against 50 digits."""

import math

import mpmath as mp
import numpy as np
import pytest

from inference.frame.arguments import Instrument, instrument_of
from inference.frame.noise import (
    NoiseParts,
    covariances,
    determinant,
    has_shot,
    in_units,
    noise_of,
    root,
    whitener,
    whiteners,
)
from simulator.sensor import parse_sensor

EPS = float(np.finfo(float).eps)
WAVES = [None, (0.42, 0.1)]


def parts(rng: np.random.Generator) -> NoiseParts:
    """Parts of which the common one may be a million times the others."""
    own1, own2, shared = 10.0 ** rng.uniform(-12, 0, 3)
    common1 = 10.0 ** rng.uniform(-3, 6)
    return NoiseParts(own1, own2, shared, common1, common1 * rng.uniform(-2, 2))


def matrix_of(noise: NoiseParts) -> mp.matrix:
    own1, own2, shared, s1, s2 = (mp.mpf(float(value)) for value in noise)
    cross = shared + s1 * s2
    return mp.matrix([[own1 + shared + s1 * s1, cross], [cross, own2 + shared + s2 * s2]])


def test_determinant_keeps_every_digit() -> None:
    """A sum of squares: no condition number enters, however near singular the matrix is."""
    rng = np.random.default_rng(21)
    with mp.workdps(50):
        for _ in range(200):
            noise = parts(rng)
            wanted = float(mp.det(matrix_of(noise)))
            assert determinant(noise) == pytest.approx(wanted, rel=16 * EPS, abs=0.0)


def test_root_and_whitener_to_a_few_roundings_of_their_elements() -> None:
    """Of every element: those of a near singular matrix that cancel in `v - v12^2 / v11`, too."""
    rng = np.random.default_rng(22)
    with mp.workdps(50):
        for _ in range(200):
            noise = parts(rng)
            exact = mp.cholesky(matrix_of(noise))
            # opposite signs of shared and common parts leave the covariance the rounding of both
            size = abs(noise.shared) + abs(noise.common1 * noise.common2)
            lost = size / abs(noise.shared + noise.common1 * noise.common2)
            for found, wanted in (
                (root(noise), exact),
                (whitener(noise), mp.inverse(exact)),
            ):
                assert found.e11 == pytest.approx(float(wanted[0, 0]), rel=16 * EPS, abs=0.0)
                assert found.e21 == pytest.approx(float(wanted[1, 0]), rel=32 * EPS * lost, abs=0.0)
                assert found.e22 == pytest.approx(float(wanted[1, 1]), rel=16 * EPS, abs=0.0)


def test_units_of_the_read_noise_change_nothing_but_the_unit() -> None:
    noise = parts(np.random.default_rng(23))
    scaled = whitener(in_units(noise, 1e-3))
    assert np.array(scaled) / 1e-3 == pytest.approx(np.array(whitener(noise)), rel=16 * EPS)


@pytest.mark.parametrize("wave", WAVES, ids=["pulsed", "sine_wave"])
@pytest.mark.parametrize("shot", [None, 3e-3])
@pytest.mark.parametrize("relative", [None, 0.02])
def test_array_forms_are_the_definition(
    wave: tuple[float, float] | None, shot: float | None, relative: float | None
) -> None:
    """Early and late photons are independent, and the relative error is common to both."""
    read = (2e-3, 1e-3)
    instrument = Instrument(15.0, wave, read, shot, relative)
    rng = np.random.default_rng(24)
    signals = rng.uniform(0.0, 1.0, (20, 2))
    means = signals + rng.uniform(-0.2, 0.2, (20, 2))
    found = covariances(instrument, means, signals)
    white = whiteners(instrument, means, signals)
    for k in range(len(means)):
        light = (shot or 0.0) * np.abs(means[k])
        wanted = np.diag(np.square(read) + light)
        if wave is None:
            wanted += light.min() * np.array([[0.0, 1.0], [1.0, 0.0]])
        wanted += (relative or 0.0) ** 2 * np.outer(signals[k], signals[k])
        assert found[k] == pytest.approx(wanted, rel=1e-14)
        condition = np.linalg.cond(wanted)
        assert white[k] @ wanted @ white[k].T == pytest.approx(np.eye(2), abs=20 * EPS * condition)


def test_a_frame_is_one_row_of_the_array_form() -> None:
    instrument = Instrument(15.0, None, (2e-3, 1e-3), 3e-3, None)
    noise = noise_of((0.2, 0.5), (0.1, 0.4), instrument)
    assert noise.own1 + noise.shared == pytest.approx(4e-6 + 3e-3 * 0.2, rel=4 * EPS)
    assert noise.shared == pytest.approx(3e-3 * 0.2, rel=4 * EPS)
    assert noise.common1 == noise.common2 == 0.0
    found = whiteners(instrument, np.array([[0.2, 0.5]]), np.array([[0.1, 0.4]]))[0]
    assert math.isclose(found[0, 0], whitener(noise).e11, rel_tol=8 * EPS)


def test_one_machine_code_does_for_shot_noise_relative_noise_and_both() -> None:
    def sizes(**noise: float) -> tuple[float | None, float | None]:
        read = {"read": [2e-3, 1e-3]}
        sensor = {"kind": "pulsed", "pulse_width_s": 1e-7, "gain": 1.0, "noise": read | noise}
        made = instrument_of(parse_sensor(sensor))
        return made.shot, made.relative

    assert sizes() == (None, None)
    assert sizes(shot=3e-3) == (3e-3, 0.0)
    assert sizes(relative=0.02) == (0.0, 0.02)
    assert sizes(shot=3e-3, relative=0.02) == (3e-3, 0.02)
    # a mean that vanishes makes a kink where shot noise is, not where its size is given
    assert [has_shot(shot) for shot in (None, 0.0, 3e-3)] == [False, False, True]
