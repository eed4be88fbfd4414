"""What a job answers with whose time ended before its sampling began."""

from inference.posterior.job import Job
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.optima import that_matter
from inference.posterior.stages.stage import Selecting, Starting, Tempering
from inference.posterior.stages.starting import begin

__all__ = ["stopped"]

# from here on a start that takes as long as what led to it is not made behind the time limit
_LATE_S = 5.0


def stopped(job: Job, stage: Selecting | Starting, cpu_s: float) -> Checkpoint:
    """Begin to sample, for there is no time for more; from dear densities draw nothing.

    Parameters
    ----------
    job : Job
        Without optional terms.
    stage : Selecting or Starting
        Where it was stopped.
    cpu_s : float
        Processor time that it has taken [s].

    Returns
    -------
    Checkpoint
        With draws, if there are any to be had; or with the optima that were found.

    Raises
    ------
    RefusedError
        As of `StartTask`.
    """
    # of the choices the last keeps all optional terms
    stage = stage if isinstance(stage, Starting) else stage.starts[-1]
    optima = that_matter(stage.optima)
    if not optima or cpu_s < max(_LATE_S, job.settings.max_seconds):
        return begin(job, stage).answering
    unbegun = Verdict(False, ("its time ended before sampling began",))
    return Checkpoint(Tempering(Proposal(mixture_of(optima), None, 0.0), (), unbegun), 0)
