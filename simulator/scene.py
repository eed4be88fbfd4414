"""The scene language: a number is known, a prior is unknown, absence is left out."""

import math
from typing import Annotated, Literal, Self

import pydantic

from simulator.joint import Calibration, Joint
from simulator.model_error import Discrepancy, ModelError
from simulator.priors import Prior
from simulator.quantity import Quantity
from simulator.validated import Positive, Validated, parse

__all__ = [
    "Background",
    "Crosstalk",
    "Motion",
    "ObjectTerm",
    "Quantity",
    "Reference",
    "Scene",
    "Shadow",
    "Stroke",
    "parse_scene",
]


Motion = Literal["radial", "tangential", "static"]


class ObjectTerm(Validated):
    """The object: Phi = Phi0 A_D c0 c2 / (r^2 (r^2 + c1 r + c0)).

    Attributes
    ----------
    c0 : Quantity, optional
        [m^2], positive. Left out: lognormal (0.1 m^2, 2).
    c1 : Quantity, optional
        [m], above -2 sqrt(c0). Left out: 2 sqrt(c0) (exp(t) - 1) with t normal (0, 0.4).
    c2 : Quantity, optional
        Positive. Left out: lognormal (0.1, 1).
    """

    c0: Quantity | None = None
    c1: Quantity | None = None
    c2: Quantity | None = None


class Crosstalk(Validated):
    """Light or charge that does not come from the scene, in reading units.

    Attributes
    ----------
    values : (Quantity, Quantity)
        Of w1 and w2, or of i and q.
    optional : bool
        Whether the data decide if the term stays.
    """

    values: Annotated[tuple[Quantity, Quantity], pydantic.Strict(False)]
    optional: bool = False


class Shadow(Validated):
    """What the object hides of the background: S = (r^2 + c1 r) / (r^2 + c1 r + c0).

    Attributes
    ----------
    c0 : Quantity, optional
        [m^2]. Left out: the object's c0 times lognormal (0.75, 0.5).
    c1 : Quantity, optional
        [m]. Left out: halfnormal (0.3 sqrt(the object's c0)).
    """

    c0: Quantity | None = None
    c1: Quantity | None = None


def _no_other_word(value: object) -> object:
    if isinstance(value, str) and value != "object":
        raise ValueError('must be "object", or an object with c0 and c1')
    return value


class Background(Validated):
    """A uniform background behind the object.

    Attributes
    ----------
    strength : Quantity
        Reading (w2, or the modulus of i + j q) of the bare background.
    distance_m : Quantity
        Its distance R [m].
    shadow : "object" or Shadow
        "object": c0' = c0 and c1' = c1. Left out: unknown with the priors of `Shadow`.
    optional : bool
        Whether the data decide if the term stays.
    """

    strength: Quantity
    distance_m: Quantity
    shadow: Annotated[
        Annotated[Literal["object"], pydantic.Tag("as_object")]
        | Annotated[Shadow, pydantic.Tag("own")],
        pydantic.Discriminator(lambda v: "as_object" if isinstance(v, str) else "own"),
        pydantic.BeforeValidator(_no_other_word),
    ] = Shadow.model_construct()
    optional: bool = False


class _Support(Validated):
    """Ranges inside [low, high] [m]."""

    low: Positive
    high: Positive

    @pydantic.model_validator(mode="after")
    def _ordered(self) -> Self:
        # numbers apart whose logarithms are one leave no room for a law of log r
        if not math.log(self.low) < math.log(self.high):
            raise ValueError("low must be below high")
        return self


class Stroke(_Support):
    """Log-normal ranges with unknown centre and spread inside [low, high] [m]."""

    prior: Literal["stroke"] = "stroke"


class Reference(_Support):
    """Ranges inside [low, high] [m] of whose spread nothing is assumed.

    Given the other unknowns every range has its own reference prior (Berger and Bernardo 1992): the
    square root of its Fisher information, joined to a log-uniform density where the readings tell
    it to worse than a fifth of itself. How the ranges are spread then tells nothing of the other
    unknowns, as it would if they were taken for independent draws of one law.
    """

    prior: Literal["reference"] = "reference"


def _kind_of_crosstalk(value: object) -> str:
    return "term" if isinstance(value, dict | Validated) else "pair"


def _kind_of_range(value: object) -> str:
    kind = value.get("prior") if isinstance(value, dict) else getattr(value, "prior", None)
    return kind if kind in ("stroke", "reference") else "independent"


