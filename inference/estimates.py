"""What the estimators return: for every frame all physical roots, a status and a reason."""

import dataclasses
import enum
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Estimates", "LeftOut", "SdParts", "Status", "TechniqueResult", "status_of_counts"]

Array = NDArray[np.float64]


class Status(enum.IntEnum):
    """What a frame's readings say; in JSON the lower-case name."""

    UNIQUE = 0
    AMBIGUOUS = 1
    NONE = 2
    SATURATED = 3


def status_of_counts(count: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return the status of frames that have so many roots, shape (n,)."""
    return np.where(
        count == 1, Status.UNIQUE, np.where(count > 1, Status.AMBIGUOUS, Status.NONE)
    ).astype(np.uint8)


class SdParts(NamedTuple):
    """The error budget: parts of standard deviations, whose squares sum to that of the whole.

    Attributes
    ----------
    noise : ndarray
        What the noise of the readings does [m].
    scene : ndarray
        What the scene knows only by a prior, shared by all frames [m].
    model : ndarray
        What errors of the model do, of flux and of time of flight (`Scene.model_error`) [m].
    """

    noise: Array
    scene: Array
    model: Array


@dataclasses.dataclass(frozen=True, eq=False)
class TechniqueResult:
    """One technique's answer for n frames.

    Attributes
    ----------
    technique : str
        Its name in docs/techniques.md.
    status : ndarray of uint8, shape (n,)
        `Status` of each frame.
    roots_m : ndarray, shape (n, m)
        All physical roots, ascending, padded with nan; m >= 1 is the largest count [m].
    roots_sd_m : ndarray, shape (n, m)
        First-order standard deviations, the whole [m]; nan where the linearisation does not hold.
    root_count : ndarray of int, shape (n,)
        Number of roots of each frame.
    near_fold : ndarray of bool, shape (n,)
        Whether the noise could merge, part or remove a pair of roots, or reaches the r0 of a
        pulse, from where on all ranges read alike. Where noise or errors of the model may have
        merged a pair into none, the place of its fold is a root beside those that are left; so is
        the end of the ranges where they may have moved a root beyond it.
    reason : ndarray of uint8, shape (n,)
        Index into ``reasons``; 0 says nothing.
    reasons : tuple of str
        The reasons that the technique can give, whether they occur or not: what ``reason``
        indexes; ``reasons[0] == ""``.
    sd_parts_m : SdParts, optional
        Their parts; without meaning where the whole is nan.
    range_bounds_m : ndarray, shape (n, 2), optional
        Bounds where the object is unknown (differential) [m], which hold noise of two standard
        deviations, nan where there are none.
    power_law, power_law_sd, zeta, zeta_sd : ndarray, shape (n,), optional
        Exponent b of Phi ~ r^b and distortion 1 + 1/b with their standard deviations, nan where
        unavailable; only of techniques that see motion.
    parameters : mapping, optional
        What a technique of many frames found besides the ranges: by scene path ``value``, ``sd``,
        ``status`` and ``sd_parts``.
    fit : mapping, optional
        How well a technique of many frames explains them: ``chi_square`` (less what
        errors of the model take up), ``deviance``
        (-2 log likelihood relative to no residual under read noise alone; of fits by likelihood),
        ``degrees_of_freedom``, ``checks`` (p-value of each), ``p_value`` of all together but
        ``scatter``, which makes no misfit (docs/model.md, succession), ``misfit`` and its
        ``reasons``, ``by_priors`` (whether the priors of the unknowns count; of fits by
        likelihood), ``rank``, ``widening`` (factor on all standard deviations, of noise that
        chi-square doubts among it; of fits by likelihood) and ``optima``.
    runtime_s : float
        Time that the technique took [s].
    """

    technique: str
    status: NDArray[np.uint8]
    roots_m: Array
    roots_sd_m: Array
    root_count: NDArray[np.intp]
    near_fold: NDArray[np.bool_]
    reason: NDArray[np.uint8]
    reasons: tuple[str, ...]
    sd_parts_m: SdParts | None = None
    range_bounds_m: Array | None = None
    power_law: Array | None = None
    power_law_sd: Array | None = None
    zeta: Array | None = None
    zeta_sd: Array | None = None
    parameters: Mapping[str, Any] | None = None
    fit: Mapping[str, Any] | None = None
    runtime_s: float = 0.0

    def __len__(self) -> int:
        return int(self.status.size)

    @property
    def range_m(self) -> Array:
        """The range where it is unique, else nan; shape (n,) [m]."""
        return np.where(self.status == Status.UNIQUE, self.roots_m[:, 0], np.nan)

    @property
    def sd_m(self) -> Array:
        """Standard deviation of the unique range, else nan; shape (n,) [m]."""
        return np.where(self.status == Status.UNIQUE, self.roots_sd_m[:, 0], np.nan)


@dataclasses.dataclass(frozen=True, slots=True)
class LeftOut:
    """A technique that was not used, and why."""

    name: str
    reason: str


@dataclasses.dataclass(frozen=True, eq=False)
class Estimates:
    """Results of the techniques that the scene can serve, and why the others are left out.

    Attributes
    ----------
    chosen : str or None
        Of the techniques that have a result the one of least cost (`inference.plan.cheapest`); None
        if none has one.
    results : tuple of TechniqueResult
        In the order asked for.
    left_out : tuple of LeftOut
        Every other technique.
    assumptions : tuple of str
        What the results suppose without a check (`inference.assumptions`).
    do_first : str or None
        Where there is no result, or bounds alone, the one thing to do about it
        (`inference.first_step`).
    """

    chosen: str | None
    results: tuple[TechniqueResult, ...]
    left_out: tuple[LeftOut, ...]
    assumptions: tuple[str, ...] = ()
    do_first: str | None = None
