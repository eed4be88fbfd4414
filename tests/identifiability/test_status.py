"""One definition of identified, for draws, plans and fits."""

import math

import numpy as np
import pytest
from scipy import integrate

from inference.identifiability import status
from inference.identifiability.before_data import identifiability
from inference.identifiability.status import contraction_of, spread_of_fit, status_of
from simulator.parameters import Parameters, parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import sensor_of

SENSOR = sensor_of("pulsed")
NORMAL = {"prior": "normal", "mean": 2e-3, "sd": 1e-3}


def parameters(**scene: object) -> Parameters:
    known = {"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}}
    return parameters_of(SENSOR, parse_scene({**known, **scene}))


def test_the_documentation_states_the_limits() -> None:
    text = str(status.__doc__)
    assert f"spread below {status.NARROW_SPREAD:g}" in text
    assert f"spread {status.WIDE_SPREAD:g} or more" in text
    assert f"identified below {status.NARROW_SCALE:g}" in text
    assert f"from {status.WIDE_SCALE:g} on" in text


@pytest.mark.parametrize(
    ("name", "limits"),
    [("object.c0", (status.NARROW_SPREAD, status.WIDE_SPREAD)), ("range_m", (0.05, 0.3))],
)
def test_a_limit_itself_is_the_worse_of_the_two(name: str, limits: tuple[float, float]) -> None:
    assert status_of(name, math.nextafter(limits[0], 0)) == "identified"
    assert status_of(name, limits[0]) == "weak"
    assert status_of(name, math.nextafter(limits[1], 0)) == "weak"
    assert status_of(name, limits[1]) == "not_identified"
    assert status_of(name, math.nan) == "not_identified"


def test_contraction_is_the_share_of_the_variance_that_is_gone() -> None:
    assert contraction_of(0.5) == 0.75
    assert contraction_of(math.inf) == contraction_of(math.nan) == 0.0


@pytest.mark.parametrize("sd", [0.05, 0.3, 1.0, 4.0])
def test_of_normal_laws_the_spread_is_known(sd: float) -> None:
    """Prior and fit are normal: precisions add, wherever the fit lies."""
    p = parameters(crosstalk=[NORMAL, 0.0], object={"c0": 0.1, "c1": 0.0})
    expected = sd / math.hypot(1.0, sd)
    # the trapezoid rule on nodes a fifth of a deviation apart errs by exp(-2 pi^2 25) of itself,
    # and what lies beyond the last node by exp(-6^2 / 2)
    for value in (2e-3, 3.5e-3):
        found = spread_of_fit(p, "crosstalk.w1", {"crosstalk.w1": value}, sd * 1e-3)
        assert found == pytest.approx(expected, rel=1e-6)
    # c2 is log-normal with sigma 1 by default: what counts is the relative error
    found = spread_of_fit(p, "object.c2", {"object.c2": 0.07}, sd * 0.07)
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("value", [0.5, 0.99, 1.0, 1.05])
@pytest.mark.parametrize("sd", [0.02, 0.3])
def test_near_the_ends_of_a_support_and_beyond_it(value: float, sd: float) -> None:
    """Against integrals in the crosstalk itself."""
    p = parameters(crosstalk=[{"prior": "uniform", "low": -1.0, "high": 1.0}, 0.0])
    law = p.unknowns[0]

    def moment(k: int) -> float:
        def part(x: float) -> float:
            z = float(law.to_normal(np.array([x]), {})[0])
            return (
                float(z**k * math.exp(-0.5 * ((x - value) / sd) ** 2))
                if k
                else math.exp(-0.5 * ((x - value) / sd) ** 2)
            )

        low = max(-1.0 + 1e-12, value - 12 * sd)
        cut = [x for x in (value, 1.0 - 1e-3, 1.0 - 1e-6, 1.0 - 1e-9) if low < x < 1.0 - 1e-12]
        return float(integrate.quad(part, low, 1.0 - 1e-12, points=cut, limit=400)[0])

    whole, mean, square = (moment(k) for k in range(3))
    expected = math.sqrt(square / whole - (mean / whole) ** 2)
    found = spread_of_fit(p, "crosstalk.w1", {"crosstalk.w1": value}, sd)
    # the reference leaves out 1e-12 at the end, where z is 7
    assert found == pytest.approx(expected, rel=1e-4)


def test_what_is_no_number_leaves_the_prior_and_what_is_narrower_than_any_node_is_known() -> None:
    p = parameters(object={})
    assert spread_of_fit(p, "object.c0", {"object.c0": math.nan}, 1.0) == 1.0
    assert spread_of_fit(p, "object.c0", {"object.c0": 0.1}, math.inf) == 1.0
    assert spread_of_fit(p, "object.c0", {"object.c0": -0.1}, 0.1) == 1.0
    for sd in (1e-6, 1e-300):
        assert spread_of_fit(p, "object.c0", {"object.c0": 0.123}, sd) < 0.01
    with pytest.raises(ValueError, match="not in"):
        spread_of_fit(p, "crosstalk.w1", {"crosstalk.w1": 0.0}, 1.0)


def test_a_prior_is_taken_at_the_fit_s_values_of_others() -> None:
    """By default c1 is 2 sqrt(c0) (exp(0.4 z) - 1): four times the c0, half the spread."""
    p = parameters(object={})
    narrow = [
        spread_of_fit(p, "object.c1", {"object.c0": c0, "object.c1": 0.0}, 1e-2)
        for c0 in (0.1, 0.4)
    ]
    assert narrow[0] == pytest.approx(2 * narrow[1], rel=1e-3)
    slope = 2 * math.sqrt(0.1) * 0.4
    assert narrow[0] == pytest.approx(1e-2 / math.hypot(slope, 1e-2), rel=1e-2)


def test_a_fit_and_a_plan_agree() -> None:
    """Of one unknown: the bound that a fit reaches, times the prior, is the spread foreseen."""
    shape, ranges = {"c0": 0.1, "c1": 0.0}, {"prior": "loguniform", "low": 1e-3, "high": 10.0}
    foresight = identifiability(
        sensor_of("pulsed", 8.0), parse_scene({"object": shape, "range_m": ranges}), [0.5, 0.7]
    )
    values, sd = foresight.reference, foresight.sd["object.c2"]
    found = spread_of_fit(foresight.experiment.parameters, "object.c2", values, sd)
    assert 0.2 < found < 0.9
    # the plan also knows that all ranges lie within nine e-folds: (1 / 2.6)^2 of information, at
    # most, beside that of the prior
    assert found == pytest.approx(foresight.posterior.sd[0], rel=0.5 / 2.6**2)
