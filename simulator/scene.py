"""The scene language: a number is known, a prior is unknown, absence is left out."""

import math
from typing import Annotated, Literal, Self

import pydantic

from simulator.discrepancy import DISCREPANCY_SD
from simulator.errors import InvalidInputError, Problem
from simulator.priors import LEAST_LOG_MASS, Prior
from simulator.sensor import PulsedSensor, Sensor
from simulator.validated import Number, Positive, Validated, parse

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
    "check_scene",
    "largest",
    "parse_scene",
]


def _kind_of_quantity(value: object) -> str:
    # anything that is not an object is read as a number, so that the message speaks of numbers
    return "unknown" if isinstance(value, dict | Validated) else "known"


Quantity = Annotated[
    Annotated[Number, pydantic.Tag("known")] | Annotated[Prior, pydantic.Tag("unknown")],
    pydantic.Discriminator(_kind_of_quantity),
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
    ] = Shadow()
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
    square root of its Fisher information, joined to a log-uniform density where the readings say
    less than that. How the ranges are spread then tells nothing of the other unknowns, as it would
    if they were taken for independent draws of one law.
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


def _size_of_discrepancy(value: object) -> object:
    if value == "default":
        return DISCREPANCY_SD
    if isinstance(value, str):
        raise ValueError('must be a standard deviation, such as 0.07, or "default"')
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
        Prior of every range [m]. Left out: loguniform (0.02 m, the smaller of the sensor's
        unambiguous range and 20 m).
    motion : "radial", "tangential" or "static"
        Tangential: the range is fixed and the amplitude changes.
    discrepancy : float, optional
        Standard deviation of a smooth relative error of the object's flux along log r; "default"
        stands for `simulator.discrepancy.DISCREPANCY_SD`, measured on the optical simulator.
    """

    object: ObjectTerm = ObjectTerm()
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
    discrepancy: Annotated[
        Positive | None,
        pydantic.BeforeValidator(
            _size_of_discrepancy,
            json_schema_input_type=Positive | Literal["default"] | None,
        ),
    ] = None

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


def _check_support(value: Quantity | None, low: float, high: float, where: str) -> list[Problem]:
    """Check a number against an open interval, a prior for any mass inside it."""
    if value is None:
        return []
    if isinstance(value, float | int):
        if not low < value < high:
            wanted = f"above {low:g}" if high == math.inf else f"between {low:g} and {high:g}"
            return [Problem(where, f"must be {wanted}, is {value:g}")]
        return []
    if not float(value.distribution().log_mass(low, high)) > LEAST_LOG_MASS:
        return [Problem(where, f"the prior has no mass between {low:g} and {high:g}")]
    return []


def largest(value: Quantity | None) -> float:
    """Return the largest value that a quantity can take (None: a default, without a bound)."""
    if value is None:
        return math.inf
    return float(value) if isinstance(value, float | int) else value.distribution().high


def _check_shape(c0: Quantity | None, c1: Quantity | None, where: str) -> list[Problem]:
    """Check c0 > 0 and c1 > -2 sqrt(c0): else the flux has poles (docs/model.md, conventions)."""
    problems = _check_support(c0, 0.0, math.inf, f"{where}/c0")
    if problems or c1 is None:
        return problems
    # with c0 free the widest support decides: a joint prior is refused only where nothing is left
    least = -2 * math.sqrt(largest(c0)) if largest(c0) < math.inf else -math.inf
    if isinstance(c1, float | int) and isinstance(c0, float | int):
        if not c1 > least:
            return [Problem(f"{where}/c1", f"must be above -2 sqrt(c0) = {least:g}, is {c1:g}")]
        return []
    if isinstance(c1, float | int):
        if not c1 > least:
            return [Problem(f"{where}/c1", "no c0 of its prior satisfies c1 > -2 sqrt(c0)")]
        return []
    return _check_support(c1, least, math.inf, f"{where}/c1")


def check_scene(sensor: Sensor, scene: Scene) -> None:
    """Check known numbers and priors against physics and against the sensor.

    Parameters
    ----------
    sensor : Sensor
        A pulsed sensor cannot tell ranges or backgrounds beyond r0.
    scene : Scene
        The scene.

    Raises
    ------
    InvalidInputError
        With a pointer into the scene for each offending field.
    """
    problems = _check_shape(scene.object.c0, scene.object.c1, "/object")
    problems += _check_support(scene.object.c2, 0.0, math.inf, "/object/c2")
    limit, of_limit = (sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf), "r0 ="
    if scene.background is not None:
        where = "/background"
        problems += _check_support(scene.background.strength, 0.0, math.inf, f"{where}/strength")
        distance = scene.background.distance_m
        problems += _check_support(distance, 0.0, math.inf, f"{where}/distance_m")
        if isinstance(distance, float | int):
            if distance > limit:
                message = (
                    f"lies beyond r0 = {limit:g} m, where the late window of a pulse saturates"
                )
                problems.append(Problem(f"{where}/distance_m", message))
        else:
            problems += _check_support(distance, 0.0, limit, f"{where}/distance_m")
        if isinstance(scene.background.shadow, Shadow):
            shadow = scene.background.shadow
            problems += _check_shape(shadow.c0, shadow.c1, f"{where}/shadow")
        if isinstance(distance, float | int) and 0 < distance < limit:
            limit, of_limit = float(distance), "the background at"
    if isinstance(scene.range_m, Stroke | Reference):
        # in logarithms, which are what a common law of the ranges is made from
        if math.log(scene.range_m.low) >= math.log(limit):
            problems.append(Problem("/range_m/low", f"lies beyond {of_limit} {limit:g} m"))
    elif scene.range_m is not None:
        problems += _check_support(scene.range_m, 0.0, limit, "/range_m")
        if scene.range_m.distribution().range_form is None:
            problems.append(
                Problem("/range_m/prior", f"{scene.range_m.prior!r} cannot be the prior of ranges")
            )
    if problems:
        raise InvalidInputError(*dict.fromkeys(problems))
