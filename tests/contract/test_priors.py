"""What every prior of the registry owes: one law in all that it says, and no other as `range_m`."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from simulator.errors import InvalidInputError
from simulator.parameters import parameters_of
from simulator.priors import (
    PRIORS,
    Distribution,
    NormalDistribution,
    RangeForm,
    UniformDistribution,
)
from simulator.scene import parse_scene
from simulator.scene_checks import check_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.validated import Validated

Array = NDArray[np.float64]

# an example of any prior is made from the names of its numbers; one that is not here is 0.7
NUMBERS = {"low": 0.4, "high": 3.0, "mean": 1.1, "sd": 0.5, "median": 1.2, "sigma": 0.6}
SENSOR: Sensor = parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-5]}}
)
Z = np.linspace(-4.0, 4.0, 33)
# a derivative by differences of width h errs by h^2 and by eps / h: 1e-7 of the density at best,
# and the densities of the registry bend by a hundred times themselves at most over these z
DERIVATIVE = 1e-4


def example(kind: type) -> Any:
    fields = getattr(kind, "model_fields").keys() - {"prior"}  # noqa: B009
    return kind(**{name: NUMBERS.get(name, 0.7) for name in fields})


def check_maps(law: Distribution) -> None:
    """From the normal and back, increasing, within the support."""
    x = law.from_normal(Z)
    assert ((x > law.low) & (x < law.high)).all()
    assert (np.diff(x) > 0).all()
    # a quantile carries an eps, near an end of the support over the density there
    np.testing.assert_allclose(law.to_normal(x), Z, atol=1e-8)
    assert law.from_normal(np.array([-math.inf, math.inf])).tolist() == [law.low, law.high]


def check_density(law: Distribution) -> None:
    """The density is the derivative of the probability below, and that is what z says."""
    x = law.from_normal(Z)
    h = 1e-5 * np.minimum(x - law.low, np.minimum(law.high - x, 1.0))
    below = special.ndtr(law.to_normal(np.array([x - h, x + h])))
    above = special.ndtr(-law.to_normal(np.array([x - h, x + h])))
    # from the nearer tail, which keeps its digits
    slope = np.where(Z < 0, below[1] - below[0], above[0] - above[1]) / (2 * h)
    np.testing.assert_allclose(np.exp(law.log_density(x)), slope, rtol=DERIVATIVE)
    np.testing.assert_allclose(law.log_mass(high=x), special.log_ndtr(Z), rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(law.log_mass(low=x), special.log_ndtr(-Z), rtol=1e-7, atol=1e-12)
    outside = np.array([law.low - 1.0, law.high + 1.0])
    assert np.isneginf(law.log_density(outside[np.isfinite(outside)])).all()


def check_cut(law: Distribution) -> None:
    """Cut to a part and renormalised: as by a cut support, and as by bounds of each sample."""
    low, high = law.from_normal(np.array([-0.8, 1.3])).tolist()
    part = law.truncated(low, high)
    np.testing.assert_allclose(part.from_normal(Z), law.from_normal(Z, low, high), rtol=1e-12)
    x = part.from_normal(Z)
    np.testing.assert_allclose(
        part.log_density(x), law.log_density(x) - law.log_mass(low, high), rtol=1e-9, atol=1e-9
    )
    share = float(special.ndtr(1.3) - special.ndtr(-0.8))
    assert float(law.log_mass(low, high)) == pytest.approx(math.log(share), rel=1e-9)


def check_as_range(prior: Any) -> None:
    """Held as prior of the ranges, or refused by its name."""
    scene = parse_scene({"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}})
    scene = scene.model_copy(update={"range_m": prior})
    law = prior.distribution()
    if law.range_form is None:
        with pytest.raises(InvalidInputError) as caught:
            check_scene(SENSOR, scene)
        problems = caught.value.problems
        assert [problem.pointer for problem in problems] == ["/range_m/prior"]
        assert repr(prior.prior) in problems[0].message
        return
    row = parameters_of(SENSOR, scene).terms(np.zeros((1, 0))).ranges[0]
    part = law.truncated(0.0, SENSOR.max_range_m)
    assert row[6:].tolist() == [part.low, part.high]
    r = part.from_normal(Z)
    a0, a1, a2, a3, a4, a5 = row[:6]
    held = a0 + a1 * np.log(r) - ((r - a2) * a3) ** 2 / 2 - ((np.log(r) - a4) * a5) ** 2 / 2
    np.testing.assert_allclose(held, part.log_density(r), rtol=1e-10, atol=1e-10)


OF_A_LAW: tuple[Callable[[Distribution], None], ...] = (check_maps, check_density, check_cut)


@pytest.mark.parametrize("kind", PRIORS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("check", OF_A_LAW)
def test_a_prior_says_one_law(kind: type, check: Callable[[Distribution], None]) -> None:
    check(example(kind).distribution())


@pytest.mark.parametrize("kind", PRIORS, ids=lambda kind: kind.__name__)
def test_as_range_m_a_prior_is_held_or_refused_by_name(kind: type) -> None:
    check_as_range(example(kind))


@pytest.mark.parametrize("kind", PRIORS, ids=lambda kind: kind.__name__)
def test_a_prior_is_known_by_one_word_of_the_scene_language(kind: type) -> None:
    prior = example(kind)
    data = prior.model_dump()
    assert parse_scene({"object": {"c1": data}}).object.c1 == prior
    assert [example(other).prior for other in PRIORS].count(prior.prior) == 1


# what goes wrong is noticed


class Wrong(UniformDistribution):
    """A copy with one thing planted."""


class TwiceTheDensity(Wrong):
    def _log_density(self, position: Array, a: Array, b: Array) -> Array:
        return super()._log_density(position, a, b) + math.log(2)


class TwiceTheWidth(Wrong):
    def _position(self, z: Array, a: Array, b: Array) -> Array:
        return super()._position(z, a, a + (b - a) / 2)


class TwiceTheMass(Wrong):
    def _log_share(self, a: Array, b: Array) -> Array:
        return 2 * super()._log_share(a, b)


@pytest.mark.parametrize(
    ("kind", "check"),
    [(TwiceTheDensity, check_density), (TwiceTheWidth, check_maps), (TwiceTheMass, check_density)],
)
def test_a_factor_of_two_fails(
    kind: type[UniformDistribution], check: Callable[[Distribution], None]
) -> None:
    right = UniformDistribution(log=False, low=0.4, high=3.0)
    check(right)
    wrong = kind(log=False, low=0.4, high=3.0)
    with pytest.raises(AssertionError):
        check(wrong)


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Squared(UniformDistribution):
    """Density in proportion to x on [0, high]: the square root of a uniform; a new form of law."""

    form: RangeForm | None = None

    def _log_share(self, a: Array, b: Array) -> Array:
        return np.asarray(np.log(b * b - a * a))

    def _position(self, z: Array, a: Array, b: Array) -> Array:
        return np.sqrt(a * a + (b * b - a * a) * special.ndtr(z))

    def _variate(self, position: Array, a: Array, b: Array) -> Array:
        return np.asarray(special.ndtri((position**2 - a * a) / (b * b - a * a)))

    def _log_density(self, position: Array, a: Array, b: Array) -> Array:
        return np.asarray(np.log(2 * position / (b * b - a * a)))

    @property
    def range_form(self) -> RangeForm | None:  # type: ignore[override]
        return self.form


class Linear(Validated):
    prior: Literal["linear"] = "linear"
    form: Any = None

    def distribution(self) -> Squared:
        return Squared(log=False, low=0.4, high=3.0, form=self.form)


@pytest.mark.parametrize("check", OF_A_LAW)
def test_a_new_prior_passes(check: Callable[[Distribution], None]) -> None:
    check(Linear().distribution())


def test_a_new_prior_is_refused_as_range_m_and_never_taken_for_another() -> None:
    check_as_range(Linear())
    for form in (RangeForm(0.0), RangeForm(-1.0), RangeForm(0.0, mean=1.0, inverse_sd=2.0)):
        with pytest.raises(AssertionError):
            check_as_range(Linear(form=form))


def test_a_range_form_with_a_factor_of_two_fails() -> None:
    class Doubled(NormalDistribution):
        @property
        def range_form(self) -> RangeForm:
            return RangeForm(0.0, mean=self.loc, inverse_sd=2.0 / self.scale)

    class Planted(Validated):
        prior: Literal["normal"] = "normal"

        def distribution(self) -> Doubled:
            return Doubled(log=False, loc=1.0, scale=0.5, low=-math.inf, high=math.inf)

    with pytest.raises(AssertionError):
        check_as_range(Planted())
