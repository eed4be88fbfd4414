"""What is known of the crosstalk without any object: by its prior and by frames stated empty.

What frames of an object tell of the crosstalk they tell with its range, and so it turns with the
tangent along which that was told (`inference.tracking.shared_error`). What is known without an
object does not: no tangent has a part in it. Turned like the rest, crosstalk that was known to a
fraction of a frame's noise was opened to thousands of noises wherever a prediction was vague, and
took over whatever light lay there. So what is known without an object is kept beside the state:
as the larger variance of a reading in that of the noise, which says how much of a turn is taken up,
and as mean and covariance, which turns are held to (`inference.tracking.held_crosstalk`). What an
object teaches has no part in it.

docs/model.md, without-object, has the rule.
"""

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import (
    CROSSTALK1,
    CROSSTALK2,
    TOLD,
    TOLD1,
    TOLD2,
    TOLD11,
    TOLD21,
    TOLD22,
    Hypotheses,
    unknown_crosstalk,
)
from inference.tracking.readings_table import FIRST, SECOND, Array
from inference.tracking.roots import Root, add_factor, add_root, solve, times
from simulator.compiled import compiled

__all__ = ["carry_told", "open_part", "take_drift", "take_stated", "tell_all", "told_root"]


_LEAST = 1e-3  # of the noise, to which crosstalk is known at best


@compiled
def open_part(variance: float) -> float:
    """Return how much of an error's variance crosstalk can take up, from 0 to 1.

    Crosstalk that adds q variances of the noise to a reading takes up q / (q + 1) of an error: of
    its variance the square.
    """
    taken = variance / (variance + 1.0)
    return taken * taken


@compiled
def told_root(of: Hypotheses) -> Root:
    """Return the root of the covariance that is known without an object."""
    numbers = of.numbers
    first, second = max(numbers[TOLD11], _LEAST), max(numbers[TOLD22], _LEAST)
    return Root(first, numbers[TOLD21], second)


@compiled
def _keep_root(of: Hypotheses, root: Root) -> None:
    of.numbers[TOLD11], of.numbers[TOLD21], of.numbers[TOLD22] = root.r11, root.r21, root.r22


@compiled
def tell_all(of: Hypotheses) -> None:
    """Let all that the empty scene knows of the crosstalk be known without an object."""
    x, X = of.x, of.X
    of.numbers[TOLD] = unknown_crosstalk(of, 0)
    of.numbers[TOLD1], of.numbers[TOLD2] = x[0, CROSSTALK1], x[0, CROSSTALK2]
    root = Root(0.0, 0.0, 0.0)
    for j in range(X.shape[2]):
        root = add_factor(root, X[0, CROSSTALK1, j], X[0, CROSSTALK2, j])
    _keep_root(of, root)


@compiled
def carry_told(into: Hypotheses, of: Hypotheses) -> None:
    """Let what some hypotheses know without an object be known to others."""
    into.numbers[TOLD] = of.numbers[TOLD]
    for k in range(TOLD1, TOLD22 + 1):
        into.numbers[k] = of.numbers[k]


@compiled
def take_drift(of: Hypotheses, drift1: float, drift2: float) -> None:
    """Let what is known drift by so many standard deviations of the noise."""
    of.numbers[TOLD] += max(drift1 * drift1, drift2 * drift2)
    _keep_root(of, add_root(told_root(of), Root(drift1, 0.0, drift2)))


@borrowed
@compiled
def take_stated(
    of: Hypotheses, residual: tuple[float, float], noise: Root, nuisance: Array
) -> None:
    """Take a frame that is stated to be empty.

    Parameters
    ----------
    of : Hypotheses
        Before it learns the frame. Its numbers are changed in place.
    residual : (float, float)
        The frame's readings less what the empty scene expects.
    noise : Root
        Of the covariance of the frame's noise.
    nuisance : ndarray, shape (2, p)
        Change of its readings with the nuisance parameters.
    """
    numbers = of.numbers
    first = noise.r11 * noise.r11
    second = noise.r21 * noise.r21 + noise.r22 * noise.r22
    own = noise
    for j in range(nuisance.shape[1]):
        first += nuisance[FIRST, j] * nuisance[FIRST, j]
        second += nuisance[SECOND, j] * nuisance[SECOND, j]
        own = add_factor(own, nuisance[FIRST, j], nuisance[SECOND, j])
    variance, known = max(first, second), numbers[TOLD]
    numbers[TOLD] = known * variance / (known + variance)
    # the same of both readings, a Kalman step: the readings are linear in the crosstalk
    before = told_root(of)
    both = add_root(before, own)
    off1 = residual[0] + of.x[0, CROSSTALK1] - numbers[TOLD1]
    off2 = residual[1] + of.x[0, CROSSTALK2] - numbers[TOLD2]
    step1, step2 = times(before, solve(both, off1, off2))
    numbers[TOLD1], numbers[TOLD2] = numbers[TOLD1] + step1, numbers[TOLD2] + step2
    # what it leaves: of what was known the frame's share, and of the frame the other one
    root = Root(0.0, 0.0, 0.0)
    left1, left2 = times(own, solve(both, before.r11, before.r21))
    root = add_factor(root, left1, left2)
    left1, left2 = times(own, solve(both, 0.0, before.r22))
    root = add_factor(root, left1, left2)
    left1, left2 = times(before, solve(both, own.r11, own.r21))
    root = add_factor(root, left1, left2)
    left1, left2 = times(before, solve(both, 0.0, own.r22))
    _keep_root(of, add_factor(root, left1, left2))
