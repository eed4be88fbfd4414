"""The fixed rule converges geometrically; the count of points is bounded."""

import numpy as np
import pytest

from simulator.optics.brdf import Material
from simulator.optics.radiometry import observe, observe_batch
from simulator.optics.surfaces import Disk, Plane, Rectangle, Sphere
from simulator.optics.vectors import Pose

AHEAD = Pose(position_m=(0, 0, 1))
TILTED = Pose(position_m=(0.2, 0.1, 1), normal=(0.3, 0, -1))
GLOSSY = Material(diffuse=0.0, specular=1.0, roughness=0.1)


@pytest.mark.parametrize("width", [0.01, 0.1, 1.0, 3.0, 10.0, 40.0])
@pytest.mark.parametrize("ratio", [1.0, 0.3, 0.01])
def test_rectangle_to_1e_10_in_24_x_24_points_a_half(width: float, ratio: float) -> None:
    """A facing rectangle has eight sectors, four a half, of 16 x 9 points: 24^2 together."""
    plate = Rectangle(width_m=width, height_m=ratio * width, pose=AHEAD)
    exact = observe(plate, tolerance=1e-13)
    light = observe(plate, points=(16, 9))
    assert light.flux == pytest.approx(exact.flux, rel=1e-10)
    assert light.distance_m == pytest.approx(exact.distance_m, rel=1e-10)


@pytest.mark.parametrize(
    "surface",
    [
        Plane(pose=AHEAD),
        Disk(radius_m=0.4, pose=AHEAD),
        Disk(radius_m=0.4, pose=TILTED),
        Rectangle(width_m=1, height_m=1, pose=TILTED),
        Rectangle(width_m=40, height_m=40, pose=AHEAD),
        Rectangle(width_m=1, height_m=1, pose=TILTED, material=GLOSSY),
        Sphere(radius_m=0.5, centre_m=(0.2, 0, 1)),
    ],
    ids=["plane", "disk", "tilted disk", "plate", "large plate", "glossy plate", "sphere"],
)
def test_convergence_is_geometric(surface: Plane | Disk | Rectangle | Sphere) -> None:
    exact = observe(surface, tolerance=1e-13).flux
    orders = np.array([4, 8, 12, 16, 24])
    errors = [abs(observe(surface, points=int(n)).flux / exact - 1) for n in orders]
    # at least half a digit a point until rounding: measured 0.6 to 1.6
    for order, error in zip(orders, errors, strict=True):
        assert error < max(30 * 10 ** (-0.5 * float(order)), 1e-13)


def test_stated_error_bounds_the_true_one() -> None:
    plates = [
        Rectangle(width_m=1, height_m=0.3, pose=TILTED.moved((0, 0, d)), material=m)
        for d in (-0.9, -0.5, 0.0, 5.0)
        for m in (Material(), GLOSSY)
    ]
    exact = observe_batch(plates, tolerance=1e-13)
    for tolerance in (1e-4, 1e-7, 1e-10):
        for light, truth in zip(observe_batch(plates, tolerance=tolerance), exact, strict=True):
            assert light.error <= tolerance
            assert abs(light.flux / truth.flux - 1) <= tolerance


def test_units_do_not_matter() -> None:
    for scale in (1e-9, 1e-3, 1e3, 1e9):
        plate = Rectangle(width_m=0.4, height_m=0.2, pose=TILTED, material=GLOSSY)
        x, y, z = (scale * p for p in TILTED.position_m)
        other = Rectangle(
            width_m=0.4 * scale,
            height_m=0.2 * scale,
            pose=TILTED.model_copy(update={"position_m": (x, y, z)}),
            material=GLOSSY,
        )
        one, same = observe(plate), observe(other)
        assert same.flux * scale**2 == pytest.approx(one.flux, rel=1e-11)
        assert same.distance_m / scale == pytest.approx(one.distance_m, rel=1e-11)
