"""Figures 5-1 and 5-2: iterative differential time of flight with an unknown crosstalk.

For a guess of c0 and c1 every frame's r follows from its derivatives, c2 and the crosstalk follow
from linear least squares (5.13), and the guess is improved until the residual is least.
"""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import least_squares

from simulator.object_model import log_slope, object_flux
from simulator.optics.figures.solvers import conventional, differential
from simulator.optics.figures.style import axes, note

__all__ = ["FIGURES"]

Array = NDArray[np.float64]

_C0, _C1, _C2 = 0.1, 10.0, 0.1
_CROSSTALK = 1.0
_R0 = 14.9896229  # T_p = 100 ns
_START = (1.0, 1.0)  # c0 and c1 of the first guess
_NOTE = (
    "c0 = 0.1 m², c1 = 10 m, c2 = 0.1, CT1 = CT2 = 1 (in Phi0 A_D T_p / 1 m²); pulse of 100 ns,"
    " 0.05 to 2 m, free of noise; first guess c0 = 1 m², c1 = 1 m"
)


def _data(count: int) -> tuple[Array, Array, Array, Array]:
    """Return ranges, w1, w2 and q = r0 dW1/dW2 of a moving object."""
    r = np.logspace(np.log10(0.05), np.log10(2.0), count)
    flux = np.array([object_flux(x, _C0 * _C2, _C0, _C1) for x in r.tolist()])
    slope = np.array([log_slope(x, _C0, _C1) for x in r.tolist()])
    return r, flux * r / _R0 + _CROSSTALK, flux + _CROSSTALK, r * (slope + 1.0) / slope


def _linear(r: Array, w1: Array, w2: Array, c0: float, c1: float) -> Array:
    """Return the residuals of the best c2, CT1 and CT2 (5.13), relative to the readings."""
    shape = np.array([object_flux(x, c0, c0, c1) for x in r.tolist()])
    zero, one = np.zeros_like(r), np.ones_like(r)
    rows = np.vstack(
        [
            np.column_stack([one, zero, shape * r / _R0]) / w1[:, None],
            np.column_stack([zero, one, shape]) / w2[:, None],
        ]
    )
    scale = np.linalg.norm(rows, axis=0)
    solution = np.linalg.lstsq(rows / scale, np.ones(rows.shape[0]), rcond=None)[0]
    return np.asarray((rows / scale) @ solution - 1.0)


def _iterate(w1: Array, w2: Array, q: Array) -> tuple[float, float, int]:
    """Return c0, c1 and the number of evaluations."""

    def unpack(x: Array) -> tuple[float, float]:
        c0 = float(np.exp(x[0]))
        return c0, 2.0 * float(np.sqrt(c0) * np.expm1(x[1]))

    def residuals(x: Array) -> Array:
        c0, c1 = unpack(x)
        return 1e3 * _linear(differential(q, c0, c1), w1, w2, c0, c1)

    c0, c1 = _START
    start = np.array([np.log(c0), np.log1p(c1 / (2.0 * np.sqrt(c0)))])
    # D-TOF is unique for c1 >= -1.633 sqrt(c0) (docs/model.md, 4.68)
    fit = least_squares(
        residuals,
        start,
        bounds=([-12.0, np.log1p(-0.8)], [6.0, 12.0]),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    c0, c1 = unpack(fit.x)
    return c0, c1, int(fit.nfev)


def _figure_5_1(figure: Figure) -> None:
    r, w1, w2, q = _data(40)
    c0, c1, calls = _iterate(w1, w2, q)
    ax = axes(
        figure,
        "Figure 5-1: effective distance computed using iterative D-TOF",
        "true effective distance [m]",
        "computed effective distance [m]",
        x_log=True,
        y_log=True,
    )
    ax.plot(r, r, "k--", lw=1, label="truth")
    ax.plot(r, conventional(w1, w2, _R0), label="conventional")
    ax.plot(r, differential(q, *_START), label="D-TOF with the first guess")
    label = f"iterative D-TOF: c0 = {c0:.4g} m², c1 = {c1:.4g} m ({calls} iterations)"
    ax.plot(r, differential(q, c0, c1), "o", ms=4, mfc="none", label=label)
    ax.legend(fontsize=8)
    note(figure, _NOTE)


def _figure_5_2(figure: Figure) -> None:
    ax = axes(
        figure,
        "Figure 5-2: normalised error using iterative D-TOF",
        "true effective distance [m]",
        "|computed / true - 1|",
        x_log=True,
        y_log=True,
    )
    r, _, _, q = _data(40)
    ax.plot(r, np.abs(differential(q, *_START) / r - 1), label="first guess, 40 frames")
    for count, mark in ((40, "o-"), (10, "s-"), (6, "^-")):
        r, w1, w2, q = _data(count)
        c0, c1, calls = _iterate(w1, w2, q)
        error = np.maximum(np.abs(differential(q, c0, c1) / r - 1), 1e-16)
        ax.plot(r, error, mark, ms=4, label=f"{count} frames, {calls} iterations")
    ax.legend(fontsize=8)
    note(figure, _NOTE)


FIGURES: dict[str, Callable[[Figure], None]] = {"5-1": _figure_5_1, "5-2": _figure_5_2}
