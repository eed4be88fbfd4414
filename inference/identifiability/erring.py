"""An experiment whose model errs by what its scene allows: as posteriors take it."""

import dataclasses

from inference.identifiability.experiment import Experiment
from simulator.model_error import ModelError

__all__ = ["erring"]


def erring(experiment: Experiment, error: ModelError) -> Experiment:
    """Return an experiment with the errors of flux, shadow and effective distance.

    Parameters
    ----------
    experiment : Experiment
        With an exact model.
    error : ModelError
        What the scene allows (`simulator.scene.Scene.allowed_error`), so that what is foreseen has
        the errors that posteriors have, left out or stated.
    """
    return dataclasses.replace(
        experiment,
        discrepancy=error.flux or None,
        shadow=error.shadow if experiment.parameters.has_background else 0.0,
        range_error=error.range_m,
    )
