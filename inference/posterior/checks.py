"""What is refused before any time is spent on a posterior, each with its reason and its remedy."""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.frame.gaussian import log_top
from inference.identifiability.before_data import check_discrepancy
from inference.posterior.criticism.prior_conflict import ranges_beyond
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = [
    "MOST_FRAMES",
    "MOST_UNKNOWNS",
    "check_best_fit",
    "check_ranges",
    "check_scene_for_posterior",
]

Array = NDArray[np.float64]

# object 3, crosstalk 2, background 2, its shadow 2, centre and spread of a stroke 2
MOST_UNKNOWNS = 11
MOST_FRAMES = 100_000
# whose likelihoods do not add up frame by frame, or are taken out one by one
MOST_COUPLED = 2000
MOST_DISPLACED = 600  # one offset is sampled with all of them
_PRIOR_DRAWS = 256
_OUTSIDE = 5.0  # standard deviations of a known range beyond the support
# standard deviations by which readings may miss the best fit, root mean square. A model that is
# wrong misses by less than the signal, which no sensor reads a million times above its noise; and
# a log density of 1e12 a reading has rounding errors that a sampler takes for structure
_MOST_MISFIT = 1e6


def check_scene_for_posterior(sensor: Sensor, scene: Scene, frames: Frames) -> None:
    """Check whether a posterior of these frames can say anything in this scene.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene with its optional terms.
    frames : Frames
        Usable ones, checked.

    Raises
    ------
    InvalidInputError
        Where the scene breaks a rule; pointers below /scene.
    RefusedError
        Where no honest answer exists; with the remedy.
    """
    try:
        parameters = parameters_of(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    check_discrepancy(scene)
    _check_optional(scene, parameters)
    if len(parameters) > MOST_UNKNOWNS:
        raise RefusedError(
            f"the scene has {len(parameters)} unknowns, and posteriors were tested up to "
            f"{MOST_UNKNOWNS}; state more of them as known numbers"
        )
    if len(frames) > MOST_FRAMES:
        raise RefusedError(
            f"{len(frames)} frames that are not saturated, and posteriors were tested up to "
            f"{MOST_FRAMES}; send several posteriors of a part each"
        )
    _check_coupled(scene, len(frames))
    _check_priors(parameters)
    _check_known_ranges(parameters, frames)
    if frames.displacement_m is not None and np.isfinite(frames.displacement_m).any():
        _check_displacements(sensor, scene, frames)
    if not frames.present.any():
        _check_empty(parameters)


def check_best_fit(density: CollapsedDensity, z: Array) -> None:
    """Refuse readings that nothing in the scene comes near.

    Parameters
    ----------
    z : ndarray, shape (d,)
        The best parameters that were found.

    Raises
    ------
    RefusedError
        With the frame that fits worst. A misfit that is merely too large to be noise is answered,
        and flagged in `Fit`.
    """
    shares = log_top(density.instrument.read) - density.frame_log_likelihoods(z[None])[0]
    misfit = float(np.sqrt(max(shares.mean(), 0.0)))
    if misfit > _MOST_MISFIT:
        raise RefusedError(
            f"the readings miss the best fit by {misfit:.1e} times their noise in the mean, most "
            f"of all the usable frame number {int(shares.argmax())} (from 0): check the units of "
            "the readings and of the noise's `read`, leave out frames that something else has "
            "spoilt, or widen the priors"
        )


def check_ranges(density: CollapsedDensity, scene: Scene, z: Array) -> None:
    """Refuse a stated `range_m` that the readings contradict.

    Parameters
    ----------
    scene : Scene
        As stated.
    z : ndarray, shape (d,)
        The best parameters that were found.

    Raises
    ------
    InvalidInputError
        Pointer /scene/range_m, where most frames that hold the object would fit far better at
        ranges beyond its ends: nothing that lies within them is then an answer. Of fewer frames
        the posterior says so in its `fit`.
    """
    if scene.range_m is None or not density.holds.any():
        return
    beyond, best = ranges_beyond(density, z)
    count, n = int(beyond[density.holds].sum()), int(density.holds.sum())
    if 2 * count <= n:
        return
    low, high = float(best[beyond].min()), float(best[beyond].max())
    raise InvalidInputError.at(
        "/scene/range_m",
        f"contradicts the readings: {count} of {n} frames would fit far better beyond its ends, at "
        f"{low:.3g} to {high:.3g} m; widen it, or leave it out. If the ranges stated are right, "
        "check the sensor's pulse width, frequency or phase offset and the order of the columns",
    )


def _check_coupled(scene: Scene, count: int) -> None:
    """Refuse more frames than can be computed where a few cannot stand for all."""
    if count <= MOST_COUPLED:
        return
    error, of = scene.model_error, f"{count} frames that are not saturated"
    if scene.motion == "static":
        together = -(-count // MOST_COUPLED)
        raise RefusedError(
            f"{of}, and of an object at rest posteriors take {MOST_COUPLED}: send means of "
            f"{together} frames each, with the noise's `read` divided by the root of {together}; "
            "nothing of what they tell is lost"
        )
    if error.integrated and error.flux > 0:
        raise RefusedError(
            f"{of}, and with a discrepancy that is integrated out posteriors take {MOST_COUPLED}: "
            "leave `discrepancy` out, and its part of every error is computed by linear response"
        )
    if scene.optional_terms:
        raise RefusedError(
            f"{of}, and optional terms are decided by up to {MOST_COUPLED}: leave `optional` out; "
            "a term that is not there costs width alone, and of so many frames little"
        )


def _check_optional(scene: Scene, parameters: Parameters) -> None:
    """Refuse an optional term of which nothing is unknown."""
    for term in scene.optional_terms:
        if not any(name.startswith(f"{term}.") for name in parameters.names):
            raise InvalidInputError.at(
                f"/scene/{term}/optional",
                "the data decide whether a term stays by what they tell of it, and all of this one "
                "is known: give one of its members a prior, or leave `optional` out",
            )


def _check_priors(parameters: Parameters) -> None:
    """Refuse priors that exclude one another, or every range."""
    # the effort is bounded; it refuses on its own where c0 and c1 exclude one another
    terms = parameters.terms(parameters.sample(np.random.default_rng(0), _PRIOR_DRAWS))
    if terms.background is None or np.isfinite(terms.ranges[:, 0]).any():
        return
    nearer = terms.background[:, 1] <= parameters.reach_m[0]
    if nearer.all():
        raise RefusedError(
            "the background lies nearer than every range in `range_m`, and an object stands before "
            "its background; raise `background.distance_m`, or lower `range_m`"
        )
    also = " where the background is not nearer than every range" if nearer.any() else ""
    raise RefusedError(
        "the shadow's c1 is so far below zero that the background would be negative at every "
        f"range in `range_m`{also}; raise `background.shadow.c1`, or widen `range_m`"
    )


def _check_displacements(sensor: Sensor, scene: Scene, frames: Frames) -> None:
    """Refuse displacements that do not fit the scene, and more than are sampled together."""
    if scene.motion == "static":
        raise InvalidInputError.at(
            "/frames/displacement_m", "is given, and the scene states an object that does not move"
        )
    if len(frames) > MOST_DISPLACED:
        raise RefusedError(
            f"{len(frames)} frames that are not saturated, and with displacements posteriors take "
            f"{MOST_DISPLACED}: send fewer frames of the same stroke, or their means"
        )
    collapsed_density(sensor, scene, frames)


def _check_known_ranges(parameters: Parameters, frames: Frames) -> None:
    """Refuse ranges that are known to lie where the scene allows none."""
    known, sd = frames.known_range_m, frames.known_range_sd_m
    if known is None or sd is None:
        return
    low, high = parameters.range_prior.low, parameters.range_prior.high
    beyond = np.maximum(low - known, known - high) > _OUTSIDE * sd
    if beyond.any():
        first = known[np.flatnonzero(beyond)[0]]
        raise InvalidInputError.at(
            "/frames/known_range_m",
            f"{int(beyond.sum())} known ranges, the first {first:g} m, lie outside what range_m "
            f"allows, {low:.4g} to {high:.4g} m: state a wider range_m",
        )


def _check_empty(parameters: Parameters) -> None:
    """Refuse frames without an object that can teach nothing."""
    seen = ("crosstalk.", "background.strength", "background.distance_m")
    if not any(name.startswith(seen) for name in parameters.names):
        raise RefusedError(
            "no frame holds an object, and neither crosstalk nor a background is unknown: there is "
            "nothing that these frames could tell; send frames with `object_present` true, or give "
            "crosstalk or background a prior"
        )
