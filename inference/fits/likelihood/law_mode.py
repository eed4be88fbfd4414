"""The modes of a scene's joint law, each of which a fit takes as its prior in turn."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.joint_law import JointLaw

__all__ = ["LawMode", "law_modes"]

Array = NDArray[np.float64]


class LawMode(NamedTuple):
    """One mode of a joint law, normal in the coordinates z of `Parameters`.

    Attributes
    ----------
    centre, factor : ndarray, shape (d,), (d, d)
        Mean, and Cholesky factor of the covariance.
    deviance : float
        -2 log of its weight over the root of the covariance's determinant.
    """

    centre: Array
    factor: Array
    deviance: float


def law_modes(law: JointLaw | None) -> tuple[LawMode | None, ...]:
    """Return the modes of a law; (None,) where z is standard normal."""
    if law is None or law.weights.size == 0:
        return (None,)
    sizes = np.log(np.diagonal(law.factors, axis1=1, axis2=2)).sum(axis=1)
    deviances = 2.0 * (sizes - np.log(law.weights))
    return tuple(
        LawMode(centre, factor, deviance)
        for centre, factor, deviance in zip(
            law.centres, law.factors, deviances.tolist(), strict=True
        )
    )
