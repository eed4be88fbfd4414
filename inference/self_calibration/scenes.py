"""Scenes for the time before a calibration, and what is known in each."""

import functools
from typing import Any

import numpy as np

from inference.posterior.selection.models import reduced
from simulator.errors import InvalidInputError
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor

__all__ = ["about_object", "check_unknown", "knowledge", "open_names", "prior_scene", "trackable"]

_DRAWS = 1000


def open_names(sensor: Sensor, scene: Scene) -> tuple[str, ...]:
    """Return the names of a scene's unknowns, without those of the law of ranges."""
    names = parameters_of(sensor, scene).names
    return tuple(name for name in names if not name.startswith("range_m."))


def check_unknown(sensor: Sensor, scene: Scene) -> None:
    """Refuse a scene of which nothing is to be learnt.

    Raises
    ------
    InvalidInputError
        At "/calibrate".
    """
    if not open_names(sensor, prior_scene(scene)):
        raise InvalidInputError.at(
            "/calibrate",
            "nothing of the scene is unknown, so there is nothing to learn: state priors for what "
            "may change, the crosstalk first, or leave calibrate out",
        )


def prior_scene(scene: Scene) -> Scene:
    """Return what was stated before any calibration."""
    return scene.model_copy(update={"joint": None, "calibration": None})


def about_object(scene: Scene, stated: Scene) -> Scene | None:
    """Return a stated scene with what another knows of the object alone; None where it is nothing.

    Parameters
    ----------
    scene : Scene
        One that was calibrated.
    stated : Scene
        Its priors.
    """
    if scene.joint is None or stated.optional_terms:
        return None
    own = [name for name in scene.joint.unknowns if name.startswith("object.")]
    if not own:
        return None
    law = scene.joint.marginal(own)
    return _with_law(stated, own, [mode.model_dump(mode="json") for mode in law.modes])


def trackable(sensor: Sensor, scene: Scene) -> Scene:
    """Return a scene whose joint law names every unknown, by its prior where nothing else does.

    A tracker then carries all of them as errors that its frames share, and learns none of them:
    what is as little known as a prior is beyond what it could learn frame by frame.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene; optional terms stay.
    """
    whole = reduced(scene, scene.optional_terms)
    names = open_names(sensor, whole)
    told = () if whole.joint is None else whole.joint.unknowns
    missing = [name for name in names if name not in told]
    if not missing:
        return whole
    d, k = len(told), len(missing)
    modes = [(1.0, np.zeros(0), np.zeros((0, 0)))]
    if whole.joint is not None:
        modes = [(m.weight, np.array(m.mean), np.array(m.covariance)) for m in whole.joint.modes]
    laws = []
    for weight, mean, covariance in modes:
        matrix = np.eye(d + k)
        matrix[:d, :d] = covariance
        laws.append(
            {
                "weight": weight,
                "mean": [*mean.tolist(), *[0.0] * k],
                "covariance": matrix.tolist(),
            }
        )
    return _with_law(whole, [*told, *missing], laws)


def _with_law(scene: Scene, names: list[str], modes: list[dict[str, Any]]) -> Scene:
    document = prior_scene(scene).model_dump(mode="json", exclude_none=True)
    return parse_scene(document | {"joint": {"unknowns": names, "modes": modes}})


@functools.lru_cache(maxsize=64)
def knowledge(sensor: Sensor, scene: Scene) -> dict[str, dict[str, float]]:
    """Describe what is known of each unknown, for a reader.

    Returns
    -------
    dict
        Of each unknown q05, q50 and q95 [SI units, reading units], from draws that are the same
        every time.
    """
    parameters = parameters_of(sensor, scene)
    draws = parameters.natural(parameters.sample(np.random.default_rng(0), _DRAWS))
    quantiles = np.quantile(draws, [0.05, 0.5, 0.95], axis=0).T.tolist()
    rows = dict(zip(parameters.names, quantiles, strict=True))
    kept = open_names(sensor, scene)
    return {name: dict(zip(("q05", "q50", "q95"), rows[name], strict=True)) for name in kept}
