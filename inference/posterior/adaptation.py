"""What ensembles propose from: a map fitted to populations, and fitted anew to slow draws."""

import dataclasses

import numpy as np

from inference.posterior.job import Checkpoint, Job
from inference.posterior.launch import POPULATIONS, WALKERS, new_ensembles
from inference.posterior.sampling.diagnostics import autocorrelation_time
from inference.posterior.sampling.ensemble import restart
from inference.posterior.sampling.shear import shear_of
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.verdict import Chains, Verdict

__all__ = ["adapt", "is_slow", "set_out"]

# steps of autocorrelation above which the proposal is adapted: as often as there are entries
_SLOW = (10.0, 10.0, 40.0)
_PILOT_DRAWS = 10_000
_MAP_SHARE = 0.55  # of the steps that are independent jumps through a map


def set_out(job: Job, checkpoint: Checkpoint) -> Checkpoint:
    """Fit a map to the populations that arrived, and set up ensembles in its coordinates.

    The last ensemble starts around the optima of the multistart, the others from populations that
    came from the prior and know nothing of them: they can contradict one another.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job, and where it stands: populations at the posterior, or dead.

    Returns
    -------
    Checkpoint
    """
    proposal = checkpoint.proposal
    arrived = [p.z for p in checkpoint.populations if p is not None and len(p.z)]
    if proposal is None:
        raise ValueError("nothing is to be sampled")
    density = job.density()
    count = job.settings.ensembles
    starts = [np.empty((0, len(density.parameters)))] * count
    if arrived:
        transport = fit_map(np.concatenate(arrived), shear_of(density))
        proposal = dataclasses.replace(proposal, transport=transport, share=_MAP_SHARE)
        orders = [job.stream(10, k).permutation(len(z)) for k, z in enumerate(arrived)]
        sharing = -(-(count - 1) // len(arrived))
        for k in range(count - 1):
            # ensembles that share a population begin in parts of their own
            turn, which = divmod(k, len(arrived))
            order = np.roll(orders[which], -(turn * len(arrived[which]) // sharing))
            starts[k] = arrived[which][order]
    ensembles = new_ensembles(density, proposal, tuple(starts), job)
    return dataclasses.replace(
        checkpoint,
        proposal=proposal,
        ensembles=ensembles,
        adaptations=1,
        calls=checkpoint.calls + WALKERS * count,
    )


def is_slow(kept: Chains, adaptations: int) -> bool:
    """Tell whether the ensembles should propose from something else.

    Parameters
    ----------
    kept : Chains
        Draws so far.
    adaptations : int
        How often the proposal has been adapted.
    """
    if adaptations >= len(_SLOW):
        return False
    steps = kept.z.shape[2]
    times = [autocorrelation_time(x.reshape(-1, steps).T) for x in np.moveaxis(kept.z, -1, 0)]
    # a parameter that does not move has no finite time
    return not max(times) < _SLOW[adaptations]


def adapt(job: Job, checkpoint: Checkpoint, kept: Chains) -> Checkpoint:
    """Fit the map to what was drawn so far, and forget the draws; or call for populations.

    Populations are called for once: those that died on the way would die again.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    kept : Chains
        Draws so far.

    Returns
    -------
    Checkpoint
    """
    pending = Verdict(False, ("the proposal was still being adapted",))
    begun = dataclasses.replace(checkpoint, adaptations=checkpoint.adaptations + 1, verdict=pending)
    old = checkpoint.proposal
    if old is None or (old.transport is None and not checkpoint.populations):
        return dataclasses.replace(begun, ensembles=(), populations=(None,) * POPULATIONS)
    flat = kept.z.reshape(-1, kept.z.shape[-1])
    pilot = flat[np.linspace(0, len(flat) - 1, min(len(flat), _PILOT_DRAWS)).astype(int)]
    transport = fit_map(pilot, shear_of(job.density()))
    new = dataclasses.replace(old, transport=transport, share=_MAP_SHARE)
    return dataclasses.replace(
        begun,
        proposal=new,
        ensembles=tuple(restart(ensemble, old, new) for ensemble in checkpoint.ensembles),
    )
