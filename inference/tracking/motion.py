"""What happens between frames: the object moves, leaves, or comes.

The rate v = d log r / dt is an Ornstein-Uhlenbeck process, so that after a gap of any length the
prediction is neither too sure nor endlessly wide; presence is a Markov chain of two states.
"""

import math
from typing import NamedTuple

from inference.tracking.roots import Root
from simulator.compiled import compiled

__all__ = ["Motion", "Presence", "Rules", "motion_over", "presence_over", "wider"]


class Rules(NamedTuple):
    """Numbers that the filter's kernels need besides the curve."""

    # rates at which an object leaves and comes [1/s]
    leave: float
    arrive: float
    # standard deviation [1/s] and correlation time [s] of d log r / dt
    rate_sd: float
    rate_time: float
    # drift of the crosstalk, in units of the read noise per square root of a second
    drift1: float
    drift2: float
    outlier: float  # probability that a frame's readings have nothing to do with the scene
    # least width of the Cauchy law that such readings follow around what was expected, in units of
    # the noise
    breadth: float
    hypotheses: int  # most that are kept, but for the parts in which an object comes
    log_negligible: float  # log weight below which a hypothesis is dropped
    # information lost, in nats per weight of the lighter one, below which two hypotheses merge
    same: float
    memory: float  # share of the running surprise that a frame leaves as it was
    most_surprise: float  # surprise at which a single frame is cut
    # weight, given that an object is there, above which one range is the answer
    unique_above: float
    from_scene: int  # nuisance parameters, the first, that are of the scene; others are the model's


class Motion(NamedTuple):
    """How states move over one time step."""

    # u grows by carry du/dt, and du/dt shrinks by the factor decay
    carry: float
    decay: float
    noise: Root  # of the noise of (u, du/dt) that enters
    # standard deviations by which the crosstalk drifts
    drift1: float
    drift2: float


class Presence(NamedTuple):
    """Probabilities over one time step."""

    arrived: float  # from absent to present
    left: float  # from present to absent
    stayed: float  # the same object stayed
    replaced: float  # present before and after, but left in between


@compiled
def presence_over(seconds: float, leave: float, arrive: float) -> Presence:
    """Return the presence chain's probabilities, right to rounding also for short steps."""
    both = leave + arrive
    change = -math.expm1(-both * seconds)
    left = leave / both * change
    gone = -math.expm1(-leave * seconds)
    return Presence(arrive / both * change, left, 1.0 - gone, max(gone - left, 0.0))


@compiled
def _noise_over(x: float, fall: float, sd: float, time: float) -> Root:
    """Return the root of the noise of (u, v) that enters over x correlation times of v."""
    decay = 1.0 - fall
    if x < 0.1:
        # 2 x - 3 + 4 exp(-x) - exp(-2 x), whose first three orders cancel
        square = (
            x
            * (x * x)
            * (
                2.0 / 3.0
                + x
                * (
                    -0.5
                    + x
                    * (
                        7.0 / 30.0
                        + x
                        * (
                            -1.0 / 12.0
                            + x * (31.0 / 1260.0 + x * (-1.0 / 160.0 + x * 127.0 / 90720.0))
                        )
                    )
                )
            )
        )
    else:
        square = 2.0 * x - 3.0 + 4.0 * decay - decay * decay
    first = sd * time * math.sqrt(square)
    if not first > 0.0:
        return Root(0.0, 0.0, 0.0)
    mixed = sd * fall * fall / math.sqrt(square)
    rest = -sd * sd * math.expm1(-2.0 * x) - mixed * mixed
    return Root(first, mixed, math.sqrt(max(rest, 0.0)))


@compiled
def motion_over(seconds: float, rules: Rules) -> Motion:
    """Return how (u, v) and the crosstalk move: an integrated Ornstein-Uhlenbeck process.

    Parameters
    ----------
    seconds : float
        Time step [s].
    rules : Rules
        Standard deviation and correlation time of v, drift of the crosstalk.
    """
    x = seconds / rules.rate_time
    fall = -math.expm1(-x)
    root = math.sqrt(seconds)
    return Motion(
        rules.rate_time * fall,
        1.0 - fall,
        _noise_over(x, fall, rules.rate_sd, rules.rate_time),
        rules.drift1 * root,
        rules.drift2 * root,
    )


@compiled
def wider(motion: Motion, times: float) -> Motion:
    """Return the motion of a rate whose standard deviation is so many times as large."""
    carry, decay, noise, drift1, drift2 = motion
    more = Root(times * noise.r11, times * noise.r21, times * noise.r22)
    return Motion(carry, decay, more, drift1, drift2)
