"""From the optima of a fit to a result: roots of every frame, their standard deviations, a status.

Each mode of a frame is a range that explains it; how well all frames are explained together
decides between modes and between optima of the fit. What the decision leaves stays ambiguous.
"""

import dataclasses
import functools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult, status_of_counts
from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import moved_by_errors
from inference.fits.likelihood.frame_modes import MOST, frame_reaches
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.known_modes import once
from inference.fits.likelihood.maximum import DECIDED
from inference.fits.likelihood.problem import FitProblem
from inference.realtime.net import ABSENT, COMMON_REASONS, SATURATED

__all__ = [
    "CONTRADICTION",
    "MISFIT",
    "WITHIN",
    "Answer",
    "Beside",
    "Elsewhere",
    "beside",
    "frame_ranges",
]

Array = NDArray[np.float64]

# deviance that intervals of 95 % reach, 1.96 sd squared: of chi-square, one degree, 5 %
WITHIN = 3.8414588206941285
_IMPOSSIBLE = 36.0  # chi-square of a single frame that nothing explains
# of the range, below which the tangent holds as far as noise reaches
_SMALL = 0.005
_ONE = 1.0  # standard deviations below which two modes are one
_BAND = 3.0  # standard deviations that are followed, as of noise
_ANY = 1.0  # deviance, below which the farthest range is one of the best

# why a fit that does not explain the frames gives no range
CONTRADICTION = (
    "the readings contradict what is known of the range (known_range_m, displacement_m): a misfit"
)
MISFIT = "the fit does not explain the frames (misfit): something is not as the scene states it"
_REASONS = (
    *COMMON_REASONS,
    "more than one range explains the readings, and the fit over all frames does not decide",
    "no range explains the readings within six standard deviations",
    "the best range lies at the end of the ranges of the scene",
    MISFIT,
    CONTRADICTION,
    "what else explains the frames leaves this range open: its standard deviation is no number",
)
_AMBIGUOUS, _UNEXPLAINED, _EDGE, _MISFIT, _CONTRADICTED, _OPEN = range(
    len(COMMON_REASONS), len(_REASONS)
)


@dataclasses.dataclass(frozen=True, eq=False)
class Answer:
    """One set of values of the unknowns.

    Attributes
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    excess : float
        Deviance above the best answer's.
    covariance_factor : ndarray, shape (d, m), optional
        F with F F^T the covariance of the coordinates; left out: that of the fit's information.
    of_x : ndarray, shape (d, k), optional
        Change of the coordinates with errors of the model, where a linear fit follows them.
    erring : Erring, optional
        Where the model errs: the maximum, which then stands for the covariance.
    wider : float
        Factor on what frames share there.
    """

    x: Array
    excess: float
    covariance_factor: Array | None = None
    of_x: Array | None = None
    erring: Erring | None = None
    wider: float = 1.0


class Beside(NamedTuple):
    """Other values of the unknowns that are not decided against.

    Attributes
    ----------
    excess : float
        Deviance above the best answer's.
    log_r : ndarray, shape (n,)
        The ranges there.
    noise : ndarray, shape (n,), or float
        How far each frame's own noise reaches from there, a standard deviation of log r.
    """

    excess: float
    log_r: Array
    noise: Array | float = 0.0


class Elsewhere(NamedTuple):
    """What else than the answers the deviance allows.

    Attributes
    ----------
    points : sequence of Beside
        Other values that are not decided against.
    ends : ndarray, shape (frames of the problem,), or None
        By how much the deviance rises to where a range is the farthest that may be (`far_ends`);
        inf where that is not followed. Else it says how far the range reaches, in place of
        ``points``; with less than 1 the range is open.
    """

    points: Sequence[Beside] = ()
    ends: Array | None = None


_NOWHERE = Elsewhere()


@dataclasses.dataclass(frozen=True, eq=False)
class _Modes:
    """Ranges that explain the frames; every array has the shape (n, answers * `MOST`).

    Attributes
    ----------
    log_r : ndarray
        The ranges.
    noise : ndarray
        Standard deviations of log r by the frame's own noise.
    told : ndarray
        By all noise, that which frames share included.
    model : ndarray
        By errors of the model.
    excess : ndarray
        Deviance above the best.
    """

    log_r: Array
    noise: Array
    told: Array
    model: Array
    excess: Array


