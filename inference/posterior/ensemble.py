"""One ensemble of walkers: its state, and the pure step that carries it on."""

import dataclasses
from typing import Any

import emcee
import numpy as np
from numpy.typing import NDArray

from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.proposal import Mixture

__all__ = ["Ensemble", "advance", "forget", "new_ensemble"]

Array = NDArray[np.float64]
Stream = tuple[NDArray[np.uint32], int, int, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Ensemble:
    """An ensemble and all its steps so far.

    Attributes
    ----------
    coords : ndarray, shape (walkers, d)
        Present positions.
    log_prob : ndarray, shape (walkers,)
        Their log density.
    chain : ndarray, shape (steps, walkers, d)
        Past positions.
    chain_log_prob : ndarray, shape (steps, walkers)
        Their log density.
    accepted : ndarray of int, shape (walkers,)
        Accepted proposals.
    random : (ndarray of uint32, int, int, float)
        Key and position of this ensemble's own Mersenne twister, and whether and which normal
        variate it still holds back: they come in pairs.
    """

    coords: Array
    log_prob: Array
    chain: Array
    chain_log_prob: Array
    accepted: NDArray[np.int64]
    random: Stream

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return int(self.chain.shape[0])


def _stream(state: Any) -> Stream:
    """Return what matters of a RandomState's own tuple."""
    return np.asarray(state[1], dtype=np.uint32), int(state[2]), int(state[3]), float(state[4])


def new_ensemble(coords: Array, log_prob: Array, seed: np.random.SeedSequence) -> Ensemble:
    """Make an ensemble that has not moved yet, with a random stream of its own.

    Parameters
    ----------
    coords : ndarray, shape (walkers, d)
        Starting points, linearly independent.
    log_prob : ndarray, shape (walkers,)
        Their log density, finite.
    seed : numpy.random.SeedSequence
        One of its own, spawned.

    Returns
    -------
    Ensemble
    """
    walkers, d = coords.shape
    state: Any = np.random.RandomState(np.random.MT19937(seed)).get_state(legacy=True)
    return Ensemble(
        coords,
        log_prob,
        np.empty((0, walkers, d)),
        np.empty((0, walkers)),
        np.zeros(walkers, dtype=np.int64),
        _stream(state),
    )


def forget(ensemble: Ensemble) -> Ensemble:
    """Return the ensemble where it stands, without its past."""
    return dataclasses.replace(
        ensemble,
        chain=ensemble.chain[:0],
        chain_log_prob=ensemble.chain_log_prob[:0],
        accepted=np.zeros_like(ensemble.accepted),
    )


def _moves(mixture: Mixture, share: float) -> list[tuple[Any, float]]:
    """Independent jumps between the optima, and local moves that know nothing of them."""
    rest = 1.0 - share
    return [
        (emcee.moves.MHMove(mixture.propose), share),
        (emcee.moves.DEMove(sigma=0.2), 0.4 * rest),
        (emcee.moves.DESnookerMove(), 0.2 * rest),
        (emcee.moves.StretchMove(), 0.4 * rest),
    ]


def advance(
    density: CollapsedDensity, mixture: Mixture, ensemble: Ensemble, steps: int
) -> Ensemble:
    """Carry an ensemble on by some steps; the same whether in one call or in several.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    mixture : Mixture
        Proposal of the independent move; must not change during a run.
    ensemble : Ensemble
        Where it stands.
    steps : int
        Number of steps.

    Returns
    -------
    Ensemble
        With the steps appended.
    """
    walkers, d = ensemble.coords.shape
    sampler = emcee.EnsembleSampler(
        walkers, d, density, moves=_moves(mixture, mixture.share), vectorize=True
    )
    state = emcee.State(
        ensemble.coords.copy(),
        log_prob=ensemble.log_prob.copy(),
        random_state=("MT19937", *ensemble.random),
    )
    # the setter swallows errors: make sure that the stream is this ensemble's own
    sampler.random_state = state.random_state
    if not np.array_equal(sampler.random_state[1], ensemble.random[0]):
        raise RuntimeError("emcee did not take the ensemble's random state")
    state = sampler.run_mcmc(state, steps, skip_initial_state_check=True)
    return Ensemble(
        np.array(state.coords),
        np.array(state.log_prob),
        np.concatenate([ensemble.chain, sampler.get_chain()]),
        np.concatenate([ensemble.chain_log_prob, sampler.get_log_prob()]),
        ensemble.accepted + sampler.backend.accepted.astype(np.int64),
        _stream(sampler.random_state),
    )
