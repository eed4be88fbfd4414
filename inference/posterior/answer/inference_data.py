"""Draws in the groups that ArviZ reads, a chain for every walker so that draws are steps in time.

Walkers of one ensemble propose from one another: a chain of its own each is right for traces and
autocorrelation, not for R-hat, which the verdict takes over ensembles.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.draws import Draws

__all__ = ["inference_data"]


def inference_data(draws: Draws, method: str, seed: int) -> Any:
    """Return draws as ArviZ takes them.

    Parameters
    ----------
    draws : Draws
        Of a posterior.
    method : str
        How they were made.
    seed : int
        From which.

    Returns
    -------
    arviz.InferenceData or xarray.DataTree
        As `Posterior.to_arviz` has it.
    """
    # of use only to those who have ArviZ, and slow to import
    import arviz
    import xarray

    ensembles, walkers, _ = draws.log_density.shape
    chains = ensembles * walkers
    ensemble, walker = (index.ravel() for index in np.mgrid[:ensembles, :walkers])
    # nan where a frame has no object or is saturated: no draw, and nothing to diagnose
    seen = np.flatnonzero(np.isfinite(draws.log_likelihood).all(axis=(0, 1, 2)))
    held = np.flatnonzero(np.isfinite(draws.range_m).all(axis=(0, 1, 2)))

    def dataset(
        values: dict[str, NDArray[Any]], steps: NDArray[np.intp], frames: NDArray[np.intp]
    ) -> Any:
        rows = {
            name: (
                ("chain", "draw", "frame")[: value.ndim - 1],
                value.reshape(chains, *value.shape[2:]),
            )
            for name, value in values.items()
        }
        coordinates: dict[str, Any] = {
            "chain": np.arange(chains),
            "draw": draws.step[steps],
            "ensemble": ("chain", ensemble),
            "walker": ("chain", walker),
        }
        if any(value.ndim == 4 for value in values.values()):
            coordinates["frame"] = frames
        attributes = {"inference_library": "hybridtof", "method": method, "seed": seed}
        return xarray.Dataset(rows, coordinates, attributes)

    def parameters(steps: NDArray[np.intp]) -> dict[str, NDArray[Any]]:
        return {name: draws.parameters[:, :, steps, j] for j, name in enumerate(draws.names)}

    def statistics(steps: NDArray[np.intp]) -> dict[str, NDArray[Any]]:
        found = {"lp": draws.log_density, "accepted": draws.accepted, "mode": draws.mode}
        return {name: value[:, :, steps] for name, value in found.items()}

    every, some = np.arange(draws.step.size), draws.thinned
    groups = {
        "posterior": dataset({**parameters(some), "range_m": draws.range_m[..., held]}, some, held),
        "sample_stats": dataset(statistics(some), some, seen),
        "posterior_predictive": dataset(
            {name: draws.readings[..., seen, k] for k, name in enumerate(("first", "second"))},
            some,
            seen,
        ),
        "log_likelihood": dataset({"readings": draws.log_likelihood[..., seen]}, some, seen),
        "every_step": dataset({**parameters(every), **statistics(every)}, every, seen),
    }
    if not hasattr(arviz, "InferenceData"):  # of ArviZ 1
        return xarray.DataTree.from_dict(groups)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="every_step group is not defined")
        return arviz.InferenceData(**groups)
