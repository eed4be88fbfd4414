"""Bounds of the range where the object is unknown hold for objects with a negative c1, too."""

import numpy as np
import pytest

from inference.estimate import estimate
from simulator.frames import Frames
from simulator.object_arrays import object_fluxes
from simulator.scene import parse_scene
from simulator.sensor import Sensor, SineWaveSensor
from tests.realtime.small_scenes import PULSED, SINE

C0, C2 = 0.05, 0.1
RANGES = np.geomspace(0.03, 3.0, 60)


@pytest.mark.parametrize("s", [-0.648, -0.4, 0.0, 1.0])
@pytest.mark.parametrize("sensor", [PULSED, SINE])
def test_bounds_hold_the_range(sensor: Sensor, s: float) -> None:
    r, c1 = RANGES, s * np.sqrt(C0)
    flux = object_fluxes(r, C0 * C2, C0, c1)
    slope = -flux / r * (2.0 + r * (2.0 * r + c1) / (r * r + c1 * r + C0))
    if isinstance(sensor, SineWaveSensor):
        wave = np.exp(1j * sensor.wave_number * r)
        late = flux * wave, (slope + 1j * sensor.wave_number * flux) * wave
        readings, rates = (np.column_stack([z.real, z.imag]) for z in late)
    else:
        readings = np.column_stack([flux * r / sensor.max_range_m, flux])
        rates = np.column_stack([(slope * r + flux) / sensor.max_range_m, slope])
    scene = parse_scene({"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1.0}] * 2})
    (found,) = estimate(
        sensor, scene, Frames(readings, derivatives=rates), ["differential"]
    ).results
    assert found.range_bounds_m is not None
    low, high = found.range_bounds_m.T
    told = np.isfinite(low)
    assert told.sum() > 30
    assert (low[told] <= r[told] * (1 + 1e-9)).all()
    assert (high[told] >= r[told] * (1 - 1e-9)).all()
