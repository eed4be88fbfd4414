"""The study of flat walls: its light is that of closed forms, its fits find what made it."""

import numpy as np
import pytest

from benchmarks.flat_wall import fitted_object, fitted_shadow, moments_of, read_of, wrong_of


@pytest.mark.parametrize("power", [0, 1, 3])
def test_the_light_of_a_disk_is_its_closed_form(power: int) -> None:
    # docs/model.md, 3.4; 48 nodes of Gauss are exact to roundings for these powers
    z, radius = np.array([0.2, 1.0]), 0.4
    c = z / np.hypot(z, radius)
    paths, light = moments_of(z, radius, power)
    readings, distance = read_of({"kind": "pulsed", "pulse_width_s": 1e-7}, paths, light)
    flux = (power + 1) / (np.pi * (power + 5) * z**2) * (1 - c ** (power + 5))
    np.testing.assert_allclose(readings[:, 1], flux, rtol=1e-12)
    mean = (power + 5) / (power + 4) * z * (1 - c ** (power + 4)) / (1 - c ** (power + 5))
    np.testing.assert_allclose(distance, mean, rtol=1e-12)


def test_fits_find_an_object_and_a_shadow_of_the_model() -> None:
    r = np.geomspace(0.2, 2.0, 40)
    found = fitted_object(r, 0.02 * 0.1 / (r**2 * (r**2 - 0.05 * r + 0.02)))
    # a least-squares fit of exact data ends within its own tolerance of 1e-8, squared sums
    assert list(found.values()) == pytest.approx([0.02, -0.05, 0.1], rel=1e-3)
    shadow, error = fitted_shadow(r, (r**2 + 0.1 * r) / (r**2 + 0.1 * r + 0.03), 0.2)
    assert (shadow["c0"], shadow["c1"]) == pytest.approx((0.03, 0.1), rel=1e-3)
    assert error < 1e-4


def test_the_shadow_on_a_flat_wall_is_what_is_missing() -> None:
    share, _, error = wrong_of(1, True)
    assert 0.0 <= share <= 1.0
    assert error > 1e-3  # no rational law of two numbers is a power of z / hypot(z, a)
    assert wrong_of(1, False)[0] == 0.0
