"""Two figures that the thesis lacks: convergence of the quadrature, misfit of the model."""

import math
from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from simulator.catalogue import plate_scene
from simulator.optics.appendix_b import DISTANCES_M, sweep
from simulator.optics.brdf import Material, pack_material
from simulator.optics.closed_forms import plane_flux, shell_flux
from simulator.optics.facets import (
    STRETCHED,
    facet_plate,
    facet_polar_grid,
    facet_shell,
)
from simulator.optics.figures.style import axes, note
from simulator.optics.misfit import misfit_curve
from simulator.optics.radiometry import observe
from simulator.optics.surfaces import Disk, Plane, Rectangle, Sphere
from simulator.optics.vectors import Pose

__all__ = ["FIGURES"]

_FLOOR = 1e-16


def _convergence(figure: Figure) -> None:
    ax = axes(
        figure,
        "Convergence: error of the flux against the number of points",
        "points per direction and piece (facets: rings)",
        "relative error",
        x_log=True,
        y_log=True,
    )
    ahead, tilted = Pose(position_m=(0, 0, 1)), Pose(position_m=(0.2, 0.1, 1), normal=(0.3, 0, -1))
    glossy = Material(diffuse=0.0, specular=1.0, roughness=0.1)
    surfaces: dict[str, Plane | Disk | Rectangle | Sphere] = {
        "plane": Plane(pose=ahead),
        "disk": Disk(radius_m=0.4, pose=ahead),
        "disk, tilted": Disk(radius_m=0.4, pose=tilted),
        "square 1 m": Rectangle(width_m=1, height_m=1, pose=ahead),
        "square 40 m": Rectangle(width_m=40, height_m=40, pose=ahead),
        "square 1 m, m = 0.1": Rectangle(width_m=1, height_m=1, pose=tilted, material=glossy),
        "sphere": Sphere(radius_m=0.5, centre_m=(0.2, 0, 1)),
    }
    orders = np.arange(1, 25)
    for name, surface in surfaces.items():
        exact = observe(surface, tolerance=1e-13).flux
        errors = [
            max(abs(observe(surface, points=int(n)).flux / exact - 1), _FLOOR) for n in orders
        ]
        ax.plot(orders, errors, ".-", ms=4, label=name)
    grids = np.array([10, 20, 50, 100, 200, 400])
    facets: dict[str, list[float]] = {"facets, shell": [], "facets, plane": [], "facets, 1 m": []}
    square = observe(surfaces["square 1 m"]).flux
    for n in grids.tolist():
        theta, step = facet_polar_grid(n)
        dull = pack_material(Material())
        one = np.ones(1)
        plane = facet_plate(one, 0.0, math.inf, math.inf, STRETCHED, dull, 0.0, theta, step)
        plate = facet_plate(one, 0.0, 0.5, 0.5, STRETCHED, dull, 0.0, theta, step)
        facets["facets, shell"].append(abs(facet_shell(1.0, n)[0] / shell_flux(1.0) - 1))
        facets["facets, plane"].append(abs(plane[0, 0] / plane_flux(1.0) - 1))
        facets["facets, 1 m"].append(abs(plate[0, 0] / square - 1))
    for name, values in facets.items():
        ax.plot(grids, values, "--", lw=1, label=name)
    ax.axhline(1e-10, color="0.6", lw=0.8)
    ax.set_ylim(_FLOOR / 2, 2)
    ax.legend(fontsize=7, ncols=2)
    note(figure, f"diffuse unless m is given, all at 1 m; errors below {_FLOOR:g} are drawn there")


def _misfit(figure: Figure) -> None:
    ax = axes(
        figure,
        "Misfit of the object parameter model along the range",
        "effective distance $r_e$ [m]",
        "model flux / true flux - 1  [%]",
        x_log=True,
    )
    codes = (
        "W04H04R00T00", "W08H02R00T00", "W01H16R00T00", "W04H04R00T04",
        "W04H04R05T00", "W01H16R05T00", "W01H01R01T00",
    )  # fmt: skip
    for code in codes:
        ranges, flux = sweep(plate_scene(code), "pulsed", converged=True)
        ax.plot(ranges, 100 * misfit_curve(ranges, flux), ".-", ms=3, label=code)
    ax.axhline(0, color="k", lw=0.6)
    ax.legend(fontsize=8)
    low, high = float(DISTANCES_M[0]), float(DISTANCES_M[-1])
    note(
        figure,
        f"true rectangles, fitted on {low:g} to {high:g} m by rows divided by 1/Phi;"
        " R00 diffuse, R05 and R01 Beckmann m = 0.5 and 0.1",
    )


FIGURES: dict[str, Callable[[Figure], None]] = {"convergence": _convergence, "misfit": _misfit}
