"""Figures 3-1 to 3-12: what an object's size, shape, pose, surface and crosstalk do."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from simulator.object_arrays import object_fluxes
from simulator.optics.brdf import ConstantFresnel, Material
from simulator.optics.figures.style import axes, note
from simulator.optics.parametrisation import fit_object
from simulator.optics.radiometry import observe_batch
from simulator.optics.surfaces import Rectangle
from simulator.optics.vectors import Pose, Vector

__all__ = ["FIGURES"]

Array = NDArray[np.float64]
PoseOfDistance = Callable[[float], Pose]

_DISTANCES: Array = np.logspace(-2, math.log10(3.0), 80)
_X, _Y = "effective distance $r_e$ [m]", r"$\Phi/(\Phi_0 A_D)$ [1/m²]"
_SENSOR = "uniform emitter and detector at one point, converged rectangles"


def _shiny(m: float) -> Material:
    return Material(
        diffuse=0.0, specular=1.0, roughness=m, fresnel=ConstantFresnel(reflectance=0.66942)
    )


def _ahead(distance: float) -> Pose:
    return Pose(position_m=(0.0, 0.0, distance))


def _sweep(
    width: float,
    height: float,
    pose: PoseOfDistance = _ahead,
    material: Material | None = None,
    distances: Array = _DISTANCES,
) -> tuple[Array, Array]:
    if material is None:
        material = Material()
    plates = [
        Rectangle(width_m=width, height_m=height, pose=pose(float(d)), material=material)
        for d in distances
    ]
    lights = observe_batch(plates, tolerance=1e-8)
    return np.array([s.distance_m for s in lights]), np.array([s.flux for s in lights])


def _laws(ax: Axes, near: tuple[float, float], far: tuple[float, float]) -> None:
    """Draw the slopes of a square and a fourth law through two points."""
    for (r, flux), power in ((near, 2), (far, 4)):
        x = np.array([r / 3, r * 3])
        ax.plot(x, flux * (x / r) ** -power, "k:", lw=1)
        ax.annotate(f"$r^{{-{power}}}$", (x[0], flux * 3.0**power), fontsize=8)


def _curves(
    figure: Figure,
    title: str,
    curves: Sequence[tuple[str, tuple[Array, Array]]],
    text: str,
) -> Axes:
    ax = axes(figure, title, _X, _Y, x_log=True, y_log=True)
    for label, (ranges, flux) in curves:
        ax.plot(ranges, flux, label=label)
    ax.legend(fontsize=8)
    note(figure, f"{text}; {_SENSOR}")
    return ax


def _figure_3_1(figure: Figure) -> None:
    sizes = (0.1, 0.2, 0.4, 0.8, 1.6)
    curves = [(f"{s:g} m x {s:g} m", _sweep(s, s)) for s in sizes]
    ax = _curves(
        figure, "Figure 3-1: diffuse squares of various sizes", curves, "on the axis, facing it"
    )
    _laws(ax, (0.03, 0.25 / 0.03**2), (1.5, 1e-4))


def _figure_3_2(figure: Figure) -> None:
    ratios = (1, 2, 4, 8, 16)
    curves = [(f"{k}:1", _sweep(0.6 * math.sqrt(k), 0.6 / math.sqrt(k))) for k in ratios]
    _curves(
        figure,
        "Figure 3-2: diffuse rectangles of various proportions",
        curves,
        "area 0.36 m², on the axis, facing it",
    )


def _turned(angle: float) -> PoseOfDistance:
    return lambda d: _ahead(d).turned((0.0, 1.0, 0.0), angle)


def _orientations(figure: Figure, title: str, material: Material, text: str) -> None:
    # a turned plate must not reach the sensor: it starts where its edge does
    curves = []
    for degrees in (0, 15, 30, 45, 60):
        angle = math.radians(degrees)
        start = max(0.01, 0.2 * math.tan(angle) * math.cos(angle) + 0.01)
        distances = np.logspace(math.log10(start), math.log10(3.0), 80)
        curves.append((f"{degrees}°", _sweep(0.4, 0.4, _turned(angle), material, distances)))
    _curves(figure, title, curves, text)


def _figure_3_3(figure: Figure) -> None:
    _orientations(
        figure,
        "Figure 3-3: diffuse rectangles at different orientations",
        Material(),
        "0.4 m x 0.4 m, centre on the axis, turned about y",
    )


def _figure_3_4(figure: Figure) -> None:
    _orientations(
        figure,
        "Figure 3-4: specular rectangles at different orientations",
        _shiny(0.5),
        "0.4 m x 0.4 m, centre on the axis, turned about y, Beckmann m = 0.5, F = 0.669",
    )


def _figure_3_5(figure: Figure) -> None:
    def at(angle: float) -> PoseOfDistance:
        s, c = math.sin(angle), math.cos(angle)
        return lambda d: Pose(
            position_m=(d * s, 0.0, d * c), normal=(-s, 0.0, -c), width_axis=(c, 0.0, -s)
        )

    curves = [
        (f"{degrees}°", _sweep(0.4, 0.4, at(math.radians(degrees))))
        for degrees in (0, 15, 30, 45, 60, 75)
    ]
    _curves(
        figure,
        "Figure 3-5: objects at different zenith angles",
        curves,
        "diffuse 0.4 m x 0.4 m, facing the sensor",
    )


def _figure_3_6(figure: Figure) -> None:
    surfaces = [("diffuse alone", Material(diffuse=0.5))]
    for m in (0.5, 0.2, 0.1, 0.05, 0.01):
        material = _shiny(m).model_copy(update={"diffuse": 0.5, "specular": 0.5})
        surfaces.append((f"with specular, m = {m:g}", material))
    curves = [(name, _sweep(0.4, 0.4, material=material)) for name, material in surfaces]
    _curves(
        figure,
        "Figure 3-6: rectangles of different surface properties",
        curves,
        "0.4 m x 0.4 m, k_d = k_s = 0.5, Beckmann distribution, F = 0.669",
    )


def _with_fit(figure: Figure, title: str, ranges: Array, flux: Array, text: str) -> None:
    ax = axes(figure, title, _X, _Y, x_log=True, y_log=True)
    ax.plot(ranges, flux, ".-", label="simulated")
    fit = fit_object(ranges, flux)
    order = np.argsort(ranges)
    model = fit.flux(ranges[order])
    model[model <= 0] = np.nan
    label = f"fit: c0 = {fit.c0:.3g} m², c1 = {fit.c1:.3g} m, c2 = {fit.c2:.3g}"
    ax.plot(ranges[order], model, "k--", lw=1, label=label)
    ax.legend(fontsize=8)
    note(figure, f"{text}; {_SENSOR}")


def _figure_3_8(figure: Figure) -> None:
    def pose(z: float) -> Pose:
        return Pose(position_m=(0.4, 0.0, z))

    distances = np.logspace(math.log10(0.02), math.log10(2.0), 70)
    ranges, flux = _sweep(0.2, 0.2, pose, distances=distances)
    _with_fit(
        figure,
        "Figure 3-8: off-axis linear motion",
        ranges,
        flux,
        "diffuse 0.2 m x 0.2 m parallel to the sensor, moving along z at x = 0.4 m",
    )


def _figure_3_10(figure: Figure) -> None:
    normal: Vector = (-math.sin(math.radians(20)), 0.0, -math.cos(math.radians(20)))

    def pose(z: float) -> Pose:
        return Pose(position_m=(0.0, 0.0, z), normal=normal)

    distances = np.logspace(math.log10(0.15), math.log10(3.0), 70)
    ranges, flux = _sweep(0.6, 0.6, pose, _shiny(0.1), distances)
    _with_fit(
        figure,
        "Figure 3-10: a changing effective reflectivity",
        ranges,
        flux,
        "0.6 m x 0.6 m, Beckmann m = 0.1, F = 0.669, face turned by 20° from its motion along z",
    )


# object of the crosstalk figures: W04H04R00T00 of Appendix B
_C0, _C1, _C2 = 7.69e-2, -1.23e-1, 9.57e-2
_RANGES: Array = np.linspace(0.02, 2.0, 200)


def _object(r: Array) -> Array:
    return object_fluxes(r, _C0 * _C2, _C0, _C1)


def _crosstalk(figure: Figure, title: str, cases: Sequence[tuple[str, float, float]]) -> None:
    ax = axes(figure, title, "true effective distance [m]", "computed effective distance [m]")
    ax.plot(_RANGES, _RANGES, "k--", lw=1, label="no crosstalk")
    w2 = _object(_RANGES)
    for label, strength, delay in cases:
        # CT1 is the late part, CT2 d / r0 (3.24 in the late convention)
        ax.plot(_RANGES, (w2 * _RANGES + strength * delay) / (w2 + strength), label=label)
    ax.set_ylim(0, 2)
    ax.legend(fontsize=8)
    note(
        figure,
        "pulse of 100 ns, object W04H04R00T00 (c0 = 0.0769 m², c1 = -0.123 m, c2 = 0.0957)",
    )


def _figure_3_11(figure: Figure) -> None:
    cases = [(f"CT2 = {s:g} m⁻²", s, 0.0) for s in (1e-4, 1e-3, 1e-2, 1e-1, 1.0)]
    _crosstalk(figure, "Figure 3-11: crosstalk of different strengths (CT1 = 0)", cases)


def _figure_3_12(figure: Figure) -> None:
    cases = [(f"delay of {d:g} m", 1e-2, d) for d in (0.0, 0.2, 0.5, 1.0, 1.5)]
    _crosstalk(
        figure,
        "Figure 3-12: crosstalk of different timing (CT2 = 0.01 m⁻²)",
        cases,
    )


FIGURES: dict[str, Callable[[Figure], None]] = {
    "3-1": _figure_3_1,
    "3-2": _figure_3_2,
    "3-3": _figure_3_3,
    "3-4": _figure_3_4,
    "3-5": _figure_3_5,
    "3-6": _figure_3_6,
    "3-8": _figure_3_8,
    "3-10": _figure_3_10,
    "3-11": _figure_3_11,
    "3-12": _figure_3_12,
}