def _modes(problem: FitProblem, answers: Sequence[Answer]) -> tuple[_Modes, Array]:
    """Return the modes, and the chi-square of each frame that errors of the model leave."""
    columns: list[tuple[Array, ...]] = []
    chi_square = np.empty(0)
    for answer in answers:
        erring, factor = answer.erring, answer.covariance_factor
        u, deviance, reach = frame_reaches(problem if erring is None else erring.bare, answer.x)
        if erring is not None and erring.clean.known is not None:
            ruled = (erring.clean.known.rates > 0).any(axis=1)  # more than readings tell it
            u = np.column_stack([erring.with_known(column) for column in u.T])
            u[ruled], reach[ruled] = once(u[ruled]), 0.0
        noise, told, model, squares = np.full((4, *u.shape), np.nan)
        for k in range(MOST):
            if k > 0 and not np.isfinite(u[:, k]).any():
                break
            if erring is None:
                residual, facts = residuals_and_information(problem, answer.x, u[:, k])
                factor = facts.factor if factor is None else factor
                noise[:, k], model[:, k] = np.sqrt(facts.own_variance), 0.0
                shared = np.linalg.norm(facts.response @ factor, axis=1)
                square = np.square(residual).sum(axis=1)
                if answer.of_x is not None and answer.of_x.size:
                    # another mode is one while all other frames, and so x, stay as they are
                    of_x = answer.of_x if k == 0 else 0.0 * answer.of_x
                    before = square
                    model[:, k], square = moved_by_errors(problem, answer.x, u[:, k], of_x)
                    deviance[:, k] -= before - square
            else:
                noise[:, k], shared, whole, square = erring.at_ranges(u[:, k])
                with np.errstate(invalid="ignore"):
                    known = np.square(noise[:, k]) + np.square(shared)
                    model[:, k] = np.sqrt(np.maximum(np.square(whole) - known, 0.0))
                if not erring.a.size:  # but for rounding
                    model[:, k] = 0.0
                shared = answer.wider * shared
                model[:, k] *= answer.wider
                deviance[:, k] = np.where(np.isfinite(u[:, k]), square, np.inf)
            bent = noise[:, k] > _SMALL
            noise[bent, k] = np.fmax(noise[bent, k], reach[bent, k])
            told[:, k] = np.hypot(noise[:, k], shared)
            squares[:, k] = square
        if erring is not None:  # another mode may be the best once the errors are allowed for
            order = np.argsort(deviance, axis=1, kind="stable")
            turn = functools.partial(np.take_along_axis, indices=order, axis=1)
            u, deviance, noise, told, model, squares = map(
                turn, (u, deviance, noise, told, model, squares)
            )
        if not columns:
            chi_square = squares[:, 0]
        # the other frames are as they are: a worse mode of this one costs what it costs here
        with np.errstate(invalid="ignore"):
            excess = answer.excess + deviance - deviance[:, :1]
        columns.append((u, noise, told, model, np.where(np.isnan(excess), np.inf, excess)))
    joined = (np.concatenate(parts, axis=1) for parts in zip(*columns, strict=True))
    return _Modes(*joined), chi_square