def _no_number(value: object) -> object:
    if isinstance(value, int | float | str | list | tuple):
        raise ValueError(
            'must be a prior, {"prior": "stroke", "low", "high"} or {"prior": "reference", "low", '
            '"high"}; a range that is known is given by a narrow prior'
        )
    return value


class Scene(Validated):
    """A scene. Everything that it does not mention is left out of every model made from it.

    Attributes
    ----------
    object : ObjectTerm
        Left out: an object of which nothing is known.
    crosstalk : Crosstalk, optional
        Given as two values or as `Crosstalk`. Left out: there is none.
    background : Background, optional
        Left out: there is none.
    range_m : Prior, Stroke or Reference, optional
        Prior of every range [m]. Left out: `Reference` (0.02 m, the smaller of the sensor's
        unambiguous range and 20 m); for the one range of an object at rest, loguniform there.
    motion : "radial", "tangential" or "static"
        Tangential: the range is fixed and the amplitude changes.
    discrepancy : float, "default" or ErrorSizes, optional
        How wrong the model may be: standard deviations of a smooth relative error of the object's
        flux and of a smooth error of the effective distance, both along log r; one number is the
        flux's alone, 0 is an exact model. Left out: "default", the sizes that were measured
        (`simulator.model_error`), since no object is exactly as the model.
    joint : Joint, optional
        One law of several unknowns, in place of their independent priors.
    calibration : Calibration, optional
        Where that law comes from.
    """

    object: ObjectTerm = ObjectTerm.model_construct()
    crosstalk: (
        Annotated[
            Annotated[
                Annotated[tuple[Quantity, Quantity], pydantic.Strict(False)], pydantic.Tag("pair")
            ]
            | Annotated[Crosstalk, pydantic.Tag("term")],
            pydantic.Discriminator(_kind_of_crosstalk),
        ]
        | None
    ) = None
    background: Background | None = None
    range_m: (
        Annotated[
            Annotated[Prior, pydantic.Tag("independent")]
            | Annotated[Stroke, pydantic.Tag("stroke")]
            | Annotated[Reference, pydantic.Tag("reference")],
            pydantic.Discriminator(_kind_of_range),
            pydantic.BeforeValidator(_no_number),
        ]
        | None
    ) = None
    motion: Motion = "radial"
    discrepancy: Discrepancy | None = None
    joint: Joint | None = None
    calibration: Calibration | None = None

    @property
    def model_error(self) -> ModelError:
        """How wrong the model of flux and time of flight may be."""
        return ModelError.stated(self.discrepancy)

    @property
    def allowed_error(self) -> ModelError:
        """The same that answers allow for: an object whose numbers are known was fitted."""
        numbers = self.object.c0, self.object.c1, self.object.c2
        known = all(isinstance(number, float | int) for number in numbers)
        return self.model_error.beside_numbers() if known else self.model_error

    @property
    def crosstalk_values(self) -> tuple[Quantity, Quantity] | None:
        """The two crosstalk quantities, however they were written."""
        return self.crosstalk.values if isinstance(self.crosstalk, Crosstalk) else self.crosstalk

    @property
    def optional_terms(self) -> tuple[str, ...]:
        """Names of the terms that the data may leave out."""
        terms = {"crosstalk": self.crosstalk, "background": self.background}
        return tuple(name for name, term in terms.items() if getattr(term, "optional", False))

    @property
    def shadow(self) -> tuple[Quantity | None, Quantity | None] | None:
        """The shadow's c0' and c1' (None: default prior); None without a background."""
        if self.background is None:
            return None
        if isinstance(self.background.shadow, Shadow):
            return self.background.shadow.c0, self.background.shadow.c1
        return self.object.c0, self.object.c1

    @property
    def shadow_is_object(self) -> bool:
        """Whether the shadow has the object's own parameters."""
        return self.background is not None and self.background.shadow == "object"


def parse_scene(data: object) -> Scene:
    """Validate a scene given as plain JSON data.

    Parameters
    ----------
    data : object
        Decoded JSON in the form of docs/scenes.md, scene.

    Returns
    -------
    Scene
        The scene; known numbers are checked against one another by `check_scene`.

    Raises
    ------
    InvalidInputError
        With a pointer for each offending field.
    """
    return parse(Scene, data)
