"""What no method can do better: the Cramer-Rao bound, and one division a frame."""

import numpy as np
from scipy import special

from inference.identifiability.before_data import identifiability
from service.report.clock import best
from service.report.readings import told_of_object
from service.report.scenes import ReportScene
from simulator.errors import HybridTofError
from simulator.scene import Scene, parse_scene

__all__ = ["division_s", "least_error"]


_FRAMES = 40
_BATCH = 100_000


def division_s() -> float:
    """Return what one division a frame takes, which is the least that a range costs [s]."""
    late, whole = np.full(_BATCH, 0.5), np.full(_BATCH, 2.0)
    out = np.empty(_BATCH)

    def divide() -> None:
        for _ in range(100):
            np.divide(late, whole, out=out)

    return best(divide)[1] / (100 * _BATCH)


def _all_known(scene: ReportScene) -> Scene:
    """Return the scene with every number known; the model as exact as the noise alone."""
    told = told_of_object(scene).model_dump(mode="json", exclude_unset=True)
    truth = scene.truth.model_dump(mode="json", exclude_unset=True)
    return parse_scene(truth | {"object": told["object"], "discrepancy": 0})


def least_error(scene: ReportScene) -> float | None:
    """Return the median relative error that noise alone leaves where all but the range is known.

    Returns
    -------
    float or None
        Of an efficient unbiased estimator with normal errors, over ranges evenly in log r; None
        where there is no bound.
    """
    ranges = np.geomspace(scene.from_m, scene.to_m, _FRAMES).tolist()
    try:
        foreseen = identifiability(scene.sensor, _all_known(scene), ranges)
    except HybridTofError:
        return None
    sd = np.sqrt(foreseen.information.own_variance)
    sd = sd[np.isfinite(sd)]
    if not sd.size:
        return None
    # sizes of a normal error at even steps of its distribution
    sizes = special.ndtri(0.5 + 0.5 * (np.arange(200) + 0.5) / 200)
    return float(np.median(np.outer(sd, sizes)))