def _merged(u: Array, sd: Array, excess: Array) -> tuple[list[int], bool]:
    """Return the indices of a frame's distinct modes, best first, and whether some were merged.

    What explains the readings nearly as well as the mode that it is merged with may be far less
    certain: ``sd`` of the mode that stays is widened until its interval of 95 % holds that of the
    other, as far as the deviance lets it reach, and until the other lies as far out as its deviance
    says where that is less likely. Deviances are those above the mode that stays.
    """
    kept: list[int] = []
    merged = False
    for k in np.argsort(excess, kind="stable"):
        if not excess[k] <= DECIDED:
            break
        width = sd[k] if np.isfinite(sd[k]) else 0.0
        twins = [i for i in kept if abs(u[i] - u[k]) <= _ONE * max(width, np.nan_to_num(sd[i]))]
        if twins or any(abs(u[i] - u[k]) < 1e-9 for i in kept):
            merged = merged or any(abs(u[i] - u[k]) > 1e-6 for i in twins)
            for i in twins:
                above, away = float(excess[k] - excess[i]), float(u[k] - u[i])
                # of the range that stays: one that is far beyond it is as far as it is in metres
                farther = math.exp(max(away, 0.0))
                reach = farther * width * math.sqrt(max(WITHIN - above, 0.0))
                reach += max(-away, math.expm1(away))
                sd[i] = max(sd[i], reach / math.sqrt(max(WITHIN, above)))
        else:
            kept.append(int(k))
    return kept, merged


def beside(one: Erring, excess: float) -> Beside:
    """Return other values, and how far each frame's own noise reaches from its range there.

    A frame that is all but in the dark there may be bright at the best values, and sure of itself.
    """
    modes, _, reaches = frame_reaches(one.bare, one.x)
    away = np.abs(modes - one.positions[:, None])
    nearest = np.where(np.isfinite(away), away, np.inf).argmin(axis=1)
    noise = np.take_along_axis(reaches, nearest[:, None], axis=1)[:, 0]
    return Beside(excess, one.positions, np.where(np.isfinite(noise), noise, 0.0))


def _reaches(problem: FitProblem, best: Array, points: Sequence[Beside]) -> Array:
    """Return how far each range moves to other values, relative, per standard deviation, (n,)."""
    reach = np.zeros(problem.frames.shape[0])
    for excess, positions, noise in points:
        away = np.abs(np.expm1(positions - best))
        away += np.exp(positions - best) * noise * math.sqrt(max(WITHIN - excess, 0.0))
        reach = np.fmax(reach, away / math.sqrt(max(excess, WITHIN)))
    return reach


def _open(roots: Array, parts: SdParts, support: tuple[float, float]) -> NDArray[np.bool_]:
    """Return which roots may be any range of the support as far as an error can say.

    Noise is followed to the ends of the ranges and not beyond (docs/model.md, reach), so that a
    part of the error that passes both is that of a tangent, or of other values of the unknowns.
    """
    low, high = support
    with np.errstate(invalid="ignore", over="ignore"):
        whole = np.fmax(high - roots, roots - low) * (1 + 1e-9)
        rest = np.hypot(parts.scene, parts.model)
        return np.asarray((_BAND * parts.noise > whole) | (_BAND * rest > whole))


