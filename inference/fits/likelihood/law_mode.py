"""The modes of what is known of a scene, each of which a fit takes as its prior in turn."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.glossy import glossy_move
from simulator.parameters import Parameters
from simulator.scene import Scene

__all__ = ["LawMode", "is_glossy", "law_modes", "place_of"]

Array = NDArray[np.float64]


class LawMode(NamedTuple):
    """One mode, normal in the coordinates z of `Parameters`.

    Attributes
    ----------
    centre, factor : ndarray, shape (d,), (d, d)
        Mean, and Cholesky factor of the covariance.
    deviance : float
        -2 log of its weight over the root of the covariance's determinant.
    place : int
        Which mode of the scene's joint law it is, be the object diffuse or glossy: those of one
        place are one answer, those of several are as many.
    glossy : bool
        Whether it is that of a glossy object.
    """

    centre: Array
    factor: Array
    deviance: float
    place: int
    glossy: bool = False


def place_of(mode: LawMode | None) -> int:
    """Return which mode of the scene's joint law this is."""
    return 0 if mode is None else mode.place


def is_glossy(mode: LawMode | None) -> bool:
    """Tell whether this is the mode of a glossy object."""
    return mode is not None and mode.glossy


def law_modes(scene: Scene, parameters: Parameters) -> tuple[LawMode | None, ...]:
    """Return the modes of what is known of a scene's unknowns.

    Where nothing is said of the object, each has another of the same weight: the priors of a
    glossy one (`simulator.glossy`).

    Parameters
    ----------
    scene : Scene
        The scene.
    parameters : Parameters
        Its unknowns.

    Returns
    -------
    tuple of LawMode or None
        None is the mode under which z is standard normal.
    """
    law, d = parameters.law, len(parameters)
    modes: list[LawMode | None] = [None]
    if law is not None and law.weights.size > 0:
        sizes = np.log(np.diagonal(law.factors, axis1=1, axis2=2)).sum(axis=1)
        deviances = 2.0 * (sizes - np.log(law.weights))
        each = zip(law.centres, law.factors, deviances.tolist(), strict=True)
        modes = [LawMode(*mode, place) for place, mode in enumerate(each)]
    move = glossy_move(scene, parameters.names)
    if move is None:
        return tuple(modes)
    glossy = [mode or LawMode(np.zeros(d), np.eye(d), 0.0, 0) for mode in modes]
    moved = (mode._replace(centre=mode.centre + move, glossy=True) for mode in glossy)
    return (*modes, *moved)
