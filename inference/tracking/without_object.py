"""What is known of the crosstalk without any object: by its prior and by frames stated empty.

What frames of an object tell of the crosstalk they tell with its range, and so it turns with the
tangent along which that was told (`inference.tracking.shared_error`). What is known without an
object does not: no tangent has a part in it. Turned like the rest, crosstalk that was known to a
fraction of a frame's noise was opened to thousands of noises wherever a prediction was vague, and
took over whatever light lay there. So what is known without an object is kept beside the state, as
the larger variance of a reading in that of the noise; what an object teaches has no part in it.

docs/model.md, without-object, has the rule.
"""

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import TOLD, Hypotheses
from inference.tracking.readings_table import FIRST, SECOND, Array
from inference.tracking.roots import Root
from simulator.compiled import compiled

__all__ = ["open_part", "take_drift", "take_stated"]


@compiled
def open_part(variance: float) -> float:
    """Return how much of an error's variance crosstalk can take up, from 0 to 1.

    Crosstalk that adds q variances of the noise to a reading takes up q / (q + 1) of an error: of
    its variance the square.
    """
    taken = variance / (variance + 1.0)
    return taken * taken


@compiled
def take_drift(of: Hypotheses, drift1: float, drift2: float) -> None:
    """Let what is known drift by so many standard deviations of the noise."""
    of.numbers[TOLD] += max(drift1 * drift1, drift2 * drift2)


@borrowed
@compiled
def take_stated(of: Hypotheses, noise: Root, nuisance: Array) -> None:
    """Take a frame that is stated to be empty.

    Parameters
    ----------
    of : Hypotheses
        Its numbers are changed in place.
    noise : Root
        Of the covariance of the frame's noise.
    nuisance : ndarray, shape (2, p)
        Change of its readings with the nuisance parameters.
    """
    first = noise.r11 * noise.r11
    second = noise.r21 * noise.r21 + noise.r22 * noise.r22
    for j in range(nuisance.shape[1]):
        first += nuisance[FIRST, j] * nuisance[FIRST, j]
        second += nuisance[SECOND, j] * nuisance[SECOND, j]
    own, known = max(first, second), of.numbers[TOLD]
    of.numbers[TOLD] = known * own / (known + own)
