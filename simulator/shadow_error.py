"""How wrong the shadow on a background may be: docs/model.md, shadow-error.

Before a flat wall no two numbers of the shadow's law (docs/model.md, 3.30) are right: a disk hides
the middle of the wall, which is its brightest and its nearest part. What the best two leave is a
relative error of the light that is left visible, and of the distance from which it seems to come.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["SHADOW_SD", "shadow_errors"]

Array = NDArray[np.float64]

# of both errors, in units of `shadow_errors`: what `python -m benchmarks.flat_wall` prints, of
# disks of 3 cm to 1 m radius before flat walls at 1.2 to 3 m, emitters from uniform to cos^3
SHADOW_SD = 0.2
_LEAST = 1e-12  # of what is hidden but for roundings no light is left to err


def shadow_errors(seen: Array) -> tuple[Array, Array]:
    """Return how large the errors are, in units of their size.

    Parameters
    ----------
    seen : ndarray
        Share S of the background that is left visible.

    Returns
    -------
    light, distance : ndarray
        (1 - S)/sqrt(S) of the light's relative error, 1 - S of the distance's. Both vanish where
        nothing is hidden, which frames without an object show; of what is nearly hidden the light
        errs by sqrt(S), absolutely.
    """
    share = np.clip(seen, _LEAST, 1.0)
    hidden = 1.0 - share
    return hidden / np.sqrt(share), hidden
