"""The study of flat walls: its light is that of closed forms, its fits find what made it."""

import numpy as np
import pytest

from benchmarks.flat_wall import (
    fitted_object,
    fitted_shadow,
    moments_of,
    read_of,
    rms,
    shadow_errors,
    single_frames,
    wrong_of,
)
from simulator.shadow_error import SHADOW_SD


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


def test_the_law_of_a_shadow_is_as_large_as_what_the_best_shadow_leaves() -> None:
    """Within a factor of what 60 courses leave: 12 of them say it to a few percent."""
    pairs = [pair for number in range(24) if (pair := shadow_errors(number)) is not None]
    assert len(pairs) > 8
    for errors in zip(*pairs, strict=True):
        assert rms(np.concatenate(errors)) == pytest.approx(SHADOW_SD, rel=0.25)


def test_tracks_and_frames_before_a_flat_wall_are_sure_and_wrong_only_without_that_law() -> None:
    """Errors are the courses' own, so that nothing is left to chance but the noise: 2 % of a sd."""
    wrong = [13, 20, 28]
    assert all(wrong_of(number, True, 0.02)[0] > 0.01 for number in wrong)
    assert all(wrong_of(number, True)[0] == 0.0 for number in wrong)
    for technique in ("background_intensity", "background_cancelling"):
        assert single_frames(13, technique, 0.02)[:, 0].max() > 5.0
        assert single_frames(13, technique)[:, 0].max() < 3.0
