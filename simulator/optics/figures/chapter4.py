"""Figures 4-1 to 4-5: conventional, differential and background-cancelling time of flight."""

from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from simulator.object_arrays import object_fluxes, shadows
from simulator.optics.figures.solvers import background_cancelling, conventional, differential
from simulator.optics.figures.style import axes, note

__all__ = ["FIGURES"]

Array = NDArray[np.float64]

C0, C1, C2 = 7.69e-2, -1.23e-1, 9.57e-2
R0 = 14.9896229  # T_p = 100 ns
RANGES: Array = np.logspace(np.log10(0.05), np.log10(3.0), 120)
_TRUE, _FOUND = "true effective distance [m]", "computed effective distance [m]"
_OBJECT = "pulse of 100 ns; c0 = 0.0769 m², c1 = -0.123 m, c2 = 0.0957"
_CROSSTALK = (0.002, 0.1)
_BACKGROUND_M, _STRENGTH = 10.0, 1e-3


def _flux(r: Array) -> Array:
    return object_fluxes(r, C0 * C2, C0, C1)


def _background(r: Array) -> Array:
    """Return the background beside an object whose shadow has c0' = 0.73 c0 and c1' = 0.24 |c1|."""
    return _STRENGTH * shadows(r, 0.73 * C0, 0.24 * abs(C1))


def _slope(w1: Callable[[Array], Array], w2: Callable[[Array], Array], r: Array) -> Array:
    """Return q = r0 dW1/dW2 of a moving object, by central differences."""
    step = 1e-4 * r
    return np.asarray(R0 * (w1(r + step) - w1(r - step)) / (w2(r + step) - w2(r - step)))


def _late(r: Array) -> Array:
    return np.asarray(_flux(r) * r / R0)


def _crosstalk_curves() -> dict[str, Array]:
    ct1, ct2 = _CROSSTALK
    slope = _slope(_late, _flux, RANGES)
    return {
        "conventional": conventional(_late(RANGES) + ct1, _flux(RANGES) + ct2, R0),
        "D-TOF, c0 and c1 known": differential(slope, C0, C1),
        "D-TOF, c0 and c1 ten times too large": differential(slope, 10 * C0, 10 * C1 / 10**0.5),
        r"D-TOF, fixed $\zeta$ = 1/2": slope / 0.5,
        r"D-TOF, fixed $\zeta$ = 0.625": slope / 0.625,
    }


def _cancelling_curves() -> dict[str, Array]:
    w2 = _flux(RANGES) + _background(RANGES)
    w1 = _late(RANGES) + _background(RANGES) * _BACKGROUND_M / R0
    exact = (C0, C1, C2, _BACKGROUND_M)

    def solve(c0: float, c1: float, c2: float, distance: float) -> Array:
        return background_cancelling(w1, w2, R0, distance, c0 * c2, c0, c1)

    curves = {
        "conventional": conventional(w1, w2, R0),
        "BC-TOF, exact parameters": solve(*exact),
    }
    names = ("c0", "c1", "c2", "R")
    for i, name in enumerate(names):
        wrong = [value * (1.1 if i == j else 1.0) for j, value in enumerate(exact)]
        curves[f"BC-TOF, {name} 10 % too large"] = solve(*wrong)
    return curves


def _plot(figure: Figure, title: str, curves: dict[str, Array], text: str, *, error: bool) -> None:
    label = "normalised error" if error else _FOUND
    ax = axes(figure, title, _TRUE, label, x_log=True, y_log=not error)
    if not error:
        ax.plot(RANGES, RANGES, "k--", lw=1, label="truth")
        ax.set_ylim(0.03, 20)
    for name, found in curves.items():
        ax.plot(RANGES, found / RANGES - 1 if error else found, label=name)
    if error:
        ax.set_ylim(-1.05, 1.05)
    ax.legend(fontsize=8)
    note(figure, text)


def _figure_4_1(figure: Figure, *, error: bool = False) -> None:
    number = "4-2: error" if error else "4-1: conventional TOF and D-TOF"
    _plot(
        figure,
        f"Figure {number} in the presence of an unknown crosstalk",
        _crosstalk_curves(),
        f"{_OBJECT}; CT1 = {_CROSSTALK[0]:g}, CT2 = {_CROSSTALK[1]:g} (in 1/m², Phi0 A_D T_p = 1)",
        error=error,
    )


def _figure_4_3(figure: Figure, *, error: bool = False) -> None:
    number = "4-4: normalised error of" if error else "4-3: effective distance from"
    _plot(
        figure,
        f"Figure {number} background-cancelling TOF",
        _cancelling_curves(),
        f"{_OBJECT}; background at 10 m, {_STRENGTH:g} 1/m² when bare, with the object's shadow",
        error=error,
    )


def _figure_4_5(figure: Figure) -> None:
    ct1, ct2 = 2e-5, 1e-3

    def w2(r: Array) -> Array:
        return np.asarray(_flux(r) + _background(r) + ct2)

    def w1(r: Array) -> Array:
        return np.asarray(_late(r) + _background(r) * _BACKGROUND_M / R0 + ct1)

    # q turns negative or huge where the background grows as fast as the object fades
    slope = _slope(w1, w2, RANGES)
    curves = {
        "conventional": conventional(w1(RANGES), w2(RANGES), R0),
        "D-TOF": differential(slope, C0, C1),
        "BC-TOF": background_cancelling(w1(RANGES), w2(RANGES), R0, _BACKGROUND_M, C0 * C2, C0, C1),
    }
    _plot(
        figure,
        "Figure 4-5: TOF, D-TOF and BC-TOF with both background and crosstalk",
        curves,
        f"{_OBJECT}; background at 10 m, {_STRENGTH:g} 1/m² when bare; CT1 = {ct1:g}, CT2 = {ct2:g}"
        "; a curve ends where its equation has no root",
        error=False,
    )


FIGURES: dict[str, Callable[[Figure], None]] = {
    "4-1": _figure_4_1,
    "4-2": partial(_figure_4_1, error=True),
    "4-3": _figure_4_3,
    "4-4": partial(_figure_4_3, error=True),
    "4-5": _figure_4_5,
}
