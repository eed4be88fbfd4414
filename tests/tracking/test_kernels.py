"""The parts of the filter against linear algebra and quadrature."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import integrate, linalg

from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import Hypotheses, scratch_for
from inference.tracking.merging import merge, merge_equals
from inference.tracking.motion import Motion, motion_over, presence_over
from inference.tracking.outliers import log_outlier
from inference.tracking.places import mass_bound
from inference.tracking.readings_table import mean_at
from inference.tracking.roots import Root, add_factor, add_factors
from inference.tracking.settings import Observables, TrackingSettings
from inference.tracking.square_root import Linear, move, update
from inference.tracking.tracker import tracker
from simulator.parameters import parameters_of
from simulator.simulate import mean_readings
from tests.tracking.scenes import FOLDED, scene_of, sensor_of

finite = st.floats(-1e6, 1e6)


@settings(deadline=None)  # the first call compiles
@given(st.tuples(finite, finite, finite), finite, finite)
@example((0.0, 0.0, 0.0), 1.7e-156, 1.0)  # whose square has lost most of its digits
@example((2e-313, 0.0, 0.0), 2e-313, 1.0)  # which itself has
def test_add_factor_is_a_root_of_the_sum(
    root: tuple[float, float, float], first: float, second: float
) -> None:
    lower = np.array([[root[0], 0.0], [root[1], root[2]]])
    vector = np.array([first, second])
    new = add_factor(Root(*root), first, second)
    made = np.array([[new.r11, 0.0], [new.r21, new.r22]])
    wanted = lower @ lower.T + np.outer(vector, vector)
    # rounding of squares: relative to the largest of them
    assert np.abs(made @ made.T - wanted).max() <= 1e-14 * max(wanted.max(), 1e-300)


@settings(deadline=None)  # the first call compiles
@given(
    st.tuples(finite, finite, finite),
    st.lists(st.tuples(finite, finite), max_size=6),
    st.integers(0, 2),
)
@example((0.0, 0.0, 0.0), [(1e-160, 1.0), (0.0, 1e-160)], 0)  # no square of the first row is left
@example((1.0, 0.0, 1.0), [(1e6, 1e6), (1e6, -1e6)], 0)
@example((1.0, 0.0, 1.0), [(1e6, 1e6), (1e6, 1e6)], 0)  # of which one row is the other, nearly
def test_add_factors_is_the_root_that_rotations_give(
    root: tuple[float, float, float], columns: list[tuple[float, float]], first: int
) -> None:
    factors = np.array(columns).reshape(-1, 2).T.copy()
    first = min(first, len(columns))
    new = add_factors(Root(*root), factors, first)
    one = Root(*root)
    for a, b in columns[first:]:
        one = add_factor(one, a, b)
    # the sign of a row is free where nothing is added
    made, wanted = (
        np.array([[r.r11, 0.0], [r.r21, r.r22]]) @ np.array([[r.r11, r.r21], [0.0, r.r22]])
        for r in (new, one)
    )
    assert np.abs(made - wanted).max() <= 1e-14 * max(wanted.max(), 1e-280)
    if abs(one.r11) > 1e-140:
        # what of the second row is no multiple of the first: to rounding of the row
        size = math.hypot(*root[1:], *factors[1, first:])
        assert abs(abs(new.r22) - abs(one.r22)) <= 1e-14 * max(size, 1e-140)


@pytest.mark.parametrize("x", [1e-9, 1e-3, 0.099, 0.101, 1.0, 5.0])
def test_motion_is_that_of_an_integrated_ornstein_uhlenbeck_process(x: float) -> None:
    """Van Loan's matrix exponential; the short steps lose digits there, not here."""
    sd, time = 0.7, 2.0
    seconds = x * time
    rules = tracker(sensor_of(1e-4), scene_of(FOLDED)).model.rules
    motion = motion_over(seconds, rules._replace(rate_sd=sd, rate_time=time))
    a, b, c = motion.noise
    drift = np.array([[0.0, 1.0], [0.0, -1.0 / time]])
    noise = np.diag([0.0, 2.0 * sd * sd / time])
    block = linalg.expm(np.block([[-drift, noise], [np.zeros((2, 2)), drift.T]]) * seconds)
    step = block[2:, 2:].T
    made = np.array([[a * a, a * b], [a * b, b * b + c * c]])
    wanted = step @ block[:2, 2:]
    assert motion.carry == pytest.approx(step[0, 1], rel=1e-12)
    assert motion.decay == pytest.approx(step[1, 1], rel=1e-12)
    if x > 1e-3:
        assert made == pytest.approx(wanted, rel=1e-9)
    else:
        leading = 2.0 * sd * sd * seconds**3 / (3.0 * time)
        assert made[0, 0] == pytest.approx(leading, rel=x)
        assert made[1, 1] == pytest.approx(2.0 * sd * sd * seconds / time, rel=2 * x)


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-9, 1e3), st.floats(1e-6, 1e3), st.floats(1e-6, 1e3))
def test_presence_is_a_markov_chain(seconds: float, leave: float, arrive: float) -> None:
    chance = presence_over(seconds, leave, arrive)
    step = linalg.expm(np.array([[-arrive, arrive], [leave, -leave]]) * seconds)
    assert chance.arrived == pytest.approx(step[0, 1], rel=1e-9, abs=1e-12)
    assert chance.left == pytest.approx(step[1, 0], rel=1e-9, abs=1e-12)
    assert chance.left + chance.stayed + chance.replaced == pytest.approx(1.0, abs=1e-14)
    assert chance.stayed == pytest.approx(math.exp(-leave * seconds), rel=1e-9, abs=1e-15)


