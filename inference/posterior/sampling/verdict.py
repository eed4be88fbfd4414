"""The verdict on a run: a list of gates, the first failure named first.

These gates look at the draws alone. Those that ask the density itself (another branch, another way
to the same means) are in `cross_check`; how often each alarms falsely, and what it catches, is
measured by `python -m benchmarks.verdict_gates`.
"""

import dataclasses
import hashlib
import math
from collections.abc import Callable, Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.sampling.diagnostics import (
    autocorrelation_time,
    effective_sample_size,
    split_r_hat,
)
from inference.posterior.sampling.ensemble import Ensemble

__all__ = ["MAX_R_HAT", "Chains", "Verdict", "chains_of", "judge"]

Array = NDArray[np.float64]

MAX_R_HAT = 1.01
_TAUS = 50.0  # steps of each ensemble, in autocorrelation times
_STAYS = 20.0  # and in those of the density by the proposal's
_LEAST_ACCEPTANCE = 0.05
_BURN_IN = 0.2  # share of the steps left out
_STANDSTILL = 0.25  # of the kept steps that a walker may spend in one place
_TRANSITIONS = 20  # between modes, over all walkers
_DISAGREEMENT = 1e-5  # false-alarm rate of the comparison of the ensembles' means
_STUCK = 0.1  # of the walkers that began at draws, that may stay where they began


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Whether to believe the draws.

    Attributes
    ----------
    converged : bool
        Whether every gate was passed.
    reasons : tuple of str
        Why not, in the order of the gates.
    """

    converged: bool
    reasons: tuple[str, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Chains:
    """Kept draws of all ensembles.

    Attributes
    ----------
    z : ndarray, shape (ensembles, walkers, steps, d)
        Draws after the burn-in.
    log_density : ndarray, shape (ensembles, walkers, steps)
        Their log density.
    mode : ndarray, shape (ensembles, walkers, steps)
        Index of the optimum that each belongs to.
    acceptance : ndarray, shape (ensembles, walkers)
        Share of accepted proposals.
    names : tuple of str
        Names of the parameters.
    streams : tuple of bytes
        Digest of where each ensemble's random stream stands; empty where that is not known.
    log_ratio : ndarray, shape (ensembles, m, steps), or None
        Log of the density over that of the proposal, of the first m walkers; None where nothing was
        proposed from.
    start : float or None
        Effective size of the draws of the posterior at which all ensembles but the last began;
        None where they began elsewhere.
    """

    z: Array
    log_density: Array
    mode: NDArray[np.intp]
    acceptance: Array
    names: tuple[str, ...]
    streams: tuple[bytes, ...] = ()
    log_ratio: Array | None = None
    start: float | None = None

    @property
    def stay(self) -> float:
        """Autocorrelation time of the density over that of the proposal [steps].

        Walkers stay longest where it is largest: jumps seldom lead there, and seldom away. A branch
        of some thousandths in which walkers stay moves the means of parameters little at each step,
        and is lost in what their own autocorrelation sums up. nan where it is not known.
        """
        if self.log_ratio is None:
            return math.nan
        ratio = np.exp(self.log_ratio - self.log_ratio.max())
        return autocorrelation_time(ratio.reshape(-1, ratio.shape[-1]).T, common=True)

    def quantities(self) -> Iterator[tuple[str, Array]]:
        """Yield every parameter, the log density and, with several modes, their indicators."""
        for j, name in enumerate(self.names):
            yield name, self.z[..., j]
        yield "log density", self.log_density
        if self.mode.max() > 0:
            for k in range(int(self.mode.max()) + 1):
                yield f"mode {k + 1}", (self.mode == k).astype(float)


def chains_of(
    ensembles: tuple[Ensemble, ...],
    nearest: Callable[[Array], NDArray[np.intp]],
    names: tuple[str, ...],
    start: float | None = None,
) -> Chains:
    """Leave out the burn-in and line up the draws of all ensembles."""
    skip = math.ceil(_BURN_IN * ensembles[0].steps)
    z = np.array([e.chain[skip:].transpose(1, 0, 2) for e in ensembles])
    log_density = np.array([e.chain_log_prob[skip:].T for e in ensembles])
    mode = nearest(z.reshape(-1, z.shape[-1])).reshape(z.shape[:-1])
    acceptance = np.array([e.accepted / max(e.steps, 1) for e in ensembles])
    streams = tuple(map(_digest, ensembles))
    return Chains(z, log_density, mode, acceptance, names, streams, start=start)


def _digest(ensemble: Ensemble) -> bytes:
    key, *rest = ensemble.random
    return hashlib.sha256(key.tobytes() + repr(rest).encode()).digest()


def _moved(chains: Chains) -> NDArray[np.bool_]:
    """Return whether each walker moved at each step but the first."""
    moved: NDArray[np.bool_] = np.any(np.diff(chains.z, axis=2) != 0, axis=-1)
    return moved


def _shared_streams(chains: Chains) -> str | None:
    """Find ensembles that draw the same random numbers, or that landed in the same place.

    Two independent ensembles never move a walker to the very same point. Common starting points
    are no finding: only a step that at least one of the two walkers made counts.
    """
    moved = _moved(chains)
    for a in range(chains.z.shape[0]):
        for b in range(a):
            same = chains.z[a, :, 1:, 0] == chains.z[b, :, 1:, 0]
            same &= moved[a] | moved[b]
            met = same.any() and bool(
                np.all(chains.z[a, :, 1:][same] == chains.z[b, :, 1:][same], axis=-1).any()
            )
            if met or (chains.streams and chains.streams[a] == chains.streams[b]):
                return f"ensembles {b + 1} and {a + 1} share a stream of random numbers"
    return None


def _start(chains: Chains) -> str | None:
    if not (np.isfinite(chains.log_density).all() and np.isfinite(chains.z).all()):
        return "walkers stand where the density is zero"
    return None


def _acceptance(chains: Chains) -> str | None:
    moved = _moved(chains)
    steps = moved.shape[2]
    stuck = ~moved.any(axis=2)
    if stuck.mean() > (0.0 if chains.start is None else _STUCK):
        return f"{int(stuck.sum())} walkers never moved after the burn-in"
    worst = float(chains.acceptance.mean(axis=1).min())
    if worst < _LEAST_ACCEPTANCE:
        return f"an ensemble accepted only {worst:.1%} of its proposals"
    if chains.start is not None:
        return None
    index = np.arange(steps)
    last = np.maximum.accumulate(np.where(moved, index, -1), axis=2)
    longest = int((index - last).max())
    if longest > _STANDSTILL * steps:
        return f"a walker stood still for {longest} of {steps} steps"
    return None


def _length(chains: Chains) -> str | None:
    steps = chains.z.shape[2]
    worst, name = 0.0, ""
    for quantity, draws in chains.quantities():
        if quantity.startswith("mode"):
            continue  # few walkers change mode; transitions are counted instead
        tau = autocorrelation_time(draws.reshape(-1, steps).T)
        if not math.isfinite(tau):
            return f"the autocorrelation time of {quantity} is not finite"
        if tau > worst:
            worst, name = tau, quantity
    if steps < _TAUS * worst:
        return (
            f"{steps} steps are only {steps / worst:.0f} autocorrelation times of {name}, "
            f"{_TAUS:.0f} are needed"
        )
    return None


def _stay(chains: Chains) -> str | None:
    steps, stay = chains.z.shape[2], chains.stay
    if steps < _STAYS * stay:
        return (
            f"{steps} steps are only {steps / stay:.0f} times as long as walkers stay where hardly "
            f"any jump leads, {_STAYS:.0f} are needed: a branch there may be told too little"
        )
    return None


def _agreement(chains: Chains) -> str | None:
    worst, name = 1.0, ""
    for quantity, draws in chains.quantities():
        r_hat = split_r_hat(draws)
        if not r_hat <= worst:
            worst, name = r_hat, quantity
    if worst > MAX_R_HAT:
        return f"R-hat of {name} over the ensembles is {worst:.3f}, above {MAX_R_HAT}"
    return None


def _means(chains: Chains) -> str | None:
    """Compare the ensembles' means with their own Monte Carlo errors: a chi-square test."""
    ensembles, _, steps = chains.log_density.shape
    tests = len(chains.names) + 1
    for quantity, draws in chains.quantities():
        if quantity.startswith("mode"):
            continue
        if chains.start is None:
            means = draws.mean(axis=1)
            tau = autocorrelation_time(means.T)
            independent = steps / tau
        else:
            means = draws.mean(axis=2)
            independent = float(means.shape[1])
        error = float(means.var(axis=1, ddof=1).mean()) / independent
        centre = means.mean(axis=1)
        square = float(((centre - centre.mean()) ** 2).sum()) / error
        # the error itself is estimated, from so many independent values an ensemble
        freedom = max(ensembles * (independent - 1), 1.0)
        p = float(scipy.stats.f.sf(square / (ensembles - 1), ensembles - 1, freedom))
        if p < _DISAGREEMENT / tests:
            return f"the ensembles' means of {quantity} differ by more than their errors"
    return None


