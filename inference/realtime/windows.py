"""Derivatives of readings over windows of frames, each as wide as noise asks and its bias allows.

A moving average of M + 1 first differences is the difference (x_i - x_(i-M-1)) / (M + 1) (App. A,
25-27 as corrected): a longer window has less noise, and belongs to its centre. So a frame's own
derivative needs a window around it. Five readings (i - 2 m .. i + 2 m) with Lagrange's weights give
it to fourth order at any spacing; at the ends, and nowhere else, the frame is not in the middle.

What remains is a bias. Three readings of the same window err by a known multiple of the third
derivative, five by one of the fifth; of a flux falling as r^-N their ratio follows from that of
three to five, to within a sixth for N from 2 to 4 (docs/model.md, window). So the bias is estimated
from readings alone, and stated as a part of the covariance, in the direction in which it points.
Of all half widths m that is taken whose direction has the least noise and bias together; a window
whose direction does not agree with those of narrower ones ends the search, whatever it says of
itself, and so does one that is bias for the most part.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from inference.realtime.window_errors import grown, level_turns
from simulator.compiled import compiled

__all__ = ["HALF_WIDTHS", "Windows", "differences"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

HALF_WIDTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_NODES = 5
# a chord of a curve is a tangent somewhere between its ends, and two readings do not say where
_LEAST_ON_A_CURVE = 3
# standard deviations. At 2 one of some sixty pairs of windows disagreed by chance in many frames,
# and left the narrower one where it was off: 90 % intervals held 80 % of 2,500 frames of a sweep
_AGREEMENT = 3.0
_MOST = 0.5  # of a derivative, above which its bias leaves nothing of it
_END = 8  # frames from an end, where windows to one side are better than none
_BENDS = 3.0  # 2 (N + 3) / (N + 1) is 3.3 to 2.8 of a power law of N = 2 to 4
_CROOKED = 1.0  # share of the bias that is across, to one side, over the error of three readings
# 3! 3! / 5!: from products of distances to the factors of the errors of five and of three readings
_FACTORIALS = 0.3


class Windows(NamedTuple):
    """Differences over the window of every frame, each of shape (n,); nan where none is allowed.

    Attributes
    ----------
    first, second : ndarray
        Derivatives of both readings [reading units / s].
    var1, var2, cov : ndarray
        Their noise and bias.
    direction_sd : ndarray
        Uncertainty of their direction [rad], in units of the noise.
    """

    first: Array
    second: Array
    var1: Array
    var2: Array
    cov: Array
    direction_sd: Array


class _Difference(NamedTuple):
    """A derivative of both readings, its noise, and the product of distances to other nodes."""

    d1: float
    d2: float
    v1: float
    v2: float
    v12: float
    distances: float


@compiled
def _difference(t: Array, net: Net, nodes: Indices, at: int, first: int, last: int) -> _Difference:
    """Differentiate at one of the nodes ``first`` to ``last``, by Lagrange's weights."""
    here = nodes[at]
    x = t[here]
    d1, d2, v1, v2, v12, own, distances = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    for j in range(first, last + 1):
        if j == at:
            continue
        node = nodes[j]
        weight = 1.0 / (t[node] - x)
        distances *= t[node] - x
        for other in range(first, last + 1):
            if other not in (j, at):
                weight *= (x - t[nodes[other]]) / (t[node] - t[nodes[other]])
        # differences from the frame's own reading, so that a constant cancels exactly
        d1 += weight * (net.first[node] - net.first[here])
        d2 += weight * (net.second[node] - net.second[here])
        v1 += weight * (weight * net.var1[node])
        v2 += weight * (weight * net.var2[node])
        v12 += weight * (weight * net.cov[node])
        own -= weight
    v1 += own * (own * net.var1[here])
    v2 += own * (own * net.var2[here])
    v12 += own * (own * net.cov[here])
    return _Difference(d1, d2, v1, v2, v12, abs(distances))


@compiled
def _placed(i: int, m: int, start: int, end: int, nodes: Indices) -> tuple[int, int]:
    """Fill in the nodes of a window of half width m among frames ``start`` to ``end`` - 1.

    Returns how many there are, and the frame's own place among them.
    """
    count, at = _placed_from_zero(i - start, m, end - start, nodes)
    for j in range(count):
        nodes[j] += start
    return count, at


@compiled
def _placed_from_zero(i: int, m: int, n: int, nodes: Indices) -> tuple[int, int]:
    if n < 2:
        return 0, 0
    if n < _NODES:
        for j in range(n):
            nodes[j] = j
        return (n, i) if m == 1 else (0, 0)
    before = 2
    if i < 2 * m:
        before = i // m
    elif i + 2 * m >= n:
        before = _NODES - 1 - (n - 1 - i) // m
    if before != 2 and min(i, n - 1 - i) >= _END:
        return 0, 0
    low = i - before * m
    if low < 0 or low + (_NODES - 1) * m >= n:
        return 0, 0
    for j in range(_NODES):
        nodes[j] = low + j * m
    return _NODES, before


@compiled
def _bias(
    t: Array,
    net: Net,
    nodes: Indices,
    count: int,
    at: int,
    whole: _Difference,
    s1: float,
    s2: float,
) -> tuple[float, float, float]:
    """Return about how far a derivative is from the truth, as a vector.

    Last comes by how much three readings of the window err, two of three, relative to the
    derivative.
    """
    few = 3 if count > 3 else 2
    first = min(max(at - 1, 0), count - few)
    part = _difference(t, net, nodes, at, first, first + few - 1)
    b1, b2 = whole.d1 - part.d1, whole.d2 - part.d2
    size = math.hypot(whole.d1 / s1, whole.d2 / s2)
    bend = math.hypot(b1 / s1, b2 / s2) / size if size > 0.0 else math.inf
    if count < _NODES:
        return b1, b2, bend
    share = _BENDS * _FACTORIALS * whole.distances / (part.distances * part.distances) * bend
    return share * b1, share * b2, bend


