"""What the standard deviations of draws are made of, by the response of some of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.model_response import ModelResponse
from inference.posterior.answer.error_parts import ErrorParts

__all__ = ["error_shares"]

Array = NDArray[np.float64]


def error_shares(
    z: Array,
    log_r: Array,
    responses: Sequence[ModelResponse],
    moved: tuple[Array, Array],
    *,
    integrated: bool,
    of_scene: int,
    of_noise: int,
    noisier: float,
) -> tuple[ErrorParts, ErrorParts]:
    """Divide the variance of draws of z and of log r into what it comes of.

    Parameters
    ----------
    z, log_r : ndarray, shape (n, d) and (n, frames)
        Draws, before the errors of the model move them.
    responses : sequence of ModelResponse
        Of some of them.
    moved : (ndarray, ndarray), shapes (m, d, 1 + k) and (m, frames, 1 + k)
        By what errors move those.
    integrated : bool
        Whether the draws have the error of the flux already.
    of_scene : int
        How many of the errors, the last, are what rests on priors of the scene.
    of_noise : int
        How many before these are what noise does beyond the stated one.
    noisier : float
        By what these multiply the variance of the draws.

    Returns
    -------
    (ErrorParts, ErrorParts)
        Shares of the standard deviation of z and of log r; their squares add up to one.
    """
    mean = {
        name: np.mean(np.square([getattr(each, name) for each in responses]), axis=0)
        for name in ("own", "alone", "shared", "sd")
    }
    last, end = -of_scene or None, -(of_scene + of_noise) or None
    found = []
    for values, own, shared, part in (
        (z, mean["alone"], mean["sd"] - mean["alone"], moved[0]),
        (log_r, mean["own"], mean["shared"], moved[1]),
    ):
        added = np.square(part[:, :, 1:end]).sum(axis=2).mean(axis=0)
        of_law = np.square(part[:, :, last:]).sum(axis=2).mean(axis=0) if of_scene else 0.0
        variance = values.var(axis=0)
        first = np.fmin(own, variance)
        scene = variance - first
        if integrated:  # the draws have the error: what an exact model would leave is the scene's
            scene = np.clip(shared, 0.0, scene)
        model = noisier * (variance - first - scene) + added
        first, scene = noisier * first, noisier * scene + of_law
        whole = first + scene + model
        unit = np.where(whole > 0, whole, 1.0)
        found.append(ErrorParts(*(np.sqrt(part / unit) for part in (first, scene, model))))
    return found[0], found[1]