def _precision(chains: Chains, target_ess: int) -> str | None:
    """Hold the Monte Carlo errors of the means to what was asked for."""
    least, name = math.inf, ""
    for quantity, draws in zip(chains.names, np.moveaxis(chains.z, -1, 0), strict=True):
        ess = effective_sample_size(draws, chains.start)
        if not ess >= least:  # a constant has none
            least, name = ess, quantity
    if math.isnan(least):
        return f"{name} does not move, so that its mean has no Monte Carlo error"
    if least < target_ess:
        return (
            f"the mean of {name} has a Monte Carlo error of {1 / math.sqrt(least):.2g} standard "
            f"deviations, {1 / math.sqrt(target_ess):.2g} was asked for: its effective sample size "
            f"is {least:.0f}, below {target_ess}"
        )
    return None


def _transitions(chains: Chains) -> str | None:
    if chains.mode.max() == 0:
        return None
    changes = np.diff(chains.mode, axis=2) != 0
    for k in range(int(chains.mode.max()) + 1):
        weight = float((chains.mode == k).mean())
        entries = int((changes & (chains.mode[:, :, 1:] == k)).sum())
        if weight > 0.01 and entries < _TRANSITIONS:
            return (
                f"walkers entered mode {k + 1} only {entries} times: its weight is not determined"
            )
    return None


def judge(chains: Chains, target_ess: int) -> Verdict:
    """Pass the draws through all gates.

    Of walkers that began at draws of the posterior neither a length is asked, nor entries into
    every mode: how often modes and branches were drawn is then told by how many walkers are there.

    Parameters
    ----------
    target_ess : int
        Effective sample size wanted for every parameter.

    Returns
    -------
    Verdict
        With every gate that failed, in order; the first is the one to mend first.
    """
    if chains.z.shape[2] < 4:
        return Verdict(False, ("too few steps were made to judge them",))
    first = [reason for gate in (_shared_streams, _start) if (reason := gate(chains)) is not None]
    if _start(chains) is not None:
        return Verdict(False, tuple(first))  # nothing can be computed from infinities
    walked = chains.start is None
    findings = (
        _acceptance(chains),
        _length(chains) if walked else None,
        _stay(chains) if walked else None,
        _agreement(chains),
        _means(chains),
        _precision(chains, target_ess),
        _transitions(chains) if walked else None,
    )
    reasons = (*first, *(reason for reason in findings if reason is not None))
    return Verdict(not reasons, reasons)
