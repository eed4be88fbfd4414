"""From one frame to the next: time passes, and what a hypothesis then says of the readings."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.beside_crosstalk import Beside, beside_of
from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import Added, Position, Prior, Rate, spread_at
from inference.tracking.hypotheses import (
    ANCHOR,
    COUNT,
    CROSSTALK1,
    CROSSTALK2,
    LOST,
    PENDING,
    Hypotheses,
    U,
    V,
    learns_crosstalk,
    variance_of,
)
from inference.tracking.merging import merge
from inference.tracking.motion import Motion, Rules, motion_over, presence_over, wider
from inference.tracking.readings_table import ReadingsTable, mean_at, noise_root, object_at
from inference.tracking.resting import nothing_has_changed
from inference.tracking.roots import UNIT, Root, add_factor
from inference.tracking.second_order import add_products
from inference.tracking.shared_error import certainty, known_part, shared_part
from inference.tracking.square_root import move
from inference.tracking.turning import widening
from inference.tracking.without_object import take_drift
from simulator.compiled import compiled

__all__ = ["born_prior", "own_prior", "predict", "prior_of"]

Array = NDArray[np.float64]

_LOST = 1.0  # e-folds of the range that an object may have moved
_LOG_2PI = math.log(2.0 * math.pi)


@borrowed
@compiled
def predict(
    seconds: float, of: Hypotheses, rules: Rules, table: ReadingsTable, work: Array
) -> None:
    """Predict everything to the time of the next frame.

    Parameters
    ----------
    seconds : float
        Until then [s].
    of : Hypotheses
        Changed in place.
    rules : Rules
        How objects move, come and go.
    table : ReadingsTable
        The scene.
    work : ndarray
        As in `Scratch`.
    """
    x, weight, numbers = of.x, of.weight, of.numbers
    chance = presence_over(seconds, rules.leave, rules.arrive)
    motion = motion_over(seconds, rules)
    learns = learns_crosstalk(of)
    born = weight[0] * chance.arrived + numbers[PENDING] * (1.0 - chance.left)
    empty = weight[0] * (1.0 - chance.arrived)
    leaver, heaviest = 0, empty
    for j in range(1, int(numbers[COUNT]) + 1):
        left = weight[j] * chance.left
        empty += left
        if left > heaviest:
            leaver, heaviest = j, left
    if learns and leaver > 0:
        # the heaviest, not the mean: between a scene that was empty all along and one that an
        # object has just left, a mean would let the crosstalk follow what an object reflects
        merge(of, 0, leaver, 1.0, CROSSTALK1, work)
    # an object that may be anywhere by now is one that has just come, but for the crosstalk: the
    # common part of their errors is straight only as far as the curve is
    reach = motion.carry * rules.rate_sd
    noise = motion.noise.r11
    lost = learns and reach * reach + noise * noise > _LOST * _LOST
    for j in range(1, int(numbers[COUNT]) + 1):
        born += weight[j] * chance.replaced
        weight[j] *= chance.stayed
        if lost:
            if weight[j] > 1e-9 * (empty + born):
                merge(of, 0, j, weight[j] / (empty + born + weight[j]), CROSSTALK1, work)
            born += weight[j]
            continue
        along = motion.carry * x[j, V]
        own = motion
        if learns:
            own = wider(motion, widening(of, j, reach, table))
        move(of, j, own, work)
        if learns:
            x[j, ANCHOR] += certainty(of, j) * along
    numbers[LOST] = 1.0 if lost else 0.0
    if lost:
        numbers[COUNT] = 0.0
    weight[0] = empty + numbers[PENDING] * chance.left
    numbers[PENDING] = born
    if learns:
        still = Motion(0.0, 0.0, Root(0.0, 0.0, 0.0), motion.drift1, motion.drift2)
        move(of, 0, still, work)
        take_drift(of, motion.drift1, motion.drift2)


@compiled
def _rate_given_u(of: Hypotheses, row: int, precision: float) -> Rate:
    """Return what a hypothesis says of du/dt given u."""
    X = of.X
    slope, square = 0.0, 0.0
    for j in range(X.shape[-1]):
        slope += X[row, U, j] * X[row, V, j] * precision
    for j in range(X.shape[-1]):
        off = X[row, V, j] - slope * X[row, U, j]
        square += off * off
    return Rate(of.x[row, V], slope, math.sqrt(square))


@borrowed
@compiled
def own_prior(
    of: Hypotheses, row: int, gain: float, log_weight: float, table: ReadingsTable, known: bool
) -> Prior:
    """Return what a hypothesis says of the next frame, as `prior_of`, nuisance parameters left out.

    A frame is learnt beside them, so that whoever learns asks for no more.
    """
    x, variance = of.x, max(variance_of(of, row, U), 1e-300)
    beside, told, products = Beside(variance, 0.0, 0.0, Root(0.0, 0.0, 0.0), 0.0), 1.0, 1.0
    offset1, offset2, root = table.crosstalk1, table.crosstalk2, beside.root
    if learns_crosstalk(of):
        offset1, offset2 = offset1 + x[row, CROSSTALK1], offset2 + x[row, CROSSTALK2]
        _, _, share = shared_part(of, row)
        u, noise = x[row, U], UNIT
        value1, value2, d1, d2 = mean_at(u, table)
        if not table.noise.plain:
            o1, o2 = object_at(u, table)
            m1, m2 = gain * value1 + offset1, gain * value2 + offset2
            noise = noise_root(m1, m2, gain * o1, gain * o2, table.noise)
        beside = beside_of(of, row, gain, noise, known, table)
        told, products = known_part(of, row), (1.0 - share) * known_part(of, row)
        told *= 1.0 - beside.share
        slopes, X = (d1, d2), of.X[row]
        root = add_products(beside.root, noise, u, gain, variance, products, slopes, X, table)
    precision = 1.0 / beside.variance
    rate = Rate(x[row, V], 0.0, 0.0)
    if table.by_rate:
        rate = _rate_given_u(of, row, precision)
    log_scale = log_weight + 0.5 * (math.log(precision) - _LOG_2PI)
    return Prior(
        Position(False, False, False, x[row, U], precision, log_scale),
        Added(offset1, offset2, beside.slope1, beside.slope2, beside.root, root, of.X[row]),
        rate,
        beside.share,
        told,
        products,
        variance,
    )


@borrowed
@compiled
def prior_of(
    of: Hypotheses, row: int, gain: float, log_weight: float, table: ReadingsTable, known: bool
) -> Prior:
    """Return what a hypothesis says of the next frame, as a density of u and the rest given u.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis.
    gain : float
        The frame's factor on the sensor's gain.
    log_weight : float
        Log of what the density integrates to.
    table : ReadingsTable
        The scene.
    known : bool
        Whether the frame's range is known beside its readings.
    """
    prior = own_prior(of, row, gain, log_weight, table, known)
    if of.X.shape[-1] == of.X.shape[1]:
        return prior
    u, added = prior.position.centre, prior.added
    _, _, d1, d2 = mean_at(u, table)
    root = spread_at(added.root, u, gain, (d1, d2), of.X[row], table)
    return Prior(
        prior.position,
        Added(
            added.offset1,
            added.offset2,
            added.slope1,
            added.slope2,
            added.own,
            root,
            added.spread,
        ),
        prior.rate,
        prior.share,
        prior.told,
        prior.products,
        prior.variance,
    )


@borrowed
@compiled
def born_prior(of: Hypotheses, log_weight: float, rate_sd: float, table: ReadingsTable) -> Prior:
    """Return what is known of an object that has just come: the prior of ranges, and crosstalk.

    Row 0 holds the crosstalk as the empty scene has it.

    Parameters
    ----------
    of : Hypotheses
        Of which row 0 is used.
    log_weight : float
        Log of what the density integrates to.
    rate_sd : float
        Standard deviation of du/dt [1/s].
    table : ReadingsTable
        The scene.
    """
    offset1, offset2 = table.crosstalk1, table.crosstalk2
    root = Root(0.0, 0.0, 0.0)
    if learns_crosstalk(of):
        offset1, offset2 = offset1 + of.x[0, CROSSTALK1], offset2 + of.x[0, CROSSTALK2]
        for j in range(of.X.shape[-1]):
            root = add_factor(root, of.X[0, CROSSTALK1, j], of.X[0, CROSSTALK2, j])
    again = of.numbers[LOST] > 0.0
    # crosstalk that a frame stated empty has told is no more open along a whole curve
    alone = of.numbers[COUNT] == 0.0 and nothing_has_changed(of) and not again
    return Prior(
        Position(True, again, alone, 0.0, 0.0, log_weight),
        Added(offset1, offset2, 0.0, 0.0, root, root, of.X[0, of.X.shape[1] - 2 :]),
        Rate(0.0, 0.0, rate_sd),
        0.0,
        known_part(of, 0) if learns_crosstalk(of) else 1.0,
        known_part(of, 0) if learns_crosstalk(of) else 1.0,
        0.0,
    )
