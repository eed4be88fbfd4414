"""Draws that look like those of real ensembles, at a thousandth of their cost; and cheap targets.

What real ensembles of 32 walkers show on such targets (`python -m benchmarks.verdict_gates`):
walkers forget at one rate, stand still in between, and the means over an ensemble fluctuate a
little more than those of independent walkers would.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal, special, stats

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.ensemble import advance, new_ensemble
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.verdict import Chains, chains_of

Array = NDArray[np.float64]

ACCEPTANCE = 2 / 3
INFLATION = 1.2  # of the variance of an ensemble's mean, against independent walkers
NAMES = ("a", "b", "c")
LAWS = ("normal", "student", "bimodal")
DISTANCE = 6.0  # between the two modes
UPPER = 0.3  # weight of the upper mode
_DEGREES = 5.0
_GRID = np.linspace(-9.0, 9.0, 4001)
_STUDENT = stats.t(_DEGREES).ppf(special.ndtr(_GRID))


def _autoregression(noise: Array, rho: float) -> Array:
    """Stationary first-order autoregression of unit variance along axis 2."""
    noise[:, :, 1:] *= np.sqrt(1 - rho**2)
    return np.asarray(signal.lfilter([1.0], [1.0, -rho], noise, axis=2))


def surrogate(
    rng: np.random.Generator,
    steps: int,
    tau: float = 4.0,
    law: str = "normal",
    ensembles: int = 4,
    walkers: int = 32,
) -> Chains:
    """Make a healthy run: stationary from its first step, of a known law with means known.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    steps : int
        Kept steps.
    tau : float
        Integrated autocorrelation time of a walker, at least 2.
    law : str
        Of LAWS.
    ensembles, walkers : int
        How many.

    Returns
    -------
    Chains
        Of three parameters; with the bimodal law the first one tells the mode.
    """
    shape = (ensembles, walkers, steps)
    forget = 2.0 / (tau + 1.0)  # a step, of which the share ACCEPTANCE moves at all
    own = _autoregression(rng.standard_normal((*shape, 4)), 1 - forget / ACCEPTANCE)
    common = _autoregression(rng.standard_normal((ensembles, 1, steps, 4)), 1 - forget)
    share = (INFLATION - 1) / (walkers - 1)
    moves = rng.random(shape) < ACCEPTANCE
    moves[:, :, 0] = True
    event = np.cumsum(moves, axis=2) - 1
    last = np.maximum.accumulate(np.where(moves, np.arange(steps), 0), axis=2)
    x = np.sqrt(1 - share) * np.take_along_axis(own, event[..., None], axis=2)
    whole = np.broadcast_to(common, (*shape, 4))
    x = x + np.sqrt(share) * np.take_along_axis(whole, last[..., None], axis=2)
    z, mode = x[..., :3].copy(), np.zeros(shape, dtype=np.intp)
    if law == "student":
        z = np.interp(z, _GRID, _STUDENT)
    elif law == "bimodal":
        mode = (x[..., 3] > -special.ndtri(UPPER)).astype(np.intp)
        z[..., 0] += DISTANCE * mode
    log_density = target(law)(z.reshape(-1, 3)).reshape(shape)
    return Chains(z, log_density, mode, moves.mean(axis=2), NAMES)


def target(law: str) -> Callable[[Array], Array]:
    """Return the log density that a law's surrogates are drawn from, up to a constant."""
    if law == "student":
        return lambda z: np.asarray(-0.5 * (_DEGREES + 1) * np.log1p(z * z / _DEGREES).sum(axis=1))
    if law == "bimodal":
        return lambda z: np.asarray(
            -0.5 * (z[:, 1:] ** 2).sum(axis=1)
            + np.logaddexp(
                np.log(1 - UPPER) - 0.5 * z[:, 0] ** 2,
                np.log(UPPER) - 0.5 * (z[:, 0] - DISTANCE) ** 2,
            )
        )
    return lambda z: np.asarray(-0.5 * (z * z).sum(axis=1))


