"""Figures 2-6 to 2-13: the thesis's facets against the closed forms of a shell and a plane."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from simulator.optics.brdf import Material, pack_material
from simulator.optics.closed_forms import plane_distance, plane_flux, shell_flux
from simulator.optics.facets import STRETCHED, facet_plate, facet_polar_grid, facet_shell
from simulator.optics.figures.style import axes, note

__all__ = ["FIGURES"]

Array = NDArray[np.float64]

_DISTANCES: Array = np.linspace(0.1, 2.0, 39)
_GRIDS = (20, 50, 100, 200)
_NOTE = "uniform emitter and detector at one point, diffuse surface; facets: n x n polar grid"


def _facets(scene: str, n: int) -> tuple[Array, Array]:
    """Return flux per Phi0 A_D and effective distance of the facets."""
    if scene == "shell":
        pairs = np.array([facet_shell(float(d), n) for d in _DISTANCES])
        return pairs[:, 0], pairs[:, 1]
    theta, step = facet_polar_grid(n)
    material = pack_material(Material())
    sums = facet_plate(_DISTANCES, 0.0, math.inf, math.inf, STRETCHED, material, 0.0, theta, step)
    return sums[:, 0], sums[:, 1] / sums[:, 0]


def _exact(scene: str) -> tuple[Array, Array]:
    if scene == "shell":
        return np.array([shell_flux(float(d)) for d in _DISTANCES]), _DISTANCES
    flux = [plane_flux(float(d)) for d in _DISTANCES]
    return np.array(flux), np.array([plane_distance(float(d)) for d in _DISTANCES])


_NAMES = {"shell": "spherical shell", "plane": "infinite plane"}


def _intensity(figure: Figure, scene: str, number: str) -> None:
    title = f"Figure {number}: distance v.s. intensity, {_NAMES[scene]}"
    ax = axes(figure, title, "distance d [m]", r"$\Phi/(\Phi_0 A_D)$ [1/m²]", y_log=True)
    ax.plot(_DISTANCES, _exact(scene)[0], "k-", label="closed form")
    ax.plot(_DISTANCES, _facets(scene, 100)[0], "C1o", ms=4, mfc="none", label="facets, n = 100")
    ax.legend()
    note(figure, _NOTE)


def _time(figure: Figure, scene: str, number: str) -> None:
    title = f"Figure {number}: distance v.s. time of flight, {_NAMES[scene]}"
    ax = axes(figure, title, "distance d [m]", "time of flight [ns]")
    to_ns = 2e9 / speed_of_light
    ax.plot(_DISTANCES, _exact(scene)[1] * to_ns, "k-", label="closed form")
    facets = _facets(scene, 100)[1] * to_ns
    ax.plot(_DISTANCES, facets, "C1o", ms=4, mfc="none", label="facets, n = 100")
    ax.legend()
    note(figure, _NOTE)


def _error(figure: Figure, scene: str, number: str, column: int) -> None:
    quantity = ("intensity", "time of flight")[column]
    title = f"Figure {number}: distance v.s. simulation error in {quantity}, {_NAMES[scene]}"
    ax = axes(figure, title, "distance d [m]", "relative error of the facets", y_log=True)
    exact = _exact(scene)[column]
    floor = 1e-16
    least = 1.0
    for n in _GRIDS:
        error = np.maximum(np.abs(_facets(scene, n)[column] / exact - 1.0), floor)
        ax.plot(_DISTANCES, error, ".-", label=f"n = {n}")
        least = min(least, float(np.min(error)))
    ax.set_ylim(least / 3, 0.1 if least > 1e-10 else 1e-12)
    ax.legend(ncols=2, loc="upper right")
    note(figure, _NOTE + f"; errors below {floor:g} are drawn there")


FIGURES: dict[str, Callable[[Figure], None]] = {
    "2-6": partial(_intensity, scene="shell", number="2-6"),
    "2-7": partial(_error, scene="shell", number="2-7", column=0),
    "2-8": partial(_time, scene="shell", number="2-8"),
    "2-9": partial(_error, scene="shell", number="2-9", column=1),
    "2-10": partial(_intensity, scene="plane", number="2-10"),
    "2-11": partial(_error, scene="plane", number="2-11", column=0),
    "2-12": partial(_time, scene="plane", number="2-12"),
    "2-13": partial(_error, scene="plane", number="2-13", column=1),
}