def _random(rng: np.random.Generator, n: int, p: int, rows: int = 4) -> Hypotheses:
    x = rng.standard_normal((rows, n))
    X = rng.standard_normal((rows, n, n + p))
    for row in X:
        row[:, :n] = np.tril(row[:, :n])
    return Hypotheses(x, X, np.zeros(rows), np.zeros(4))


@pytest.mark.parametrize(
    ("n", "p", "taught"), [(2, 0, 2), (4, 0, 4), (2, 3, 2), (4, 3, 4), (4, 0, 2), (4, 3, 2)]
)
def test_steps_are_those_of_a_filter_that_considers_the_nuisance(
    n: int, p: int, taught: int
) -> None:
    rng = np.random.default_rng(n + p)
    of = _random(rng, n, p)
    x, X, scratch = of.x, of.X, scratch_for(of)
    mean, root = x[1].copy(), X[1].copy()
    # time
    motion = Motion(0.3, 0.8, Root(0.2, 0.1, 0.4), 0.05, 0.07)
    move(of, 1, motion, scratch.work)
    F = np.eye(n)
    F[0, 1], F[1, 1] = motion.carry, motion.decay
    a, b, c = motion.noise
    lower = np.array([[a, 0.0], [b, c]])
    Q = linalg.block_diag(lower @ lower.T, np.diag(np.square([motion.drift1, motion.drift2])))[
        :n, :n
    ]
    P = F @ root @ root.T @ F.T + Q
    cross = F @ root[:, n:]
    mean = F @ mean
    assert x[1] == pytest.approx(mean, abs=1e-13)
    assert X[1] @ X[1].T == pytest.approx(P, abs=1e-13)
    assert X[1][:, n:] == pytest.approx(cross, abs=1e-13)
    assert np.all(np.triu(X[1][:, :n], 1) == 0.0)
    # a frame: with the nuisance parameters as further states whose rows of the gain are left out
    scratch.nuisance[:] = rng.standard_normal((2, p))
    readings = Linear(0.7, -1.1, 1.3, -0.4, 0.2, 0.9, Root(0.6, 0.2, 0.5))
    H = np.zeros((2, n))
    H[:, 0], H[:, 1] = (1.3, -0.4), (0.2, 0.9)
    H[:, 2:] = np.eye(2)[:, : n - 2]
    lower = np.array([[0.6, 0.0], [0.2, 0.5]])
    both = np.hstack([H, scratch.nuisance])
    joint = np.block([[P, cross], [cross.T, np.eye(p)]])
    S = both @ joint @ both.T + lower @ lower.T
    residual = np.array([0.7, -1.1])
    gain = (joint @ both.T @ linalg.inv(S))[:n]
    gain[taught:] = 0.0  # considered, too
    surprise = update(of, 1, readings, scratch, taught)
    assert surprise == pytest.approx(residual @ linalg.solve(S, residual), rel=1e-12)
    assert x[1] == pytest.approx(mean + gain @ residual, abs=1e-12)
    whole = np.vstack([gain, np.zeros((p, 2))])
    rest = np.eye(n + p) - whole @ both
    posterior = rest @ joint @ rest.T + whole @ lower @ lower.T @ whole.T
    assert X[1] @ X[1].T == pytest.approx(posterior[:n, :n], abs=1e-12)
    assert X[1][:, n:] == pytest.approx(posterior[:n, n:], abs=1e-12)