def optima_of(law: str, d: int = 3) -> Mixture:
    """Return the Laplace approximations of a law's optima."""
    centres = np.zeros((2 if law == "bimodal" else 1, d))
    weights = np.ones(1)
    if law == "bimodal":
        centres[1, 0], weights = DISTANCE, np.array([1 - UPPER, UPPER])
    return Mixture(centres, np.repeat(np.eye(d)[None], len(centres), axis=0), weights)


def banana(z: Array) -> Array:
    """Log density of a normal law bent in its first two coordinates."""
    bent = z[:, 1] - 0.5 * (z[:, 0] ** 2 - 1)
    return np.asarray(-0.5 * (z**2).sum(axis=1) + 0.5 * z[:, 1] ** 2 - 0.5 * bent**2)


@dataclasses.dataclass(frozen=True, eq=False)
class Cheap(CollapsedDensity):
    """A log density of points in place of the collapsed one of a scene."""

    function: Callable[[Array], Array]

    def __call__(self, z: Array) -> Array:
        return self.function(np.atleast_2d(z))


def cheap(function: Callable[[Array], Array]) -> Cheap:
    """Return a target that `advance` takes, with nothing behind it but a function."""
    density = object.__new__(Cheap)
    object.__setattr__(density, "function", function)
    return density


def ensembles_of(
    function: Callable[[Array], Array],
    optima: Mixture,
    seed: int,
    steps: int,
    starts: Array | None = None,
    shared: bool = False,
    share: float = 0.5,
) -> Chains:
    """Run four real ensembles of 32 walkers.

    Parameters
    ----------
    function : callable
        Log density of points (n, d).
    optima : Mixture
        What they jump to, and start from.
    seed, steps : int
        Of the run; a fifth of the steps is left out.
    starts : ndarray, shape (ensembles, walkers, d), optional
        Instead of draws from the optima.
    shared : bool
        Whether all ensembles are given one stream, which is a defect.
    share : float
        Of the steps that jump to the optima.

    Returns
    -------
    Chains
    """
    density, made = cheap(function), []
    proposal = Proposal(optima, None, share)
    for k in range(4):
        stream = np.random.SeedSequence(seed, spawn_key=(0 if shared else k,))
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(9, k)))
        coords = optima.draw(rng, 32) if starts is None else starts[k]
        ensemble = new_ensemble(proposal, coords, function(coords), stream)
        made.append(advance(density, proposal, ensemble, steps))
    return chains_of(tuple(made), optima.nearest, tuple("abcdefgh"[: optima.centres.shape[1]]))


def linear_run(
    rng: np.random.Generator, sharpness: float, truth: float, draws: int = 400
) -> tuple[Array, Callable[[Array], tuple[Array, Array]]]:
    """Draw from the exact posterior of a mean whose prior is uniform on (0, 1), and linearise it.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of randomness.
    sharpness : float
        Standard deviation of the data's only number.
    truth : float
        What it is the noisy reading of; from the prior in a healthy run.
    draws : int
        How many.

    Returns
    -------
    (ndarray, callable)
        Draws in the prior's normal coordinate, shape (draws, 1), and what `scores` takes.
    """
    reading = truth + sharpness * rng.standard_normal()
    a, b = -reading / sharpness, (1 - reading) / sharpness
    x = stats.truncnorm(a, b, loc=reading, scale=sharpness).rvs(draws, random_state=rng)
    z = special.ndtri(np.clip(x, 1e-300, 1 - 1e-16))[:, None]

    def linearised(point: Array) -> tuple[Array, Array]:
        slope = np.exp(-0.5 * point**2) / np.sqrt(2 * np.pi)
        return (reading - special.ndtr(point)) / sharpness, -slope[None] / sharpness

    return z, linearised


def rotated(chains: Chains, seed: int) -> tuple[Chains, Array]:
    """Turn and stretch draws into a thin sheet: axes of 1, 1e-2 and 1e-4; and the map."""
    rng = np.random.default_rng(seed)
    turn = linalg.qr(rng.standard_normal((3, 3)))[0]
    matrix = np.asarray(np.diag([1.0, 1e-2, 1e-4]) @ turn, dtype=np.float64)
    return dataclasses.replace(chains, z=chains.z @ matrix), matrix
