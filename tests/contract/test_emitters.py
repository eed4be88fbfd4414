"""What every emitter pattern of the registry owes: all of its light, and none behind it."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate

from simulator.optics.emitters import PATTERNS, CosinePower, Narrow, Pattern, radiant_intensity
from simulator.optics.emitters.form import PatternForm
from simulator.optics.emitters.intensity import intensity

Array = NDArray[np.float64]

# more than one example of a form, where its numbers matter; others are made of their defaults
EXAMPLES: dict[str, list[dict[str, Any]]] = {
    "cosine_power": [{"exponent": n} for n in (0.0, 1.0, 2.5, 80.0)],
    "raised_cosine": [{"cut_off_rad": a} for a in (0.05, 1.0, math.pi / 2)],
    "table": [
        {"angle_rad": (0.0, 0.4, 0.9, 1.3), "relative_intensity": (3.0, 4.0, 1.0, 0.0)},
        {"angle_rad": (0.2, 0.5), "relative_intensity": (1.0, 2.0)},
    ],
}
NO_INTENSITY = (Narrow,)  # a single ray: packing is refused


def examples() -> list[PatternForm]:
    found = []
    for form in PATTERNS:
        word = form.model_fields["kind"].default
        found += [form(**numbers) for numbers in EXAMPLES.get(word, [{}])]
    return [pattern for pattern in found if not isinstance(pattern, NO_INTENSITY)]


def check_light(pattern: Any) -> None:
    """2 pi int I_e sin(alpha) d alpha = 1 (2.11), and no direction takes light away."""
    _, table = pattern.pack()
    breaks = [a for a in table[0] if 0 < a < math.pi / 2]
    cut = getattr(pattern, "cut_off_rad", None)
    breaks += [] if cut is None or cut == math.pi / 2 else [cut]
    ends = [0.0, *sorted(breaks), math.pi / 2]
    total = sum(
        integrate.quad(lambda a: float(_at(pattern, a)) * math.sin(a), low, high, epsabs=1e-13)[0]
        for low, high in itertools.pairwise(ends)
    )
    assert 2 * math.pi * total == pytest.approx(1.0, abs=1e-10)  # quadrature's own error: 1e-12
    assert (_at(pattern, np.linspace(0.0, 1.5, 200)) >= 0.0).all()


def _at(pattern: Any, angle: Array | float) -> Array:
    packed, table = pattern.pack()
    flat = np.atleast_1d(angle)
    values = [intensity(packed, 0, table, math.cos(a), math.sin(a)) for a in flat.tolist()]
    return np.array(values) if np.ndim(angle) else np.asarray(values[0])


@pytest.mark.parametrize("pattern", examples(), ids=repr)
def test_an_emitter_sends_all_of_its_light_forward(pattern: Pattern) -> None:
    check_light(pattern)
    packed, table = pattern.pack()
    assert intensity(packed, 0, table, -0.5, math.sqrt(0.75)) == 0.0
    angle = np.linspace(0.0, 1.5, 7)
    assert np.array_equal(radiant_intensity(pattern, angle), _at(pattern, angle))


@pytest.mark.parametrize("form", PATTERNS, ids=lambda form: form.__name__)
def test_a_form_has_a_kernel_or_is_refused(form: type[PatternForm]) -> None:
    numbers = EXAMPLES.get(form.model_fields["kind"].default, [{}])[0]
    pattern = form(**numbers)
    if isinstance(pattern, NO_INTENSITY):
        with pytest.raises(ValueError, match="no radiant intensity"):
            pattern.pack()
    else:
        assert math.isfinite(_at(pattern, 0.3))


def test_codes_tell_forms_apart() -> None:
    codes = {type(pattern): float(pattern.pack()[0][0]) for pattern in examples()}
    assert len(set(codes.values())) == len(codes) == len(PATTERNS) - len(NO_INTENSITY)


def test_a_code_that_no_kernel_has_is_not_taken_for_another() -> None:
    pattern = np.array([99.0, 1.0, 1.0, math.pi / 2])
    assert math.isnan(intensity(pattern, 0, np.zeros((3, 2)), 0.5, math.sqrt(0.75)))


class Doubled(CosinePower):
    """A copy with a factor of two planted."""

    def pack(self) -> tuple[Array, Array]:
        packed, table = super().pack()
        packed[2] *= 2.0
        return packed, table


class Squared(CosinePower):
    """A copy whose exponent is twice what its normalisation is for."""

    def pack(self) -> tuple[Array, Array]:
        packed, table = super().pack()
        packed[1] *= 2.0
        return packed, table


@pytest.mark.parametrize("form", [Doubled, Squared])
def test_a_factor_of_two_fails(form: type[CosinePower]) -> None:
    check_light(CosinePower(exponent=2.0))
    with pytest.raises(AssertionError):
        check_light(form(exponent=2.0))