@pytest.mark.parametrize(("n", "p"), [(2, 0), (4, 2)])
def test_a_merger_keeps_mean_and_covariance(n: int, p: int) -> None:
    rng = np.random.default_rng(3)
    of = _random(rng, n, p)
    x, X = of.x, of.X
    share = 0.3
    mean = 0.7 * x[1] + 0.3 * x[2]
    cross = 0.7 * X[1][:, n:] + 0.3 * X[2][:, n:]
    gap = x[2] - x[1]
    wanted = 0.7 * X[1] @ X[1].T + 0.3 * X[2] @ X[2].T + 0.21 * np.outer(gap, gap)
    merge(of, 1, 2, share, 0, scratch_for(of).work)
    assert x[1] == pytest.approx(mean, abs=1e-13)
    assert X[1] @ X[1].T == pytest.approx(wanted, abs=1e-13)
    assert X[1][:, n:] == pytest.approx(cross, abs=1e-13)


def test_equals_merge_and_others_do_not() -> None:
    x = np.array([[0.0, 0.0], [1.0, 0.0], [1.01, 0.0], [2.0, 0.0], [0.99, 0.0]])
    X = np.repeat(np.diag([0.1, 0.1])[None], 5, axis=0)
    weight = np.array([0.0, 0.5, 0.2, 1e-3, 0.299])
    of = Hypotheses(x, X, weight, np.zeros(4))
    left = merge_equals(of, 4, 0.05, scratch_for(of).work)
    assert left == 2
    assert weight[1:3] == pytest.approx([0.999, 1e-3])
    assert x[2, 0] == 2.0


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_the_table_holds_the_curve_within_its_noise(kind: str) -> None:
    sensor, scene = sensor_of(1e-7, kind), scene_of(FOLDED)
    table = tracker(sensor, scene).model.table
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    u = np.linspace(table.start, table.end, 4321)
    exact = mean_readings(sensor, terms, np.exp(u)) / 1e-7
    made = np.array([mean_at(at, table) for at in u])
    assert np.abs(made[:, :2] - exact).max() < 0.02
    slope = np.gradient(exact, u, axis=0)[1:-1]
    assert made[1:-1, 2:] == pytest.approx(slope, abs=1e-2 * np.abs(slope).max())


@pytest.mark.parametrize("read", [1e-5, 1e-4, 1e-2])
@pytest.mark.parametrize("gain", [1.0, 3.0])
def test_the_mass_of_a_new_object_is_bounded(read: float, gain: float) -> None:
    """Readings on the curve and off it: the bound is above the integral, and not far above it."""
    rng = np.random.default_rng(8)
    sensor, scene = sensor_of(read), scene_of(FOLDED)
    model = tracker(sensor, scene).model
    # 30 points a standard deviation also where the curve is fastest
    grid = np.linspace(model.table.start, model.table.end, 2_000_001)
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    table = gain * mean_readings(sensor, terms, np.exp(grid)) / read
    for _ in range(8):
        at = table[rng.integers(len(table))] + rng.standard_normal(2) * rng.choice([1, 10])
        density = np.exp(-0.5 * ((table - at) ** 2).sum(axis=1))
        exact = integrate.trapezoid(density, grid) / (grid[-1] - grid[0])
        bound = mass_bound(TrackedFrame(at[0], at[1], gain), 2, model.table, model.places)
        assert bound >= exact * (1 - 1e-6)
        if exact > 1e-6:
            assert bound < 100 * exact


