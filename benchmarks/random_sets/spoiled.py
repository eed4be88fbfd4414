"""Random sets of which the readings are spoiled, by what no scene states.

Real sensors have frames of something else, noise that is larger than stated, light and gain that
drift, and readings that are clipped, coarse or stuck. What can be told from the readings should be
a misfit; what cannot is a limit.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.paths import PathSet
from benchmarks.random_sets.sets import random_set
from benchmarks.random_sets.wide import between

__all__ = ["SPOILED", "spoiled_set"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
# readings anew, whether a frame no longer tells the range that it had, and a size for the name
Spoiled = tuple[Array, Flags, float]
# of readings, shape (n, 2), their read noise, and a source of randomness
Spoil = Callable[[Array, Array, np.random.Generator], Spoiled]


def _none(y: Array) -> Flags:
    return np.zeros(len(y), dtype=bool)


def _kicked(
    count: int, y: Array, read: Array, rng: np.random.Generator
) -> tuple[Array, NDArray[np.intp]]:
    """Return readings with some frames of something else: brighter, darker, or anywhere."""
    which, y = rng.choice(len(y), size=min(count, len(y)), replace=False), y.copy()
    if rng.random() < 0.5:
        y[which] *= between((0.3, 3.3), rng)
    else:
        y[which] += between((5.0, 1e4), rng) * read * rng.standard_normal((len(which), 2))
    return y, which


def _outlier(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    new, which = _kicked(1, y, read, rng)
    return new, np.isin(np.arange(len(y)), which), 1.0


def _outliers(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    count = max(2, round(0.1 * len(y)))
    new, which = _kicked(count, y, read, rng)
    return new, np.isin(np.arange(len(y)), which), float(count)


def _noise(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    times = between((1.3, 6.0), rng)
    more = math.sqrt(times**2 - 1.0) * read * rng.standard_normal(y.shape)
    return y + more, _none(y), times


def _tails(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    return y + read * rng.standard_t(2, size=y.shape), _none(y), 2.0


def _crosstalk_drift(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    size = between((3.0, 300.0), rng)
    way = size * read * rng.standard_normal(2)
    return y + np.linspace(0.0, 1.0, len(y))[:, None] * way, _none(y), size


def _gain_drift(y: Array, _: Array, rng: np.random.Generator) -> Spoiled:
    size = rng.uniform(-0.3, 0.3)
    return y * np.linspace(1.0, 1.0 + size, len(y))[:, None], _none(y), size


def _clipped(y: Array, _: Array, rng: np.random.Generator) -> Spoiled:
    share = rng.uniform(0.4, 0.95)
    most = share * np.abs(y).max(axis=0)
    return np.clip(y, -most, most), np.asarray((np.abs(y) > most).any(axis=1)), share


def _coarse(y: Array, read: Array, rng: np.random.Generator) -> Spoiled:
    step = between((1.0, 30.0), rng)
    return np.round(y / (step * read)) * step * read, _none(y), step


def _stuck(y: Array, _: Array, rng: np.random.Generator) -> Spoiled:
    first, count = int(rng.integers(len(y))), max(2, len(y) // 4)
    after = _none(y)
    after[first + 1 : first + count] = True
    return np.where(after[:, None], y[first], y), after, float(after.sum())


SPOILED: Mapping[str, Spoil] = {
    "one outlier": _outlier,
    "a tenth outliers": _outliers,
    "noise times": _noise,
    "tails of t with df": _tails,
    "crosstalk drifts by noises": _crosstalk_drift,
    "gain drifts by": _gain_drift,
    "clipped at": _clipped,
    "steps of noises": _coarse,
    "stuck for": _stuck,
}


def spoiled_set(seed: int, number: int) -> PathSet:
    """Draw a random set, and spoil it in one of the ways of `SPOILED`.

    Parameters
    ----------
    seed, number : int
        Of the study, a fresh one every time, and of the set in it.

    Returns
    -------
    PathSet
        Frames that show something else have no range that could be held.
    """
    data, rng = random_set(seed, number), np.random.default_rng([seed, number, 2])
    way = str(rng.choice(list(SPOILED)))
    read = np.asarray(data.sensor.noise.read, dtype=np.float64)
    readings, gone, size = SPOILED[way](data.frames.readings, read, rng)
    return dataclasses.replace(
        data,
        name=f"{way} {size:.3g}: {data.name}",
        frames=dataclasses.replace(data.frames, readings=readings),
        range_m=np.where(gone, np.nan, data.range_m),
    )
