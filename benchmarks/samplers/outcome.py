"""What a sampler reached, judged for all by the same functions."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.posterior.sampling.diagnostics import effective_sample_size, split_r_hat

Array = NDArray[np.float64]

TARGET_ESS = 400
TARGET_R_HAT = 1.01


@dataclasses.dataclass
class Outcome:
    """What a sampler reached: cost, and weighted draws of the globals in z."""

    seconds: float
    reached: bool
    ess: float
    r_hat: float
    z: Array
    weights: Array
    note: str = ""


def judged(z: Array, start: float | None = None) -> tuple[float, float]:
    """Least effective sample size and largest R-hat of (chains, walkers, steps, d).

    `start` is that of walkers which began at draws of the posterior.
    """
    columns = np.moveaxis(z, -1, 0)
    sizes = [effective_sample_size(x, start) for x in columns]
    return float(np.nan_to_num(min(sizes))), float(max(split_r_hat(x) for x in columns))


def equal(z: Array) -> tuple[Array, Array]:
    flat = z.reshape(-1, z.shape[-1])
    return flat, np.full(len(flat), 1 / len(flat))


def enough(ess: float, r_hat: float) -> bool:
    return ess >= TARGET_ESS and r_hat <= TARGET_R_HAT
