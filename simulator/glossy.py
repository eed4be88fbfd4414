"""How the default priors of an object would be those of a glossy one.

A glossy surface mirrors the emitter: its light falls off as from an object of many times the size,
and is weaker. Where a scene says nothing of the object it may as well be glossy
(docs/model.md, glossy-object).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulator.scene import Scene

__all__ = ["glossy_move"]

_SIZE, _REFLECTANCE = "object.c0", "object.c2"
# glossy plates of Appendix B against diffuse ones of the same size, over the sigmas of the default
# priors: c0 is exp(4) times as large in the median, c2 a quarter
_MOVES = {_SIZE: 4.0 / 2.0, _REFLECTANCE: math.log(0.25) / 1.0}


def glossy_move(scene: Scene, names: Sequence[str]) -> NDArray[np.float64] | None:
    """Return by how much the middles of the priors move if the object is glossy.

    Parameters
    ----------
    scene : Scene
        What is stated of it stands.
    names : sequence of str
        Of the unknowns.

    Returns
    -------
    ndarray, shape (d,), or None
        Standard deviations of the priors of ``names``. None where c0 is known, or its prior is
        stated or learnt, or the scene says that its model is exact: priors then mean what they
        say. A prior of c2 that is stated stands in any case.
    """
    error = scene.model_error
    learnt = () if scene.joint is None else scene.joint.unknowns
    said = {_SIZE: scene.object.c0, _REFLECTANCE: scene.object.c2}
    left = {name for name, value in said.items() if value is None and name not in learnt}
    if _SIZE not in left or _SIZE not in names or not (error.flux or error.range_m):
        return None
    return np.array([_MOVES[name] if name in left else 0.0 for name in names])
