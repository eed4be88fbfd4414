"""One ensemble of walkers: its state, and the pure step that carries it on."""

import dataclasses
import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.aliases import Aliases
from inference.posterior.sampling.proposal import Proposal

__all__ = ["WALKERS", "Ensemble", "advance", "new_ensemble", "restart", "warm_walkers"]

Array = NDArray[np.float64]

WALKERS = 32
_FEW_WALKERS = 16  # that start from draws of the posterior and jump through a law that fits it
_FEW_UNKNOWNS = 5  # at most: half of the walkers span what the others propose from
_TURNING = 0.4  # of the steps that are no independent jumps, where a wall has aliases
_SHORT = 0.1  # times the step that suits a normal posterior (ter Braak 2006)

Stream = tuple[NDArray[np.uint32], int, int, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Ensemble:
    """An ensemble and all its steps so far.

    Attributes
    ----------
    coords : ndarray, shape (walkers, d)
        Present positions, in the coordinates of the proposal.
    log_prob : ndarray, shape (walkers,)
        Their log density in these coordinates.
    chain : ndarray, shape (steps, walkers, d)
        Past positions z.
    chain_log_prob : ndarray, shape (steps, walkers)
        Their log density as parameters z.
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

    @property
    def walkers(self) -> int:
        """Number of walkers."""
        return len(self.coords)


def _stream(state: Any) -> Stream:
    """Return what matters of a RandomState's own tuple."""
    _, keys, place, kept, normal = state
    return np.asarray(keys, dtype=np.uint32), int(place), int(kept), float(normal)


def warm_walkers(unknowns: int) -> int:
    """Return how many walkers an ensemble needs that starts warm."""
    return _FEW_WALKERS if unknowns <= _FEW_UNKNOWNS else WALKERS


def new_ensemble(
    proposal: Proposal, z: Array, log_density: Array, seed: np.random.SeedSequence
) -> Ensemble:
    """Make an ensemble that has not moved yet, with a random stream of its own.

    Parameters
    ----------
    proposal : Proposal
        In whose coordinates it will walk.
    z : ndarray, shape (walkers, d)
        Starting points, linearly independent.
    log_density : ndarray, shape (walkers,)
        Their log density, finite.
    seed : numpy.random.SeedSequence
        One of its own, spawned.
    """
    walkers, d = z.shape
    state: Any = np.random.RandomState(np.random.MT19937(seed)).get_state(legacy=True)
    coords, log_det = proposal.unbend(z)
    return Ensemble(
        coords,
        log_density - log_det,
        np.empty((0, walkers, d)),
        np.empty((0, walkers)),
        np.zeros(walkers, dtype=np.int64),
        _stream(state),
    )


def restart(ensemble: Ensemble, old: Proposal, new: Proposal) -> Ensemble:
    """Return the ensemble where it stands, in another proposal's coordinates, without its past."""
    z, old_det = old.bend(ensemble.coords)
    coords, new_det = new.unbend(z)
    return dataclasses.replace(
        ensemble,
        coords=coords,
        log_prob=ensemble.log_prob - old_det - new_det,
        chain=ensemble.chain[:0],
        chain_log_prob=ensemble.chain_log_prob[:0],
        accepted=np.zeros_like(ensemble.accepted),
    )


def _moves(proposal: Proposal, aliases: Aliases | None) -> list[tuple[Any, float]]:
    """Independent jumps, and local moves that know nothing of the optima or the map's fit.

    Where the posterior is narrower than the ensemble is wide, as at the ends of a curved sheet, all
    steps of the ensemble's own width fail: a walker that gets there leaves by short ones.

    emcee's `DESnookerMove` (3.1.6) is not among them: its direction is not a unit vector and its
    acceptance has half the exponent of ter Braak and Vrugt (2008), so that it leaves a standard
    normal in nine dimensions with three quarters of its variance.
    """
    import emcee  # brings scipy.stats, see `inference.posterior.libraries`

    rest, turning = 1.0 - proposal.share, []
    if aliases is not None:
        move = emcee.moves.MHMove(functools.partial(_turn, proposal, aliases))
        turning = [(move, _TURNING * rest)]
        rest -= _TURNING * rest
    short = _SHORT * 2.38 / math.sqrt(2.0 * proposal.optima.centres.shape[1])
    return [
        (emcee.moves.MHMove(proposal.propose), proposal.share),
        (emcee.moves.DEMove(sigma=0.2), 0.4 * rest),
        (emcee.moves.DEMove(sigma=0.5, gamma0=short), 0.3 * rest),
        (emcee.moves.StretchMove(), 0.3 * rest),
        *turning,
    ]


def _turn(
    proposal: Proposal, aliases: Aliases, coords: Array, random: np.random.RandomState
) -> tuple[Array, Array]:
    """Propose aliases of walkers' coordinates, for emcee's `MHMove`."""
    z, old_det = proposal.bend(coords)
    new, ratio = aliases.propose(z, random)
    x, new_det = proposal.unbend(new)
    moved = np.isfinite(ratio)
    return np.where(moved[:, None], x, coords), ratio + old_det + new_det


def advance(
    density: CollapsedDensity,
    proposal: Proposal,
    ensemble: Ensemble,
    steps: int,
    aliases: Aliases | None = None,
) -> Ensemble:
    """Carry an ensemble on by some steps; the same whether in one call or in several.

    Parameters
    ----------
    proposal : Proposal
        Of the independent move, and the coordinates of all moves; must not change during a run.
    steps : int
        Number of steps.
    aliases : Aliases, optional
        Of the target, where it has any: what walkers jump to.

    Returns
    -------
    Ensemble
        With the steps appended.
    """
    import emcee

    walkers, d = ensemble.coords.shape

    def log_density(x: Array) -> Array:
        z, log_det = proposal.bend(x)
        return density(z) + log_det

    sampler = emcee.EnsembleSampler(
        walkers, d, log_density, moves=_moves(proposal, aliases), vectorize=True
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
    chain, log_prob = sampler.get_chain(), sampler.get_log_prob()
    z, log_det = proposal.bend(chain.reshape(-1, d))
    return Ensemble(
        np.array(state.coords),
        np.array(state.log_prob),
        np.concatenate([ensemble.chain, z.reshape(chain.shape)]),
        np.concatenate([ensemble.chain_log_prob, log_prob - log_det.reshape(log_prob.shape)]),
        ensemble.accepted + sampler.backend.accepted.astype(np.int64),
        _stream(sampler.random_state),
    )
