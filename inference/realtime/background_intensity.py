"""Background intensity: what a known background still shows of itself gives the range away.

x - B S(r) e^jkR is the object alone, so its phase must be k r: theta(r) = k r - arg(x - B S e^jkR)
is a multiple of 2 pi. B S moves along a straight line, so that arg is monotone in S and theta turns
where a quartic has its roots. For a pulse, r w2 + B S(r) (R - r) = r0 w1 is a cubic (4.76).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import NOISE_BAND, Candidates, Outcome, assemble, reasons_of
from inference.realtime.bracketing import EPSILON, next_point
from inference.realtime.exact import cycles_phase
from inference.realtime.net import Net, net_readings
from inference.realtime.pieces import LEAST
from inference.realtime.polynomials import real_roots
from inference.realtime.technique import Task, Technique
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled
from simulator.sensor import PulsedSensor, SineWaveSensor

__all__ = ["BACKGROUND_INTENSITY"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_REASONS = reasons_of(
    "no light: w2 is not positive",
    "w1 is not positive: at or near contact",
    "the readings lie at or beyond the background",
    "no signal: i and q are zero",
    "no range before the background gives these readings",
)
_DARK, _CONTACT, _BEYOND, _SILENT, _NO_RANGE = range(len(_REASONS) - 5, len(_REASONS))
_CHUNK = 2_000_000


@compiled
def _balance(r: float, w1: float, w2: float, b: float, p: Array) -> float:
    """Return (r w2 - w1) + b S(r) (R - r); w1 is already times r0. p = (R, c0', c1', k)."""
    return (r * w2 - w1) + b * shadow(r, p[1], p[2]) * (float(p[0]) - r)


@compiled
def _theta(
    r: float, psi: float, mu: float, nu: float, cosine: float, sine: float, p: Array
) -> float:
    """Return k r - psi - arg(mu - nu S e^j chi)."""
    hidden = nu * shadow(r, p[1], p[2])
    return float(p[3]) * r - psi - math.atan2(-hidden * sine, mu - hidden * cosine)


@compiled
def _solve_balance(low: float, high: float, w1: float, w2: float, b: float, p: Array) -> float:
    a, c, fc = low, high, 0.0
    fa = _balance(a, w1, w2, b, p)
    e = high
    fe = _balance(e, w1, w2, b, p)
    c, fc = e, fe
    for _ in range(400):
        x, tolerance = next_point(a, e, c, fa, fe, fc)
        if abs(e - a) <= tolerance or fa == 0.0 or fe == 0.0:
            break
        fx = _balance(x, w1, w2, b, p)
        if (fx > 0.0) == (fa > 0.0):
            c, fc = a, fa
        else:
            c, fc = e, fe
            e, fe = a, fa
        a, fa = x, fx
    return a if abs(fa) < abs(fe) else e


@compiled
def _solve_theta(
    low: float,
    high: float,
    goal: float,
    psi: float,
    mu: float,
    nu: float,
    cosine: float,
    sine: float,
    p: Array,
) -> float:
    a, e = low, high
    fa = _theta(a, psi, mu, nu, cosine, sine, p) - goal
    fe = _theta(e, psi, mu, nu, cosine, sine, p) - goal
    if (fa > 0.0) == (fe > 0.0):  # rounding at an end
        return a if abs(fa) < abs(fe) else e
    c, fc = e, fe
    for _ in range(400):
        x, tolerance = next_point(a, e, c, fa, fe, fc)
        if abs(e - a) <= tolerance or fa == 0.0 or fe == 0.0:
            break
        fx = _theta(x, psi, mu, nu, cosine, sine, p) - goal
        if (fx > 0.0) == (fa > 0.0):
            c, fc = a, fa
        else:
            c, fc = e, fe
            e, fe = a, fa
        a, fa = x, fx
    return a if abs(fa) < abs(fe) else e


@compiled
def _pulsed(
    first: Array,
    second: Array,
    var1: Array,
    var2: Array,
    cov: Array,
    state: NDArray[np.uint8],
    strength: float,
    r0: float,
    p: Array,
    band: float,
    roots: Array,
    sds: Array,
    near: Flags,
    near_frame: Flags,
    physical: Flags,
) -> None:
    distance, c0, c1 = p[0], p[1], p[2]
    cubic, turns, ends = np.empty(3), np.empty(3), np.empty(4)
    for i in range(first.size):
        if state[i] != 0:
            continue
        # in units of the largest, so that nothing overflows
        size = max(abs(second[i]), abs(first[i]), strength)
        w1, w2, b = r0 * (first[i] / size), second[i] / size, strength / size
        v1 = r0 * (r0 * (var1[i] / size / size))
        v2 = var2[i] / size / size
        v12 = r0 * (cov[i] / size / size)
        a2 = (w2 - b) * c1 - (w1 - b * distance)
        a1 = w2 * c0 - c1 * (w1 - b * distance)
        cubic[0], cubic[1], cubic[2] = 3.0 * (w2 - b), 2.0 * a2, a1
        count = real_roots(cubic, 0.0, distance, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = distance
        found = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left, right = _balance(low, w1, w2, b, p), _balance(high, w1, w2, b, p)
            for side in range(2):
                at, off = (low, left) if side == 0 else (high, right)
                if (side == 0 and j > 0) or (side == 1 and j < count):
                    spread = math.sqrt(max(v1 + at * at * v2 - 2.0 * at * v12, 0.0))
                    if abs(off) < band * spread:
                        near_frame[i] = True
                        near[i, j] = True
            if not ((left < 0.0 <= right) or (left > 0.0 >= right)):
                continue
            r = _solve_balance(low, high, w1, w2, b, p)
            if not r < distance or (found > 0 and r <= roots[i, found - 1]):
                continue
            roots[i, found] = r
            near[i, found] = near[i, j]
            slope = b * shadow_slope(r, c0, c1)
            flux = w2 - b * shadow(r, c0, c1)
            steep = flux + slope * (distance - r)
            sds[i, found] = math.sqrt(max(v1 + r * r * v2 - 2.0 * r * v12, 0.0)) / abs(steep)
            # flux = w2 - b S(r), d r = (d w1 - r d w2) / steep
            lever = slope / steep
            g1, g2 = -lever, 1.0 + lever * r
            spread = math.sqrt(max(g1 * (g1 * v1) + g2 * (g2 * v2) + 2.0 * g1 * g2 * v12, 0.0))
            spread = band * spread + 64.0 * EPSILON * (abs(w2) + b) * (1.0 + abs(lever) * r)
            seen = r + c1 >= -(band * sds[i, found] + 1e-12 * r)
            physical[i, found] = seen and not flux < -spread
            found += 1
        for j in range(found, near.shape[1]):
            near[i, j] = False


@compiled
def _sine_wave(
    first: Array,
    second: Array,
    var1: Array,
    var2: Array,
    cov: Array,
    state: NDArray[np.uint8],
    strength: float,
    offset: float,
    far_phase: float,
    p: Array,
    band: float,
    roots: Array,
    sds: Array,
    near: Flags,
    near_frame: Flags,
    physical: Flags,
) -> None:
    distance, c0, c1, k = p[0], p[1], p[2], p[3]
    quartic, turns, ends = np.empty(5), np.empty(5), np.empty(6)
    for i in range(first.size):
        largest = max(abs(first[i]), abs(second[i]))
        if state[i] != 0 or largest == 0.0:
            continue
        size = max(largest, strength)
        x, y, b = first[i] / size, second[i] / size, strength / size
        v1, v2, v12 = var1[i] / size / size, var2[i] / size / size, cov[i] / size / size
        rho = largest / size * math.hypot(first[i] / largest, second[i] / largest)
        psi = (math.atan2(y, x) - offset) % (2.0 * math.pi)
        chi = far_phase - psi
        cosine, sine, half = math.cos(chi), math.sin(chi), math.sin(0.5 * chi)
        # x - B S e^jkR is mu - nu S e^j chi as seen from x
        mu, nu = rho, b
        top = max(mu, nu)
        mu, nu = mu / top, nu / top
        whole = (mu - nu) * (mu - nu) + 4.0 * mu * nu * half * half
        real = mu * ((mu - nu) + 2.0 * nu * half * half)
        twist = mu * nu * sine
        quartic[0] = k * whole
        quartic[1] = 2.0 * k * whole * c1
        quartic[2] = k * (whole * c1 * c1 + 2.0 * real * c0)
        quartic[3] = 2.0 * c0 * (k * real * c1 + twist)
        quartic[4] = c0 * (k * mu * mu * c0 + twist * c1)
        count = real_roots(quartic, 0.0, distance, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = distance
        found = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left = _theta(low, psi, mu, nu, cosine, sine, p)
            right = _theta(high, psi, mu, nu, cosine, sine, p)
            below, above = min(left, right), max(left, right)
            first_turn = math.ceil(below / math.pi)
            last_turn = math.floor(above / math.pi)
            turn_count = int(last_turn - first_turn) + 1
            for step in range(turn_count):
                turn = first_turn + step if left < right else last_turn - step
                goal = turn * math.pi
                r = _solve_theta(low, high, goal, psi, mu, nu, cosine, sine, p)
                if not 0.0 < r < distance or (found > 0 and r <= roots[i, found - 1]):
                    continue
                if found == roots.shape[1]:
                    continue
                hidden = b * shadow(r, c0, c1)
                slope = b * shadow_slope(r, c0, c1)
                far = k * (distance - r)
                cs, sn = math.cos(k * r + offset), math.sin(k * r + offset)
                flux = x * cs + y * sn - hidden * math.cos(far)
                steep = -k * flux - slope * math.sin(far)
                spread = math.sqrt(max(sn * sn * v1 + cs * cs * v2 - 2.0 * sn * cs * v12, 0.0))
                sd = spread / abs(steep)
                lever = slope * math.cos(far) / steep
                g1, g2 = cs - lever * sn, sn + lever * cs
                flux_sd = math.sqrt(max(g1 * g1 * v1 + g2 * g2 * v2 + 2.0 * g1 * g2 * v12, 0.0))
                slack = band * flux_sd + 64.0 * EPSILON * (rho + b) * (1.0 + abs(lever))
                if turn % 2.0 != 0.0 and abs(flux) > slack:
                    continue  # a negative object beyond any noise
                close = False
                for side in range(2):
                    inner = (side == 0 and j > 0) or (side == 1 and j < count)
                    if inner:
                        at = low if side == 0 else high
                        gap = abs((left if side == 0 else right) - goal)
                        reach = gap * _distance_to(at, x, y, b, offset, far_phase, p)
                        if reach < band * spread:
                            close = True
                roots[i, found] = r
                sds[i, found] = sd
                near[i, found] = close
                seen = r + c1 >= -(band * sd + 1e-12 * r)
                physical[i, found] = seen
                found += 1
            if j < count:
                # whether noise reaches the fold between this piece and the next
                off = right / (2.0 * math.pi)
                gap = 2.0 * math.pi * abs(off - math.floor(off + 0.5))
                cs, sn = math.cos(k * high + offset), math.sin(k * high + offset)
                spread = math.sqrt(max(sn * sn * v1 + cs * cs * v2 - 2.0 * sn * cs * v12, 0.0))
                reach = gap * _distance_to(high, x, y, b, offset, far_phase, p)
                if reach < band * spread:
                    near_frame[i] = True


@compiled
def _distance_to(
    r: float, x: float, y: float, b: float, offset: float, far_phase: float, p: Array
) -> float:
    """Return abs(x - B S(r) e^jkR), which turns an angle into a reading."""
    hidden = b * shadow(r, p[1], p[2])
    angle = far_phase + offset
    return math.hypot(x - hidden * math.cos(angle), y - hidden * math.sin(angle))


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    assert known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    net = net_readings(sensor, known.crosstalk, task.frames)
    # lengths in a power of two near sqrt(c0'), so that nothing overflows
    c0 = known.get("background.shadow.c0")
    unit = 2.0 ** round(0.5 * math.log2(c0))
    distance = known.get("background.distance_m")
    k = sensor.wave_number * unit if isinstance(sensor, SineWaveSensor) else 0.0
    p = np.array([distance / unit, c0 / unit / unit, known.get("background.shadow.c1") / unit, k])
    strength = known.get("background.strength")
    n = net.first.size
    width = 3 if isinstance(sensor, PulsedSensor) else int(k * p[0] / math.pi) + 12
    step = max(_CHUNK // width, 1)
    parts = [
        _part(sensor, net, slice(i, i + step), strength, unit, p, width) for i in range(0, n, step)
    ]
    used = max(max(part[0].shape[1] for part in parts), 1)
    roots, sds, near, physical = (
        np.concatenate([_widened(part[j], used) for part in parts]) for j in (0, 1, 2, 4)
    )
    near_frame = np.concatenate([part[3] for part in parts])
    with np.errstate(all="ignore"):
        candidates = Candidates(roots * unit, sds * unit, near, near_frame)
    if isinstance(sensor, PulsedSensor):
        reason = np.full(n, _BEYOND)
        reason[net.first <= 0] = _CONTACT
        reason[net.second <= 0] = _DARK
    else:
        reason = np.where((net.first == 0) & (net.second == 0), _SILENT, _NO_RANGE)
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(
        physical if task.physical else None, support, reason.astype(np.uint8), _REASONS
    )
    return assemble("background_intensity", net.state, candidates, outcome)


def _part(
    sensor: PulsedSensor | SineWaveSensor,
    net: Net,
    rows: slice,
    strength: float,
    unit: float,
    p: Array,
    width: int,
) -> tuple[Array, Array, Flags, Flags, Flags]:
    n = net.first[rows].size
    roots, sds = np.full((n, width), np.nan), np.full((n, width), np.nan)
    near, physical = np.zeros((n, width), np.bool_), np.zeros((n, width), np.bool_)
    near_frame = np.zeros(n, np.bool_)
    readings = (net.first[rows], net.second[rows], net.var1[rows], net.var2[rows], net.cov[rows])
    out = (roots, sds, near, near_frame, physical)
    if isinstance(sensor, PulsedSensor):
        _pulsed(*readings, net.state[rows], strength, sensor.r0 / unit, p, NOISE_BAND, *out)
    else:
        phase = cycles_phase(sensor.frequency_hz, p[0] * unit)
        offset = sensor.phase_offset_rad
        _sine_wave(*readings, net.state[rows], strength, offset, phase, p, NOISE_BAND, *out)
    used = max(int(np.count_nonzero(np.isfinite(roots).any(axis=0))), 1)
    return roots[:, :used], sds[:, :used], near[:, :used], near_frame, physical[:, :used]


def _widened(array: NDArray[np.generic], width: int) -> NDArray[np.generic]:
    if array.shape[1] == width:
        return array
    fill = np.nan if array.dtype.kind == "f" else False
    wide = np.full((array.shape[0], width), fill, dtype=array.dtype)
    wide[:, : array.shape[1]] = array
    return wide


BACKGROUND_INTENSITY = Technique(
    name="background_intensity",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q",
    needs=(
        "background.strength",
        "background.distance_m",
        "background.shadow.c0",
        "background.shadow.c1",
    ),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=1.0,
    equations="4.76; for a sine wave errata section 5",
    roots="1 in (0, R) for c1' >= 0; sine wave: 1 if kR <= pi and c1' >= 0, else several",
    solve=_solve,
)
