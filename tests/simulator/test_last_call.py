"""What is asked for twice is found once, and laws that are not cut are what cut ones are."""

import math
import pickle

import numpy as np
import pytest

from simulator.last_call import LastCall
from simulator.parameters import Parameters, parameters_of
from simulator.priors import HalfNormal, LogNormal, Normal
from simulator.priors.distribution import Distribution
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor


def test_the_last_value_is_found_once() -> None:
    asked: list[np.ndarray] = []

    def twice(x: np.ndarray) -> np.ndarray:
        asked.append(x)
        return 2 * x

    last = LastCall[np.ndarray]()
    x = np.arange(6.0).reshape(3, 2)
    for _ in range(3):
        np.testing.assert_array_equal(last.of(twice, x.copy()), 2 * x)
    assert len(asked) == 1
    # another shape of the same bytes, another sign of zero, and what was changed in place
    other = x.copy()
    other[0, 0] = -0.0
    for each in (x.reshape(2, 3), other, x + 1):
        np.testing.assert_array_equal(last.of(twice, each), 2 * each)
    assert len(asked) == 4
    large = np.zeros((10_000, 1))
    last.of(twice, large)
    last.of(twice, large)
    assert len(asked) == 6
    again = pickle.loads(pickle.dumps(last))  # noqa: S301
    again.of(twice, x + 1)
    assert len(asked) == 7


def test_prior_and_terms_of_a_vector_are_computed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted: the prior of a truncated shape and its terms need the same values."""
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6] * 2}})
    rough = {"c1": {"prior": "normal", "mean": -0.5, "sd": 0.05}}
    parameters = parameters_of(sensor, parse_scene({"object": rough}))
    counted = [0]
    whole = Parameters._values_anew

    def counting(self: Parameters, z: np.ndarray) -> dict[str, np.ndarray]:
        counted[0] += 1
        return whole(self, z)

    monkeypatch.setattr(Parameters, "_values_anew", counting)
    z = np.array([[0.1, 0.2, -0.3], [0.0, 1.0, 0.5]])
    density = parameters.log_prior(z)
    terms = parameters.terms(z)
    assert counted == [1]
    monkeypatch.undo()
    fresh = parameters_of(sensor, parse_scene({"object": rough}))
    np.testing.assert_array_equal(fresh.terms(z).object, terms.object)
    np.testing.assert_array_equal(fresh.log_prior(z), density)


@pytest.mark.parametrize(
    "law",
    [
        Normal(mean=3.0, sd=0.2).distribution(),
        LogNormal(median=0.1, sigma=2.0).distribution(),
        HalfNormal(sd=0.5).distribution(),
        LogNormal(median=0.1, sigma=2.0).distribution().truncated(0.01, 3.0),
    ],
)
def test_a_whole_law_needs_no_masses_and_is_the_same_to_the_last_bit(law: Distribution) -> None:
    z = np.r_[-math.inf, -1e6, np.linspace(-40, 40, 801), 1e6, math.inf, math.nan]
    for low, high in ((-math.inf, math.inf), (0.0, math.inf), (0.05, 2.0)):
        with np.errstate(all="ignore"):
            expected = Distribution.from_normal(law, z, low, high)
        np.testing.assert_array_equal(law.from_normal(z, low, high), expected)
