"""How wrong the model of flux and time of flight may be: what a scene says of it.

The flux has a smooth relative error (`simulator.discrepancy`), and the effective distance, which is
what pulse and phase read, a smooth error in metres. Both are Gaussian processes along log r with
the Matern 5/2 correlation of `simulator.discrepancy.matern` (docs/model.md, discrepancy-law).

The default of the range's error is what recorded photons wander about the robot's truth once
offset and slope are calibrated: 0.77 mm rms from 0.1 to 0.4 m (`python -m benchmarks.recorded`,
docs/recorded.md). It is one figure for all sensors, in metres, that is in time of flight (5 ps):
the same photons give it whether they are read by a pulse that reaches 1.7 m or by a wave that
reaches 30 m, so nothing that was measured says that it grows with the reach.
"""

import dataclasses
from typing import Annotated, Literal, Self

import pydantic

from simulator.discrepancy import DISCREPANCY_SD
from simulator.shadow_error import SHADOW_SD
from simulator.validated import NonNegative, Validated

__all__ = ["FITTED_SHARE", "RANGE_ERROR_SD", "Discrepancy", "ErrorSizes", "ModelError"]

# of the flux's error that a fit of c0, c1 and c2 leaves on 0.1 to 2.4 m, in root mean square: 2.0 %
# of flux where the fits of exact optics leave 1.8 % (`python -m benchmarks.realtime_coverage`). On
# 0.01 to 1 m it is 0.43, most of it where an object is nearer than it is wide
FITTED_SHARE = 0.284
# [m]; 0.77 mm of recorded photons after calibration
RANGE_ERROR_SD = 8e-4


class ErrorSizes(Validated):
    """Standard deviations of the model's errors; what is left out is none.

    Attributes
    ----------
    flux : float
        Of a smooth relative error of the object's flux along log r.
    range_m : float
        Of a smooth error of the effective distance along log r [m].
    shadow : float
        Of the shadow on a background, in units of `simulator.shadow_error.shadow_errors`; all
        answers have it, simulations do not.
    """

    flux: NonNegative = 0.0
    range_m: NonNegative = 0.0
    shadow: NonNegative = 0.0

    @pydantic.model_validator(mode="after")
    def _of_something(self) -> Self:
        if not self.model_fields_set:
            raise ValueError(
                'states nothing: give flux, range_m or shadow; "default" for the measured sizes, 0 '
                "for an exact model"
            )
        return self


def _kind(value: object) -> str:
    if isinstance(value, dict | Validated):
        return "sizes"
    return "word" if isinstance(value, str) else "flux"


def _known_word(value: object) -> object:
    if isinstance(value, str) and value != "default":
        raise ValueError(
            'must be a standard deviation of the flux, such as 0.07, {"flux", "range_m"}, or '
            '"default"'
        )
    return value


Discrepancy = Annotated[
    Annotated[NonNegative, pydantic.Tag("flux")]
    | Annotated[Literal["default"], pydantic.Tag("word")]
    | Annotated[ErrorSizes, pydantic.Tag("sizes")],
    pydantic.Discriminator(_kind),
    pydantic.BeforeValidator(_known_word),
]


@dataclasses.dataclass(frozen=True)
class ModelError:
    """Standard deviations of the model's errors, and how they are taken into account.

    Attributes
    ----------
    flux : float
        Of a smooth relative error of the object's flux along log r; 0: none.
    range_m : float
        Of a smooth error of the effective distance along log r [m]; 0: none.
    integrated : bool
        Whether they were stated in numbers: a posterior then integrates them out with the ranges.
        Else they enter by linear response, as a part of the error budget.
    shadow : float
        Of the shadow on a background (`simulator.shadow_error`); 0: none.
    """

    flux: float
    range_m: float
    integrated: bool
    shadow: float = 0.0

    def beside_numbers(self) -> "ModelError":
        """Return what is left of the default where an object's c0, c1 and c2 are numbers.

        They come from a fit, which takes up what looks like them (`simulator.discrepancy`).
        """
        if self.integrated:
            return self
        return dataclasses.replace(self, flux=FITTED_SHARE * self.flux)

    @classmethod
    def stated(cls, discrepancy: float | Literal["default"] | ErrorSizes | None) -> "ModelError":
        """Return what a scene's `discrepancy` means; left out it is "default".

        Parameters
        ----------
        discrepancy : float, "default", ErrorSizes or None
            The member of the scene.

        Returns
        -------
        ModelError
            With the sizes that stand.
        """
        if discrepancy is None or isinstance(discrepancy, str):
            return cls(DISCREPANCY_SD, RANGE_ERROR_SD, integrated=False, shadow=SHADOW_SD)
        if not isinstance(discrepancy, ErrorSizes):
            discrepancy = ErrorSizes(flux=discrepancy)
        flux, range_m = discrepancy.flux, discrepancy.range_m
        integrated = flux > 0 or range_m > 0
        return cls(flux, range_m, integrated=integrated, shadow=discrepancy.shadow)