def frame_ranges(
    name: str,
    problem: FitProblem,
    answers: Sequence[Answer],
    state: NDArray[np.uint8],
    parameters: Mapping[str, Any],
    fit: Mapping[str, Any],
    elsewhere: Elsewhere = _NOWHERE,
    contradicted: Collection[int] = (),
    doubt: float = 1.0,
) -> TechniqueResult:
    """Build the result of a technique of many frames.

    Parameters
    ----------
    name : str
        The technique.
    problem : FitProblem
        With the frames that were fitted.
    answers : sequence of Answer
        The best first; those that the fit leaves undecided.
    state : ndarray of uint8, shape (frames of the request,)
        What rules frames out (`inference.realtime.net.rule_out`); the others without an object
        or saturated are, in order, those of the problem.
    parameters, fit : mapping
        As in `TechniqueResult`. A fit that says of itself that it misfits gives no ranges.
    elsewhere : Elsewhere
        What else the deviance allows, none of it an answer. Standard deviations of the best answer
        are widened until ranges of such values lie as far out as their deviance says, or in the
        interval of 95 % if that reaches them, with as much of their noise as is left of it.
    contradicted : collection of int
        Frames of the problem whose readings and known ranges contradict one another.
    doubt : float
        By what the variance of noise may be larger than stated (`report.doubt_of`); ``elsewhere``
        has its deviances over it.

    Returns
    -------
    TechniqueResult
        Without run time. A range that the fit leaves open within all that may be has no standard
        deviation, and a reason.
    """
    used = np.flatnonzero(state != SATURATED)
    modes, chi_square = _modes(problem, answers)
    u, excess = modes.log_r, modes.excess / doubt
    for part in (modes.noise, modes.told):
        part *= math.sqrt(doubt)
    low, high = np.log(problem.support)
    points, ends = elsewhere
    ends = np.full(used.size, np.inf) if ends is None else ends
    before = modes.told[:, 0].copy()
    # no point is less than the best with a range at its end, and its widths may be tangents there
    to_end = np.expm1(high - u[:, 0]) / np.sqrt(np.maximum(ends, WITHIN))
    reach = np.where(np.isfinite(ends), to_end, _reaches(problem, u[:, 0], points))
    modes.told[:, 0] = np.fmax(modes.told[:, 0], reach)
    sd = np.hypot(modes.told, modes.model)
    alone = sd[:, 0].copy()
    n = state.size
    kept: list[list[int]] = [[] for _ in range(n)]
    near = np.zeros(n, dtype=np.bool_)
    reason = state.copy()
    single = np.count_nonzero(excess <= DECIDED, axis=1) <= 1
    for row, frame in enumerate(used):
        if reason[frame]:
            continue
        if fit.get("misfit"):
            reason[frame] = _CONTRADICTED if row in contradicted else _MISFIT
            continue
        if single[row]:
            kept[frame] = [int(np.argmin(excess[row]))]
        else:
            kept[frame], near[frame] = _merged(u[row], sd[row], excess[row])
        if len(kept[frame]) > 1:
            reason[frame] = _AMBIGUOUS
        elif not np.isfinite(u[row, kept[frame][0]]) or chi_square[row] > _IMPOSSIBLE:
            kept[frame], reason[frame] = [], _UNEXPLAINED
        elif not low + 1e-9 < u[row, kept[frame][0]] < high - 1e-9:
            kept[frame], reason[frame] = [], _EDGE
    count = np.array([len(modes) for modes in kept], dtype=np.intp)
    width = max(int(count.max(initial=0)), 1)
    roots, roots_sd, noise, scene, model, opening = np.full((6, n, width), np.nan)
    # what other values and modes widen by is shared by all frames
    with np.errstate(invalid="ignore"):
        shared = np.sqrt(np.maximum(sd**2 - modes.noise**2 - modes.model**2, 0.0))
        tangent = np.sqrt(np.maximum(before**2 - modes.noise[:, 0] ** 2, 0.0))
    rest = shared.copy()
    # an end that is followed is no tangent; another mode beside it may be one
    followed = np.isfinite(ends) & (ends >= _ANY) & (sd[:, 0] <= alone)
    rest[:, 0] = np.where(followed, tangent, shared[:, 0])
    for row, frame in enumerate(used):
        index = np.array(kept[frame], dtype=np.intp)
        index = index[np.argsort(u[row, index])]
        place = slice(index.size)
        roots[frame, place] = np.exp(u[row, index])
        with np.errstate(invalid="ignore", over="ignore"):
            roots_sd[frame, place] = roots[frame, place] * sd[row, index]
            noise[frame, place] = roots[frame, place] * modes.noise[row, index]
            scene[frame, place] = roots[frame, place] * shared[row, index]
            opening[frame, place] = roots[frame, place] * rest[row, index]
            model[frame, place] = roots[frame, place] * modes.model[row, index]
    parts = SdParts(noise, scene, model)
    lost = _open(roots, SdParts(noise, opening, model), problem.support)
    reason[(count == 1) & lost.any(axis=1)] = _OPEN
    roots_sd[lost | ~np.isfinite(roots_sd)] = np.nan
    status = status_of_counts(count)
    status[state == SATURATED] = Status.SATURATED
    reason[state == ABSENT] = ABSENT
    return TechniqueResult(
        technique=name,
        status=status,
        roots_m=roots,
        roots_sd_m=roots_sd,
        root_count=count,
        near_fold=near,
        reason=reason,
        reasons=_REASONS,
        sd_parts_m=parts,
        parameters=parameters,
        fit=fit,
    )
