"""Derivatives of the readings along z against 50 digits."""

import mpmath as mp
import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.density.whitened import whitened
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.identifiability.precise import DIGITS, precise_readings
from tests.posterior.scenes import KINDS

LOG_R = np.log([0.05, 0.3, 1.1, 2.7])
# name: median or mean, sigma or sd, whether of the logarithm
PRIORS = {
    "object.c2": (0.1, 0.5, True),
    "crosstalk.0": (0.01, 0.02, False),
    "crosstalk.1": (-0.02, 0.01, False),
    "background.strength": (0.03, 0.7, True),
    "background.shadow.c0": (0.05, 0.3, True),
}
KNOWN = {"object.c0": 0.08, "object.c1": -0.3, "background.distance_m": 4.0}
KNOWN["background.shadow.c1"] = -0.01


def stated(name: str) -> dict[str, object]:
    centre, spread, of_logarithm = PRIORS[name]
    if of_logarithm:
        return {"prior": "lognormal", "median": centre, "sigma": spread}
    return {"prior": "normal", "mean": centre, "sd": spread}


@pytest.mark.parametrize("kind", list(KINDS))
def test_derivatives_along_z_against_fifty_digits(kind: str) -> None:
    """The map from z is differenced: 1e-10 of a derivative, and its rounding 1e-11."""
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [2e-4, 1e-4]}})
    scene = parse_scene(
        {
            "object": {"c0": 0.08, "c1": -0.3, "c2": stated("object.c2")},
            "crosstalk": [stated("crosstalk.0"), stated("crosstalk.1")],
            "background": {
                "strength": stated("background.strength"),
                "distance_m": 4.0,
                "shadow": {"c0": stated("background.shadow.c0"), "c1": -0.01},
            },
        }
    )
    gain = np.array([1.0, 0.5, 1.5, 2.0])
    frames = Frames(np.zeros((4, 2)), gain=gain)
    density = collapsed_density(sensor, scene, frames)
    names = list(PRIORS)
    first = density.parameters.names[1:3]
    assert density.parameters.names == (names[0], *first, *names[3:])
    scene_path = dict(zip(("crosstalk.0", "crosstalk.1"), first, strict=True))
    z = np.random.default_rng(3).standard_normal(len(names))
    found = whitened(sensor, density.parameters, density.frames, z, LOG_R)
    with mp.workdps(DIGITS):

        def readings(at: list[mp.mpf], j: int) -> list[mp.mpf]:
            values = {name: mp.mpf(value) for name, value in KNOWN.items()}
            for name, x in zip(names, at, strict=True):
                centre, spread, of_logarithm = (mp.mpf(part) for part in PRIORS[name])
                value = centre * mp.exp(spread * x) if of_logarithm else centre + spread * x
                values[scene_path.get(name, name)] = value
            # crosstalk is not scaled by a frame's gain
            return precise_readings(sensor, values, mp.exp(mp.mpf(LOG_R[j])), float(gain[j]))

        step = mp.mpf("1e-20")
        here = [mp.mpf(float(x)) for x in z]
        for j in range(LOG_R.size):
            wanted = np.empty((2, z.size))
            for k in range(z.size):
                moved = [x + step * (i == k) for i, x in enumerate(here)]
                ends = zip(readings(moved, j), readings(here, j), strict=True)
                wanted[:, k] = [float((a - b) / step) for a, b in ends]
            wanted /= np.array([[2e-4], [1e-4]])
            scale = np.abs(wanted).max()
            assert found.jacobian[j] == pytest.approx(wanted, rel=1e-8, abs=1e-13 * scale)
