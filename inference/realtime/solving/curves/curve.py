"""The template of a curve: its number, and what is known of its turning points and poles."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["Curve", "CurveParameters", "Level", "Polynomial", "Search"]


class CurveParameters(NamedTuple):
    """What a scene gives the curves, in one unit of length; 0 for what is not known.

    Attributes
    ----------
    c0, c1 : float
        The object's parameters [length^2], [length].
    distance : float
        Of the background [length].
    wave : float
        Wave number of a sine wave [1 / length].
    c0_shadow, c1_shadow : float
        The shadow's parameters [length^2], [length].
    contrast : float
        strength / (gain c2) [1 / length^2].
    """

    c0: float
    c1: float
    distance: float
    wave: float
    c0_shadow: float
    c1_shadow: float
    contrast: float


@dataclasses.dataclass(frozen=True)
class Polynomial:
    """Points that are roots of a polynomial; its coefficients, highest power first."""

    coefficients: Callable[[CurveParameters], tuple[float, ...]]


@dataclasses.dataclass(frozen=True)
class Level:
    """Points at which another curve takes a value, which the parameters give."""

    curve: "Curve"
    value: Callable[[CurveParameters], float]


@dataclasses.dataclass(frozen=True)
class Search:
    """Points that are sign changes on a fine grid: of ``turning``, or of the denominator."""


@dataclasses.dataclass(frozen=True)
class Curve:
    """A curve as the solver knows it.

    Attributes
    ----------
    name : str
        That of its file.
    kind : int
        Its number in `dispatch`.
    turns : Polynomial, Level or Search
        Where it turns: each interval between two neighbours holds at most one root.
    poles : Polynomial or Search, optional
        Where it is infinite; left out, nowhere.
    period : float
        Values are known modulo this number; 0 if the curve is not an angle.
    winds : bool
        Whether its value is an angle within one branch, which the solver has to unwrap.
    exact : callable, optional
        (u, parameters) -> the value, free of rounding, where that decides how many roots there are.
    """

    name: str
    kind: int
    turns: Polynomial | Level | Search
    poles: Polynomial | Search | None = None
    period: float = 0.0
    winds: bool = False
    exact: Callable[[float, CurveParameters], float] | None = None
