"""Crosstalk that turns of a tangent have opened, held to what is known of it without an object.

Errors of readings are kept when a tangent turns, and the errors of the crosstalk take the turn up
(`inference.tracking.shared_error`): what an object has told of it is so unlearnt. What prior and
frames stated empty have told is not, but beside bright uncertain light the filter opens crosstalk
to many times that. There this keeps it from learning what no frame has told, and its hypotheses
stay what they are. What is said of them has the crosstalk as it is known without an object, in
every direction of the two readings in which a hypothesis errs by more.

Not where both contradict each other: then readings have said that what is known is wrong.

docs/model.md, by-frame, has the rule.
"""

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2, TOLD1, TOLD2, Hypotheses
from inference.tracking.roots import Root, add_factor, add_root, rest_of, solve, times
from inference.tracking.without_object import told_root
from simulator.compiled import compiled

__all__ = ["hold_told"]

_BEYOND = 9.0  # squared distance of both, which chance exceeds once in 90


@borrowed
@compiled
def hold_told(of: Hypotheses, row: int) -> bool:
    """Teach the crosstalk of a hypothesis what is known without an object, as far as it errs more.

    By no more than leaves what is known. The other states stay what they are, as if they had
    nothing in common with it.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; changed in place.

    Returns
    -------
    bool
        Whether it was opened, and what is known without an object does not contradict it.
    """
    x, X, numbers = of.x, of.X, of.numbers
    n, m = X.shape[1], X.shape[2]
    known = told_root(of)
    own, held = Root(0.0, 0.0, 0.0), Root(0.0, 0.0, 0.0)
    for j in range(m):
        held = add_factor(held, X[row, CROSSTALK1, j], X[row, CROSSTALK2, j])
    off1, off2 = numbers[TOLD1] - x[row, CROSSTALK1], numbers[TOLD2] - x[row, CROSSTALK2]
    pull1, pull2 = solve(add_root(held, known), off1, off2)
    if off1 * pull1 + off2 * pull2 > _BEYOND:
        return False
    some, rest = rest_of(known, held)
    if not some:
        return False
    both = add_root(held, rest)
    step1, step2 = times(held, solve(both, off1, off2))
    x[row, CROSSTALK1], x[row, CROSSTALK2] = x[row, CROSSTALK1] + step1, x[row, CROSSTALK2] + step2
    for j in range(m):
        pulls = solve(both, X[row, CROSSTALK1, j], X[row, CROSSTALK2, j])
        left1, left2 = times(rest, pulls)
        if j < n:
            own = add_factor(own, left1, left2)
            left1, left2 = 0.0, 0.0
        X[row, CROSSTALK1, j], X[row, CROSSTALK2, j] = left1, left2
    left1, left2 = times(held, solve(both, rest.r11, rest.r21))
    own = add_factor(own, left1, left2)
    left1, left2 = times(held, solve(both, 0.0, rest.r22))
    own = add_factor(own, left1, left2)
    X[row, CROSSTALK1, CROSSTALK1], X[row, CROSSTALK2, CROSSTALK1] = own.r11, own.r21
    X[row, CROSSTALK2, CROSSTALK2] = own.r22
    return True