@pytest.mark.parametrize("gain", [1.0, 3.0])
@pytest.mark.parametrize("discrepancy", [1e-3, "default"])
def test_the_mass_of_a_new_object_is_bounded_where_the_model_errs(
    gain: float, discrepancy: float | str
) -> None:
    """The same with errors of the model, which widen the density and lower its top.

    A bound of 1, which no density exceeds, had every frame look along the whole curve: 33
    microseconds a frame instead of 4.5.
    """
    rng = np.random.default_rng(8)
    model = tracker(sensor_of(1e-4), scene_of(FOLDED, discrepancy=discrepancy)).model
    table = model.table
    grid = np.linspace(table.start, table.end, 400_001)
    knots = np.linspace(table.start, table.end, len(table.knots))
    scene = scene_of(FOLDED)
    terms = parameters_of(sensor_of(1e-4), scene).terms(np.zeros((1, 0)))
    means = gain * mean_readings(sensor_of(1e-4), terms, np.exp(grid)) / 1e-4
    r11, r21, r22 = (gain * np.interp(grid, knots, table.knots[:, 9 + k]) for k in range(3))
    c11, c12, c22 = 1.0 + r11**2, r11 * r21, 1.0 + r21**2 + r22**2
    determinant = 1.0 + r11**2 + r21**2 + r22**2 + (r11 * r22) ** 2
    assert determinant.max() > 2.0
    for _ in range(12):
        at = means[rng.integers(len(means))] + rng.standard_normal(2) * rng.choice([1, 10])
        e1, e2 = (at - means).T
        square = (c22 * e1**2 - 2.0 * c12 * e1 * e2 + c11 * e2**2) / determinant
        density = np.exp(-0.5 * square) / np.sqrt(determinant)
        exact = integrate.trapezoid(density, grid) / (grid[-1] - grid[0])
        bound = mass_bound(TrackedFrame(at[0], at[1], gain), 2, table, model.places)
        assert bound >= exact * (1 - 1e-6)
        if exact > 1e-6:
            # boxes know no least speed where the density is wider than they are
            assert bound < 1000 * exact


@pytest.mark.parametrize("spread", [1.0, 3e6])
@pytest.mark.parametrize(("observables", "channels"), [("readings", 2), ("w2", 1)])
def test_readings_that_have_nothing_to_do_with_the_scene_have_a_law(
    observables: Observables, channels: int, spread: float
) -> None:
    """A density, and its probabilities sum to one: else outliers weigh more or less than stated."""
    settings = TrackingSettings(observables=observables)
    model = tracker(sensor_of(1e-4), scene_of(FOLDED), settings).model
    assert model.table.channels == channels
    breadth = max(model.rules.breadth, float(spread ** (1 / channels)))

    def density(away: float, angle: float = 0.3) -> float:
        first, second = math.cos(angle) * away, math.sin(angle) * away
        frame = TrackedFrame(2.0 + first, -3.0 + second, 1.0)
        if channels == 1:
            frame = TrackedFrame(2.0 + away, -3.0, 1.0)
        log = log_outlier(frame, (2.0, -3.0, spread), model.table, model.rules)
        return math.exp(log - 0.5 * channels * math.log(2 * math.pi))

    assert density(1.7 * breadth, 2.0) == pytest.approx(density(1.7 * breadth))

    def within(share: float) -> float:
        """Of all readings as far away as tan(share), times the breadth, or on a circle of it."""
        away, stretch = breadth * math.tan(share), breadth / math.cos(share) ** 2
        return density(away) * stretch * (2.0 if channels == 1 else 2 * math.pi * away)

    assert integrate.quad(within, 0.0, 0.5 * math.pi, limit=10)[0] == pytest.approx(1.0, rel=1e-6)
