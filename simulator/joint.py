"""What a calibration has learnt: one law of several unknowns together, and where it comes from."""

from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
import pydantic

from simulator.priors import Prior
from simulator.sensor import PulsedSensor, SineWaveSensor
from simulator.validated import NonNegative, Number, Positive, Validated

__all__ = [
    "Accepted",
    "Calibration",
    "CalibrationFrames",
    "Joint",
    "Learnt",
    "LearntError",
    "NormalMode",
    "Omitted",
]

_LOOSE = pydantic.Strict(False)  # JSON arrays arrive as lists; the elements stay strict
_MOST = 32  # unknowns, modes
_FARTHEST = 100.0  # standard deviations of a prior
_SYMMETRIC = 1e-6  # of the standard deviations

Name = Annotated[str, pydantic.Field(max_length=64)]
Text = Annotated[str, pydantic.Field(max_length=2000)]
Row = Annotated[tuple[Number, ...], _LOOSE, pydantic.Field(max_length=_MOST)]
Accepted = Literal["not_converged", "misfit"]


class NormalMode(Validated):
    """A normal law in the coordinates of a `Joint`.

    Attributes
    ----------
    weight : float
        Share of this mode; those of all add up to one.
    mean : tuple of float
        In the order of the unknowns.
    covariance : tuple of tuple of float
        Symmetric, positive definite.
    """

    weight: Annotated[Positive, pydantic.Field(le=1)] = 1.0
    mean: Annotated[Row, pydantic.Field(min_length=1)]
    covariance: Annotated[tuple[Row, ...], _LOOSE, pydantic.Field(max_length=_MOST)]

    @pydantic.model_validator(mode="after")
    def _is_law(self) -> Self:
        d = len(self.mean)
        if len(self.covariance) != d or any(len(row) != d for row in self.covariance):
            raise ValueError(f"covariance must have {d} rows of {d} numbers, as many as mean has")
        matrix = np.array(self.covariance, dtype=np.float64)
        if not (np.diagonal(matrix) > 0).all():
            raise ValueError("covariance must have positive variances on its diagonal")
        sd = np.sqrt(np.diagonal(matrix))
        if not (np.abs(self.mean) + sd <= _FARTHEST).all():
            raise ValueError(
                f"reaches beyond {_FARTHEST:g} standard deviations of the prior of an unknown: "
                "state that prior wider"
            )
        correlation = matrix / sd[:, None] / sd
        if not np.allclose(correlation, correlation.T, rtol=0.0, atol=_SYMMETRIC):
            raise ValueError("covariance must be symmetric")
        try:
            np.linalg.cholesky(correlation)
        except np.linalg.LinAlgError:
            raise ValueError("covariance must be positive definite") from None
        return self


class Joint(Validated):
    """One law of several unknowns, in place of their independent priors.

    It holds in the coordinates in which each of these unknowns has, given those before it, a
    standard normal prior by what the scene states of it, or leaves to a default (docs/scenes.md,
    joint). Whatever the coordinates are, the unknowns lie where these priors let them: above zero
    or above -2 sqrt(c0), say.

    Attributes
    ----------
    unknowns : tuple of str
        Scene paths, such as "object.c0".
    modes : tuple of NormalMode
        One, or several where the posterior had separate modes.
    """

    unknowns: Annotated[tuple[Name, ...], _LOOSE, pydantic.Field(min_length=1, max_length=_MOST)]
    modes: Annotated[tuple[NormalMode, ...], _LOOSE, pydantic.Field(min_length=1, max_length=_MOST)]

    @pydantic.model_validator(mode="after")
    def _agrees(self) -> Self:
        if len(set(self.unknowns)) < len(self.unknowns):
            raise ValueError("unknowns must be named once each")
        if any(len(mode.mean) != len(self.unknowns) for mode in self.modes):
            raise ValueError("each mode must have a mean of as many numbers as there are unknowns")
        if abs(sum(mode.weight for mode in self.modes) - 1) > _SYMMETRIC:
            raise ValueError("the weights of the modes must add up to 1")
        return self

    def marginal(self, names: Sequence[str]) -> "Joint":
        """Return the law of some of the unknowns, in their order here; of a normal one a block.

        Parameters
        ----------
        names : sequence of str
            One at least.
        """
        stay = [j for j, name in enumerate(self.unknowns) if name in names]
        modes = [
            {
                "weight": mode.weight,
                "mean": [mode.mean[j] for j in stay],
                "covariance": [[mode.covariance[i][j] for j in stay] for i in stay],
            }
            for mode in self.modes
        ]
        return Joint.model_validate({"unknowns": [self.unknowns[j] for j in stay], "modes": modes})


