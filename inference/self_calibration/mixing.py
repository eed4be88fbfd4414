"""Joint laws of scenes: with other modes, or with the object of another."""

import numpy as np
import scipy
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.joint import Joint
from simulator.scene import Scene, parse_scene

__all__ = ["mixed", "with_modes"]

Array = NDArray[np.float64]


def mixed(found: Scene, before: Scene) -> Scene:
    """Return a scene in which either law of the object may be true, each as likely.

    In the second half the object is what it was before, and all else is what was found, given such
    an object. Whoever wants one mean and one covariance has those of the mixture: what the two
    disagree about is in it.

    Parameters
    ----------
    found, before : Scene
        Of the same priors, with joint laws; the second half is one normal.

    Returns
    -------
    Scene
        As found, where either knows no object, or what comes of it lies farther out than a scene
        may state.
    """
    if found.joint is None or before.joint is None:
        return found
    names = found.joint.unknowns
    own = tuple(name for name in names if name.startswith("object."))
    if not own or not set(own) <= set(before.joint.unknowns):
        return found
    mean, covariance = _moments(found.joint, names)
    other, spread = _moments(before.joint, own)
    mean, covariance = _given(mean, covariance, [names.index(name) for name in own], other, spread)
    modes = [
        {"weight": mode.weight, "mean": list(mode.mean), "covariance": np.array(mode.covariance)}
        for mode in found.joint.modes
    ]
    total = sum(mode.weight for mode in found.joint.modes)
    modes.append({"weight": total, "mean": mean.tolist(), "covariance": covariance})
    try:
        return with_modes(found, modes)
    except InvalidInputError:  # farther from its priors than a scene may state
        return found


def _given(
    mean: Array, covariance: Array, at: list[int], other: Array, spread: Array
) -> tuple[Array, Array]:
    """Return a normal law whose unknowns ``at`` have another law; the rest given them is the same.

    Its covariance is a product of factors, positive definite however nearly some unknowns agree.
    """
    sd = np.sqrt(np.diagonal(covariance))
    k = len(at)
    order = at + [j for j in range(len(mean)) if j not in at]
    scaled = (covariance / sd[:, None] / sd)[np.ix_(order, order)]
    factor = np.linalg.cholesky(scaled)
    # all unknowns follow the first ones as far as they are correlated
    follow = scipy.linalg.solve_triangular(factor[:k, :k], factor[:, :k].T, trans="T", lower=True).T
    factor[:, :k] = follow @ np.linalg.cholesky(spread / sd[at][:, None] / sd[at])
    moved = np.empty_like(mean)
    moved[order] = follow @ ((other - mean[at]) / sd[at])
    root = np.empty_like(factor)
    root[order] = factor
    root *= sd[:, None]
    return mean + sd * moved, root @ root.T


def _moments(joint: Joint, names: tuple[str, ...]) -> tuple[Array, Array]:
    """Return mean and covariance of some unknowns, in the coordinates of their priors."""
    order = [joint.unknowns.index(name) for name in names]
    weights = np.array([mode.weight for mode in joint.modes])
    weights /= weights.sum()
    means = np.array([mode.mean for mode in joint.modes])[:, order]
    mean = weights @ means
    covariance = np.zeros((len(order), len(order)))
    for weight, own, mode in zip(weights, means, joint.modes, strict=True):
        matrix = np.array(mode.covariance)[np.ix_(order, order)]
        covariance += weight * (matrix + np.outer(own - mean, own - mean))
    return mean, covariance


def with_modes(scene: Scene, modes: list[dict[str, object]]) -> Scene:
    """Return a scene with other modes of its joint law, of any weights.

    Parameters
    ----------
    scene : Scene
        With a joint law.
    modes : list of dict
        With ``weight``, ``mean`` and ``covariance``, an array that need not be symmetric to the
        last bit.
    """
    document = scene.model_dump(mode="json", exclude_none=True)
    total = sum(float(str(mode["weight"])) for mode in modes)
    for mode in modes:
        matrix = np.asarray(mode["covariance"])
        mode["covariance"] = (0.5 * (matrix + matrix.T)).tolist()
        mode["weight"] = min(float(str(mode["weight"])) / total, 1.0)
    document["joint"]["modes"] = modes
    return parse_scene(document)
