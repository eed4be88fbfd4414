"""Derivatives at the ends: none is off by more than a thousand of its roundings."""

import numpy as np

from simulator.sensor import parse_sensor
from tests.extreme.slopes import Slopes, density_errors, worst_slopes

BAR = 1e3


def test_derivatives_are_sharp() -> None:
    """Of mean readings along everything, and of the log density along the range."""
    worst = worst_slopes(60, np.random.default_rng(3))
    assert len(worst) >= 25
    assert {name: found for name, found in worst.items() if not found[0] < BAR} == {}


def test_nothing_cancels_beside_a_large_relative_error() -> None:
    """A relative error 1e8 times the read noise: its share in the slope was off by 1e-8 of it."""
    noise = {"read": [0.018, 4900.0], "relative": 0.42}
    wave = {"kind": "sine_wave", "frequency_hz": 1.24, "phase_offset_rad": 1.22, "gain": 1.1e-6}
    case = Slopes(
        parse_sensor({**wave, "noise": noise}),
        (252690000.8, -31787.38, 2.042e27, -47460482.4, 302845.5, 1648251125.5, 6.58e7, 2.5e7, 911),
        12.0918,
        (128793.1, -620079.9),
        (11.15, 1.7e-3),
    )
    (error,) = density_errors(case).values()
    assert error < BAR