class CalibrationFrames(Validated):
    """The frames of a calibration.

    Attributes
    ----------
    count : int
        How many.
    sha256 : str
        Digest of their columns.
    """

    count: Annotated[int, pydantic.Field(ge=0)]
    sha256: Name


class Omitted(Validated):
    """A term that the model of a calibration did not have.

    Attributes
    ----------
    term, reason : str
        Which, and why.
    """

    term: Name
    reason: Text


class LearntError(Validated):
    """What frames of known range show of the model's errors.

    Attributes
    ----------
    frames : int
        How many there were.
    flux, range_m : float
        Sizes of the errors of the object's flux [1] and of the effective distance [m] that are left
        with the unknowns as they were learnt, noise and the ruler's own error taken off; 0 where
        chance explains them.
    """

    frames: Annotated[int, pydantic.Field(ge=1)]
    flux: NonNegative
    range_m: NonNegative


class Learnt(Validated):
    """One unknown after a calibration, for a reader; what is used is the `Joint`.

    Attributes
    ----------
    unknown : str
        Its scene path.
    prior : Prior or "default", optional
        The prior in whose coordinates the `Joint` is. A scene that states another one is refused.
    mean, sd, q05, q95 : float
        In SI units, or in reading units.
    """

    unknown: Name
    prior: Prior | Literal["default"] | None = None
    mean: Number
    sd: NonNegative
    q05: Number
    q95: Number


class Calibration(Validated):
    """Where a `Joint` comes from, and whether to believe it.

    Attributes
    ----------
    sensor : Sensor
        Whose readings were used: a scene in reading units is that of one sensor.
    converged : bool
        Verdict on the sampling.
    misfit : bool
        Verdict on the model.
    reasons : tuple of str
        Of the verdict.
    accept : tuple of "not_converged" or "misfit"
        What is taken all the same; the scene is refused without the word.
    date : str, optional
        Of writing, ISO 8601.
    seed : int, optional
        Of the posterior.
    left_out : tuple of Omitted
        Terms that the scene does not have, or that the data did not demand.
    model_error : (float, float)
        Standard deviations of the errors of flux [1] and range [m] that are part of the joint law.
    learnt_error : LearntError, optional
        What frames of known range show of these errors; where either is larger than
        ``model_error``, the scene's `discrepancy` has the larger ones.
    unknowns : tuple of Learnt
        The unknowns, for a reader.
    distance : float
        Greatest distance between the distribution of an unknown's draws and that of the joint law
        (Kolmogorov's): 0 where they are normal, 0.05 where a twentieth lies elsewhere.
    """

    sensor: Annotated[PulsedSensor | SineWaveSensor, pydantic.Field(discriminator="kind")]
    converged: bool
    misfit: bool
    reasons: Annotated[tuple[Text, ...], _LOOSE, pydantic.Field(max_length=100)] = ()
    accept: Annotated[tuple[Accepted, ...], _LOOSE, pydantic.Field(max_length=2)] = ()
    date: Name | None = None
    seed: int | None = None
    frames: CalibrationFrames
    left_out: Annotated[tuple[Omitted, ...], _LOOSE, pydantic.Field(max_length=_MOST)] = ()
    model_error: Annotated[tuple[NonNegative, NonNegative], _LOOSE]
    learnt_error: LearntError | None = None
    unknowns: Annotated[tuple[Learnt, ...], _LOOSE, pydantic.Field(max_length=_MOST)] = ()
    distance: NonNegative = 0.0
