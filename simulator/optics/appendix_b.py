"""Appendix B: object parameters of 108 plates, as the thesis made them and as they should be.

The thesis's set-up is in docs/model.md, appendix-b: a facet grid of 100 x 100 whose outline rule is
not the rectangle once the plate is tilted, distances logspace(-2, 0, 40) m, and rows divided by
1/Phi.
"""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from simulator.catalogue import APPENDIX_B, PlateScene
from simulator.optics.brdf import pack_material
from simulator.optics.facets import ELLIPSE, STRETCHED, facet_plate, facet_polar_grid
from simulator.optics.light import Modulation
from simulator.optics.parametrisation import ObjectFit, fit_object
from simulator.optics.radiometry import observe_batch

__all__ = ["DISTANCES_M", "FREQUENCY_HZ", "Row", "System", "rows_as_csv", "simulate", "sweep"]

Array = NDArray[np.float64]
System = Literal["pulsed", "sine_wave"]

DISTANCES_M: Array = np.logspace(-2, 0, 40)
FREQUENCY_HZ = 5e6

# converges the true plates to 1e-8 (benchmarks/optics)
_POINTS = (16, 10)
_GRID = 100


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table.

    Attributes
    ----------
    code : str
        Scene code.
    fit : ObjectFit
        Object parameters; ``fit.error`` is the column "Error", the mean squared relative residual.
    """

    code: str
    fit: ObjectFit

    def printed(self) -> tuple[str, str, str, str, str]:
        """Return code, c0, c1, c2 and error with the digits of the thesis."""
        fit = self.fit
        return (
            self.code,
            f"{fit.c0:.2E}",
            f"{fit.c1:.2E}",
            f"{fit.c2:.2E}",
            f"{fit.error:.2E}",
        )


def sweep(
    scene: PlateScene, system: System, *, converged: bool = False, distances_m: Array = DISTANCES_M
) -> tuple[Array, Array]:
    """Return effective distance and flux of a plate along its ray.

    Parameters
    ----------
    system : "pulsed" or "sine_wave"
        Pulsed: r_e is the mean of r. Sine wave: r_e = arg(sum dPhi exp(j k r))/k at 5 MHz, while
        Phi stays the plain sum (docs/model.md, appendix-b).
    converged : bool
        The true rectangle by convergent quadrature instead of the thesis's facets.
    distances_m : ndarray
        Where the plate's plane cuts the axis [m].

    Returns
    -------
    range_m, flux : ndarray
        Effective distance [m], and Phi / (Phi0 A_D) [1/m^2].
    """
    sine = system == "sine_wave"
    wave_number = 4 * math.pi * FREQUENCY_HZ / speed_of_light if sine else 0.0
    if converged:
        modulation = Modulation(frequency_hz=FREQUENCY_HZ if sine else None)
        plates = [scene.plate(float(d)) for d in distances_m]
        lights = observe_batch(plates, modulation=modulation, points=_POINTS)
        exact = [
            light.phase_distance_m(modulation) if sine else light.distance_m for light in lights
        ]
        return np.array(exact), np.array([light.flux for light in lights])
    theta, step = facet_polar_grid(_GRID)
    sums = facet_plate(
        distances_m,
        scene.tilt_rad,
        0.5 * scene.width_m,
        0.5 * scene.height_m,
        STRETCHED if sine else ELLIPSE,
        pack_material(scene.material),
        wave_number,
        theta,
        step,
    )
    flux = sums[:, 0]
    phases = np.arctan2(sums[:, 3], sums[:, 2])
    return np.asarray(phases / wave_number if sine else sums[:, 1] / flux), flux


def simulate(
    system: System,
    *,
    converged: bool = False,
    scenes: Sequence[PlateScene] = APPENDIX_B,
) -> Iterator[Row]:
    """Yield the rows of a system's tables.

    Parameters
    ----------
    system : "pulsed" or "sine_wave"
        Tables B.1 to B.4, or B.5 to B.8.
    converged : bool
        True rectangles instead of the thesis's facets.
    scenes : sequence of PlateScene
        Default: the thesis's 108, in its order.
    """
    for scene in scenes:
        ranges, flux = sweep(scene, system, converged=converged)
        yield Row(scene.code, fit_object(ranges, flux))


def rows_as_csv(rows: Sequence[Row]) -> str:
    """Return the rows as CSV with the header code,c0,c1,c2,error."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["code", "c0", "c1", "c2", "error"])
    writer.writerows(row.printed() for row in rows)
    return out.getvalue()
