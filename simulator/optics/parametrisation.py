"""Object parameters from flux and effective distance by weighted linear least squares (5.5-5.8).

Phi0 A_D / Phi = x1 r^2 + x2 r^3 + x3 r^4 is linear, with c2 = 1/x1, c1 = x2/x3, c0 = x1/x3. It is
solved by QR with scaled columns; normal equations would lose digits on data near a square law
(docs/model.md, 5.7).
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError, Problem
from simulator.optics.least_squares import solve_scaled

__all__ = [
    "ObjectFit",
    "ShadowFit",
    "fit_object",
    "fit_shadow",
]

Array = NDArray[np.float64]
Weights = Literal["proportional", "additive"]

# share of 1/Phi below which curvature away from the square law is told neither from the model's own
# misfit (1.6 % on average, docs/model.md, appendix-b) nor from rounding
_CURVED = 0.01
# t-statistic below which a coefficient is not told from zero (about 1e-3 false alarms a fit of 40)
_SIGNIFICANT = 3.5


@dataclass(frozen=True, slots=True)
class ObjectFit:
    """Result of `fit_object`.

    Attributes
    ----------
    c0, c1, c2 : float
        Object parameters [m^2], [m], [-] as the least squares give them, even where they are not
        identifiable (c0 may then be huge or negative); nan where no number exists.
    sd_c0, sd_c1, sd_c2 : float
        Standard errors by the delta method from the residuals; inf where not identifiable.
    coefficients : ndarray, shape (3,)
        x1, x2, x3 of r^2, r^3, r^4.
    covariance : ndarray, shape (3, 3)
        Of the coefficients.
    error : float
        Mean squared relative residual of 1/Phi: Appendix B's column "Error".
    identifiable : (bool, bool, bool)
        Of c0, c1, c2.
    statement : str
        Empty, or in plain words what the data do not determine and why.
    """

    c0: float
    c1: float
    c2: float
    sd_c0: float
    sd_c1: float
    sd_c2: float
    coefficients: Array
    covariance: Array
    error: float
    identifiable: tuple[bool, bool, bool]
    statement: str

    def flux(self, r: Array) -> Array:
        """Return Phi / (Phi0 A_D) [1/m^2] of the fit at ranges r [m]."""
        r = np.asarray(r, dtype=np.float64)
        x1, x2, x3 = self.coefficients
        return np.asarray(1.0 / (r * r * (x1 + r * (x2 + r * x3))))


@dataclass(frozen=True, slots=True)
class ShadowFit:
    """Result of `fit_shadow`: S(r) = 1 - c0 / (r^2 + c1 r + c0).

    Attributes
    ----------
    c0, c1 : float
        Shadow parameters c0' [m^2] and c1' [m].
    sd_c0, sd_c1 : float
        Standard errors from the residuals.
    error : float
        Mean squared residual of 1/(1 - S), relative.
    identifiable : (bool, bool)
        Of c0', c1'.
    statement : str
        Empty, or in plain words what the data do not determine.
    """

    c0: float
    c1: float
    sd_c0: float
    sd_c1: float
    error: float
    identifiable: tuple[bool, bool]
    statement: str


def _check(r: Array, values: Array, name: str, least: int) -> None:
    problems = []
    if r.ndim != 1 or r.size < least:
        problems.append(Problem("/range_m", f"must be a list of at least {least} ranges"))
    elif not (np.all(np.isfinite(r)) and np.all(r > 0)):
        problems.append(Problem("/range_m", "every range must be finite and positive"))
    elif np.unique(r).size < least:
        problems.append(Problem("/range_m", f"must hold at least {least} distinct ranges"))
    if values.shape != r.shape:
        problems.append(Problem(f"/{name}", "must have the shape of range_m"))
    elif not np.all(np.isfinite(values)):
        problems.append(Problem(f"/{name}", "must be finite"))
    if problems:
        raise InvalidInputError(*problems)


def fit_object(range_m: Array, flux: Array, weights: Weights = "proportional") -> ObjectFit:
    """Fit c0, c1, c2 to flux against effective distance.

    Parameters
    ----------
    range_m : ndarray, shape (n,)
        Effective distances [m], at least three distinct ones.
    flux : ndarray, shape (n,)
        Phi / (Phi0 A_D) [1/m^2], positive.
    weights : "proportional" or "additive"
        Noise in proportion to the flux (rows divided by b = 1/Phi, as the thesis does), or of one
        size for every flux (rows divided by b^2; docs/model.md, 5.7).

    Returns
    -------
    ObjectFit
        The fit; with three points the standard errors are nan.

    Raises
    ------
    InvalidInputError
        With a pointer to the offending argument.
    """
    r = np.asarray(range_m, dtype=np.float64)
    phi = np.asarray(flux, dtype=np.float64)
    _check(r, phi, "flux", 3)
    if np.any(phi <= 0):
        raise InvalidInputError.at("/flux", "every flux must be positive")
    # unit of length: the geometric mean range; unit of flux: 1 / r^2 there
    unit = math.exp(float(np.mean(np.log(r))))
    s, f = r / unit, phi * unit * unit
    weight = f if weights == "proportional" else f * f / float(np.max(f))
    matrix = np.column_stack([s**2, s**3, s**4]) * weight[:, None]
    fit = solve_scaled(matrix, weight / f)
    x = fit.x / np.array([1.0, unit, unit * unit])
    scaling = np.array([1.0, unit, unit * unit])
    covariance = fit.covariance / np.outer(scaling, scaling)
    residual = (np.column_stack([s**2, s**3, s**4]) @ fit.x) * f - 1.0
    reach = float(np.max(r))
    return _object_fit(x, covariance, float(np.mean(residual**2)), fit.rank, reach)


def _object_fit(x: Array, covariance: Array, error: float, rank: int, reach: float) -> ObjectFit:
    x1, x2, x3 = (float(v) for v in x)
    sd = np.sqrt(np.diag(covariance))
    known_x1, known_x2, known_x3 = (
        bool(abs(v) > _SIGNIFICANT * e) for v, e in zip(x, sd, strict=True)
    )
    curved = known_x3 and x3 * reach * reach > _CURVED * abs(x1)
    known_x2 = known_x2 and abs(x2) * reach > _CURVED * abs(x1)
    identifiable = (curved and known_x1, curved, known_x1)
    statement = ""
    if rank < 3:
        statement = "the ranges do not span three independent columns; nothing is determined"
    elif not curved:
        law = "square law" if not known_x2 else "square to cube law"
        statement = (
            f"c0 and c1 are not identifiable (pure {law} over these ranges): "
            "only c2 and the ratio c1/c0 enter"
            if known_x2
            else f"c0 and c1 are not identifiable (pure {law} over these ranges)"
        )
    elif not known_x1:
        statement = "c0 and c2 are not identifiable apart (pure fourth law): only c0 c2 enters"
    with np.errstate(divide="ignore", invalid="ignore"):
        c2 = float(np.divide(1.0, x1))
        c1 = float(np.divide(x2, x3))
        c0 = float(np.divide(x1, x3))
        g0 = np.array([1.0 / np.float64(x3), 0.0, -c0 / np.float64(x3)])
        g1 = np.array([0.0, 1.0 / np.float64(x3), -c1 / np.float64(x3)])
        sds = [float(np.sqrt(g @ covariance @ g)) for g in (g0, g1)]
        sd_c2 = float(sd[0] * c2 * c2)
    return ObjectFit(
        c0=c0,
        c1=c1,
        c2=c2,
        sd_c0=sds[0] if identifiable[0] or math.isnan(sds[0]) else math.inf,
        sd_c1=sds[1] if identifiable[1] or math.isnan(sds[1]) else math.inf,
        sd_c2=sd_c2 if identifiable[2] or math.isnan(sd_c2) else math.inf,
        coefficients=x,
        covariance=covariance,
        error=error,
        identifiable=identifiable,
        statement=statement,
    )


def fit_shadow(range_m: Array, visible: Array) -> ShadowFit:
    """Fit c0', c1' of the shadow S = 1 - c0'/(r^2 + c1' r + c0').

    1/(1 - S) - 1 = (1/c0') r^2 + (c1'/c0') r is linear; rows are divided by 1/(1 - S), so that the
    residual is relative to the hidden share.

    Parameters
    ----------
    range_m : ndarray, shape (n,)
        Effective distances of the object [m], at least two distinct ones.
    visible : ndarray, shape (n,)
        S, the visible share of the background, below 1.

    Returns
    -------
    ShadowFit
        The fit; with two points the standard errors are nan.

    Raises
    ------
    InvalidInputError
        With a pointer to the offending argument.
    """
    r = np.asarray(range_m, dtype=np.float64)
    share = np.asarray(visible, dtype=np.float64)
    _check(r, share, "visible", 2)
    if np.any(share >= 1):
        raise InvalidInputError.at("/visible", "every share must be below 1: there is a shadow")
    unit = math.exp(float(np.mean(np.log(r))))
    s, hidden = r / unit, 1.0 - share
    fit = solve_scaled(np.column_stack([s**2, s]) * hidden[:, None], share)
    y2, y1 = float(fit.x[0]) / unit**2, float(fit.x[1]) / unit
    scaling = np.array([unit**2, unit])
    covariance = fit.covariance / np.outer(scaling, scaling)
    sd = np.sqrt(np.diag(covariance))
    ok = bool(y2 > 0 and y2 > _SIGNIFICANT * sd[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        c0, c1 = float(np.divide(1.0, y2)), float(np.divide(y1, y2))
        gradient = np.array([-c1 / np.float64(y2), 1.0 / np.float64(y2)])
        sds = float(sd[0] * c0 * c0), float(np.sqrt(gradient @ covariance @ gradient))
    return ShadowFit(
        c0=c0,
        c1=c1,
        sd_c0=sds[0] if ok or math.isnan(sds[0]) else math.inf,
        sd_c1=sds[1] if ok or math.isnan(sds[1]) else math.inf,
        error=float(np.mean(fit.residuals**2)),
        identifiable=(ok, ok),
        statement="" if ok else "c0' and c1' are not identifiable: no r^2 term over these ranges",
    )