@compiled
def differences(t: Array, net: Net, gain: Array | None, radial: bool, out: Windows) -> None:
    """Fill in the differences of n frames.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, increasing [s].
    net : Net
        Readings of the frames and their noise.
    gain : ndarray, shape (n,), optional
        Factors of the frames on the sensor's gain, where windows must not mix them.
    radial : bool
        Whether readings move along a curve. Along a straight line, such as that of an object at a
        fixed range, bias has the direction of the change, and so has a common error of both.
    out : Windows
        Receives the results.
    """
    n = t.size
    nodes = np.empty(_NODES, dtype=np.intp)
    angles, sds = np.empty(len(HALF_WIDTHS)), np.empty(len(HALF_WIDTHS))
    turns, products = np.zeros(n), np.zeros(n)
    start, end = 0, n
    for i in range(n):
        if gain is not None and (i == 0 or i == end):
            start, end = i, i + 1
            while end < n and gain[end] == gain[i]:
                end += 1
        tried, best, widest = 0, math.inf, 0.0
        s1, s2 = math.sqrt(net.var1[i]), math.sqrt(net.var2[i])
        for m in HALF_WIDTHS:
            count, at = _placed(i, m, start, end, nodes)
            if count < (_LEAST_ON_A_CURVE if radial else 2):
                break
            whole = _difference(t, net, nodes, at, 0, count - 1)
            b1, b2, bend = _bias(t, net, nodes, count, at, whole, s1, s2)
            x, y = whole.d2 / s2, whole.d1 / s1
            square = x * x + y * y
            noise, turn, more = math.inf, 0.0, 0.0
            if square > 0.0:
                c1, c2, c12 = whole.v1 / s1 / s1, whole.v2 / s2 / s2, whole.v12 / s1 / s2
                across = max(x * x * c1 + y * y * c2 - 2.0 * x * y * c12, 0.0) / square
                noise = math.sqrt(across / square)
                if radial:
                    along = (x * x * c2 + y * y * c1 + 2.0 * x * y * c12) / square
                    both = ((x * x - y * y) * c12 + x * y * (c1 - c2)) / square
                    growth = grown(square, across, along, both)
                    noise *= growth
                    if growth < math.inf:
                        more = (growth * growth - 1.0) * across / square
                turn = abs(x * b1 / s1 - y * b2 / s2) / square
            # the bias grows with the window, whatever noise makes of its estimate
            if turn < widest and turn > 0.0:
                b1, b2 = b1 * widest / turn, b2 * widest / turn
                turn = widest
            widest = turn
            # along itself too: a chord from a bright frame to a dark one has a direction of its
            # own
            bias = math.hypot(b1 / s1, b2 / s2)
            # to one side, and of fewer readings, errors of one order and the next do not point the
            # same way: where frames are far apart, an estimate that lies along the change says
            # nothing of what is across
            aside = count == _NODES and at != _NODES // 2
            if radial and square > 0.0 and (aside or count < _NODES):
                sideways = bias / math.sqrt(square) * min(_CROOKED * bend, 1.0)
                # nor do series to one side converge where the light grows severalfold within them:
                # what an order more changes says how far they are from it
                if aside:
                    side = 0 if at < _NODES // 2 else 1
                    four = _difference(t, net, nodes, at, side, side + _NODES - 2)
                    three = _difference(t, net, nodes, at, 2 * side, 2 * side + _NODES - 3)
                    last = abs(x * (whole.d1 - four.d1) / s1 - y * (whole.d2 - four.d2) / s2)
                    before = abs(x * (four.d1 - three.d1) / s1 - y * (four.d2 - three.d2) / s2)
                    slower = min(last / before, 1.0) if before > 0.0 else 1.0
                    sideways = max(sideways, last * slower / square)
                if sideways > turn:
                    more += sideways * sideways - turn * turn
                    turn = sideways
                    widest = turn
            blur = _AGREEMENT * math.hypot(math.sqrt(whole.v1) / s1, math.sqrt(whole.v2) / s2)
            if tried > 0 and bias > max(_MOST * math.sqrt(square), blur):
                break
            angle, sd = math.atan2(y, x), math.sqrt(noise * noise + turn * turn)
            agrees = True
            for earlier in range(tried):
                off = abs(angle - angles[earlier]) % math.pi
                off = min(off, math.pi - off)
                agrees &= off <= _AGREEMENT * math.hypot(sd, sds[earlier])
            if not agrees:
                break
            angles[tried], sds[tried] = angle, sd
            tried += 1  # noqa: SIM113  # not every width is tried
            if tried == 1 or sd < best:
                best = sd
                turns[i], products[i] = turn, whole.distances
                out.first[i], out.second[i], out.direction_sd[i] = whole.d1, whole.d2, sd
                out.var1[i] = whole.v1 + b1 * b1 + more * (x * s1) * (x * s1)
                out.var2[i] = whole.v2 + b2 * b2 + more * (y * s2) * (y * s2)
                out.cov[i] = whole.v12 + b1 * b2 - more * (x * s1) * (y * s2)
    if radial:
        level_turns(net, turns, products, (out.first, out.second), (out.var1, out.var2, out.cov))
