"""All optima of the parameters together, with their weights."""

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.posterior import JointMode
from inference.posterior.answer.shares import share_error, weighted_share_error
from inference.posterior.sample import Sample
from inference.posterior.stages.stage import Drawing, optima_of

__all__ = ["mode_summary"]


def mode_summary(
    density: CollapsedDensity, stage: Drawing, sample: Sample
) -> tuple[JointMode, ...]:
    """Describe every optimum that was found.

    Parameters
    ----------
    stage : Drawing
        Where the job stands, with the optima that were found.
    sample : Sample
        Draws, each of which belongs to the optimum that it is nearest to.

    Returns
    -------
    tuple of JointMode
        In the order of the optima; none where nothing is unknown.
    """
    optima = optima_of(stage)
    if optima is None:
        return ()
    natural = density.parameters.natural(optima.centres)
    heights = density(optima.centres)
    result = []
    for k in range(len(optima.centres)):
        weight: float | None = None
        error: float | None = None
        if sample.chains is not None:
            inside = sample.mode == k
            weight, error = float(inside.mean()), share_error(inside, sample.chains.start)
        elif sample.weighted is not None:
            weights = sample.weighted.weights
            inside = optima.nearest(sample.weighted.z) == k
            weight = min(float(weights[inside].sum()), 1.0)
            error = weighted_share_error(inside, weights)
        values = dict(zip(density.parameters.names, natural[k].tolist(), strict=True))
        result.append(JointMode(values, float(heights[k]), weight, error))
    return tuple(result)
