"""An object as a calibration knows it: the object model, fitted to a surface's exact light."""

import math

import numpy as np

from benchmarks.coverage.classes import at
from simulator.catalogue import PlateScene
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.parametrisation import fit_object
from simulator.sensor import parse_sensor

__all__ = ["calibrated_object"]

_RANGES_M = (0.1, 2.4)
_SILENT = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1.0, 1.0]}})


def calibrated_object(plate: PlateScene, radius: float) -> dict[str, float] | None:
    """Return c0, c1, c2 of a surface; None where its light does not determine them.

    Parameters
    ----------
    plate, radius : PlateScene, float
        As `benchmarks.coverage.classes.surface` has them.
    """
    light, ranges = [], []
    for distance in np.geomspace(*_RANGES_M, 40).tolist():
        scene = OpticalScene(surfaces=(at(plate, radius, distance),))
        first, second = read(scene, _SILENT, tolerance=1e-6).mean
        light.append(second)
        ranges.append(_SILENT.max_range_m * first / second)
    fit = fit_object(np.array(ranges), np.array(light))
    if not (fit.c0 > 0 and fit.c2 > 0 and fit.c1 > -2 * math.sqrt(fit.c0)):
        return None
    return {"c0": fit.c0, "c1": fit.c1, "c2": fit.c2}
