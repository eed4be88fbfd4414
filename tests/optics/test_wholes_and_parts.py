"""Sums over lights, faces of glass, facets and photons against what they must come to."""

import math

import numpy as np
import pytest

from simulator.catalogue import plate_scene
from simulator.errors import InvalidInputError
from simulator.optics import appendix_b
from simulator.optics.assembly import OpticalScene, illuminate
from simulator.optics.brdf import fresnel_dielectric
from simulator.optics.crosstalk import CoverGlass, glass_crosstalk
from simulator.optics.electronics import draw_noise
from simulator.optics.light import Light, add
from simulator.optics.surfaces import Rectangle
from simulator.optics.vectors import Pose
from simulator.sensor import Noise, PulsedSensor


def test_the_distance_of_a_sum_is_the_mean_by_flux() -> None:
    near, far = (
        Light(flux, r, flux * r, flux + 0j, 0.1 * r, "lit") for flux, r in ((3, 1), (1, 5))
    )
    both = add([near, far])
    assert (both.flux, both.distance_m, both.late, both.phasor) == (4.0, 2.0, 8.0, 4.0 + 0j)
    assert both.error == pytest.approx((3 * 0.1 + 1 * 0.5) / 4)


@pytest.mark.parametrize("thickness", [1e-3, 8e-3])
def test_light_in_glass_is_later_by_its_index(thickness: float) -> None:
    """On the axis: pass j appears at h + j d / n by its spread, and at h + j d n by its time."""
    index, h = 1.5, 2e-3
    f = fresnel_dielectric(1.0, index)
    j = np.arange(8)
    strength = np.where(j == 0, f, (1 - f) ** 2 * f ** (2.0 * j - 1))
    flux = strength / (2.0 * (h + j * thickness / index)) ** 2
    found = glass_crosstalk(CoverGlass(distance_m=h, thickness_m=thickness, refractive_index=index))
    assert found.flux == pytest.approx(flux.sum() / (2 * math.pi), rel=1e-12)
    late = h + j * thickness * index
    assert found.distance_m == pytest.approx(flux @ late / flux.sum(), rel=1e-12)


@pytest.mark.parametrize("turned", [False, True])
def test_a_long_plate_hides_along_its_length_only(turned: bool) -> None:
    size = (0.1, 0.5) if turned else (0.5, 0.1)
    front = Rectangle(width_m=size[0], height_m=size[1], pose=Pose(position_m=(0, 0, 0.5)))
    # twice as far: what is 0.4 m beside the axis is seen past 0.2 m of the front
    beside, above = (
        Rectangle(width_m=0.05, height_m=0.05, pose=Pose(position_m=(*at, 1.0)))
        for at in ((0.4, 0.0), (0.0, 0.4))
    )
    hidden, free = (above, beside) if turned else (beside, above)
    with pytest.raises(InvalidInputError, match="is hidden in part by surface 0"):
        illuminate(OpticalScene(surfaces=(front, hidden)))
    assert illuminate(OpticalScene(surfaces=(front, free))).objects.flux > 0


def test_early_and_late_photons_are_the_whole() -> None:
    """Bands of 5 standard errors on four moments: false alarms 2e-6."""
    sensor = PulsedSensor(
        pulse_width_s=1e-8, noise=Noise(read=(1e-9, 1e-9), shot=1e-4, relative=0.0)
    )
    late, whole, n = 0.6, 0.9, 20_000
    rng = np.random.default_rng(7)
    drawn = np.array([draw_noise(sensor, (late, whole), (late, whole), rng) for _ in range(n)])
    found = drawn.T @ drawn / n
    wanted = 1e-4 * np.array([[late, late], [late, whole]])
    error = np.sqrt((np.outer(np.diag(wanted), np.diag(wanted)) + wanted**2) / n)
    assert np.all(np.abs(found - wanted) < 5 * error)


def test_facets_of_a_tilted_plate_reflect_what_the_rectangle_does() -> None:
    """90 facets a side: their sum is a thirtieth of a cell's size off, 0.2 %; a cosine is 15 %."""
    scene = [plate_scene("W04H04R00T06")]
    (facets,), (rectangle,) = (
        appendix_b.simulate("pulsed", scenes=scene, converged=whole) for whole in (False, True)
    )
    assert facets.fit.c2 == pytest.approx(rectangle.fit.c2, rel=0.01)
