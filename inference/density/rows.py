"""Rows of arrays as tuples, and None of None, as the kernels take them.

numba types a function that returns a tuple or None as optional, even where the argument decides;
`overload` chooses the body by the argument's type instead, so that an absent term stays absent.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import extending
from numpy.typing import NDArray

from inference.density.gaussian import Pair
from inference.density.integrand import Law, Quad, ReferenceLaw
from inference.density.warp import Curve
from simulator.compiled import compiled

__all__ = ["background_of", "crosstalk_of", "curve_of", "law_of", "row_of"]

Array = NDArray[np.float64]


def crosstalk_of(rows: Array | None, i: int) -> Pair | None:
    """Return row i as a pair, or None where the scene has no crosstalk."""
    return None if rows is None else (float(rows[i, 0]), float(rows[i, 1]))


def background_of(rows: Array | None, i: int) -> Quad | None:
    """Return row i as a quadruple, or None where the scene has no background."""
    if rows is None:
        return None
    return float(rows[i, 0]), float(rows[i, 1]), float(rows[i, 2]), float(rows[i, 3])


def curve_of(knots: Array | None, grid: Pair | None, i: int) -> Curve | None:
    """Return curve i of knots of shape (n, knots, 2), or None where the flux has no error."""
    return None if knots is None or grid is None else (knots[i], grid[0], grid[1])


def law_of(rows: Array | tuple[Array], i: int) -> Law | ReferenceLaw:
    """Return row i of the range priors; of a tuple of them as that of a reference prior."""
    return (*_plain_law(rows[0], i), 1.0) if isinstance(rows, tuple) else _plain_law(rows, i)


def row_of(rows: Any, i: int) -> Any:
    """Return row i of an argument of the kernels, as an argument of one row."""
    if isinstance(rows, tuple):
        return tuple(row_of(part, i) for part in rows)
    return None if rows is None else rows[i : i + 1]


@compiled
def _plain_law(rows: Array, i: int) -> Law:
    """Return row i as eight numbers."""
    return (
        rows[i, 0],
        rows[i, 1],
        rows[i, 2],
        rows[i, 3],
        rows[i, 4],
        rows[i, 5],
        rows[i, 6],
        rows[i, 7],
    )


@extending.overload(crosstalk_of, strict=False)
def _crosstalk_of(rows: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
    if rows is numba.types.none:
        return lambda rows, i: None  # noqa: ARG005
    return lambda rows, i: (rows[i, 0], rows[i, 1])


@extending.overload(background_of, strict=False)
def _background_of(rows: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
    if rows is numba.types.none:
        return lambda rows, i: None  # noqa: ARG005
    return lambda rows, i: (rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])


@extending.overload(curve_of, strict=False)
def _curve_of(knots: Any, grid: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
    if knots is numba.types.none:
        return lambda knots, grid, i: None  # noqa: ARG005
    return lambda knots, grid, i: (knots[i], grid[0], grid[1])


@extending.overload(law_of, strict=False)
def _law_of(rows: Any, i: Any) -> Callable[..., Any]:  # noqa: ARG001
    if isinstance(rows, numba.types.BaseTuple):
        return lambda rows, i: (*_plain_law(rows[0], i), 1.0)
    return lambda rows, i: _plain_law(rows, i)
