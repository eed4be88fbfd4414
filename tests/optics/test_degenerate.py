"""Hard geometry: finite, and right against adaptive cubature to 1e-8."""

import math

import numpy as np
import pytest

from simulator.catalogue import plate_scene
from simulator.optics.brdf import Dielectric, Material
from simulator.optics.detectors import Detector
from simulator.optics.emitters import (
    CosinePower,
    Emitter,
    Linear,
    Pattern,
    RaisedCosine,
    Table,
    Uniform,
)
from simulator.optics.light import Light
from simulator.optics.radiometry import observe
from simulator.optics.surfaces import Disk, Rectangle, Sphere
from simulator.optics.vectors import Pose, Vector
from tests.optics.reference import (
    cubature,
    disk_chart,
    integrand,
    rectangle_reference,
    sphere_chart,
)

MIXED = Material(
    diffuse=0.4,
    specular=0.8,
    roughness=0.3,
    fresnel=Dielectric(refractive_index=1.5),
    masking="smith",
)
GLOSSY = Material(diffuse=0.0, specular=1.0, roughness=0.01)


def _agrees(light: Light, reference: tuple[float, float], tolerance: float = 1e-8) -> None:
    assert light.status == "lit"
    assert light.flux == pytest.approx(reference[0], rel=tolerance)
    assert light.distance_m == pytest.approx(reference[1], rel=tolerance)


def _plate(
    width: float,
    height: float,
    position: Vector,
    normal: Vector = (0.0, 0.0, -1.0),
    material: Material | None = None,
) -> Rectangle:
    pose = Pose(position_m=position, normal=normal)
    return Rectangle(width_m=width, height_m=height, pose=pose, material=material or Material())


@pytest.mark.parametrize(
    ("plate", "pieces"),
    [
        (_plate(0.4, 0.8, (0.1, 0.2, 0.5)), (1, 1)),
        (_plate(1e-3, 1e-3, (0.3, 0.0, 1.0)), (1, 1)),
        (_plate(1e-3, 1e-3, (300.0, 0.0, 1000.0), (0.0, 0.5, -1.0)), (1, 1)),
        (_plate(1e3, 1e3, (0.1, 0.0, 0.5)), (9, 9)),
        (_plate(0.1, 0.1, (0.01, 0.0, 1e-4)), (5, 5)),
        (_plate(0.4, 0.4, (0.0, 0.0, 1.0), (0.0, -1.0, -3e-4)), (1, 1)),
        (_plate(0.4, 0.8, (0.1, 0.2, 0.5), material=GLOSSY), (9, 9)),
        (_plate(0.1, 0.1, (0.08, 0.0, 0.5), material=GLOSSY), (9, 9)),
    ],
    ids=["plain", "mm", "mm at km", "km", "touching", "edge-on", "lobe", "lobe beside"],
)
def test_rectangles_at_one_point(plate: Rectangle, pieces: tuple[int, int]) -> None:
    _agrees(observe(plate), rectangle_reference(plate, Emitter(), Detector(), pieces=pieces))


def test_horizon_crossing() -> None:
    """A plate of 1.6 m at 2 cm, tilted by 45 degrees, reaches behind the sensor's plane."""
    plate = plate_scene("W16H16R00T04").plate(0.02)
    limit = 0.02 * math.cos(math.pi / 4)  # where the plate's plane meets z = 0
    reference = rectangle_reference(plate, Emitter(), Detector(), x=(-0.8, limit), pieces=(4, 4))
    _agrees(observe(plate), reference)


def test_the_kink_of_the_v_cavities() -> None:
    rough = Material(diffuse=0.0, specular=1.0, roughness=0.9)
    plate = _plate(0.6, 0.3, (0.08, 0.0, 0.2), material=rough)
    _agrees(observe(plate), rectangle_reference(plate, Emitter(), Detector(), rtol=1e-9))


@pytest.mark.parametrize("material", [Material(), MIXED, GLOSSY], ids=["dull", "mixed", "glossy"])
def test_emitter_and_detector_apart(material: Material) -> None:
    plate = _plate(0.4, 0.8, (0.1, 0.2, 0.5), (0.2, 0.3, -1.0), material)
    emitter = Emitter(
        position_m=(0.03, 0.01, -0.01), aim=(0.2, 0.1, 1.0), pattern=CosinePower(exponent=3.0)
    )
    detector = Detector(normal=(-0.1, 0.2, 1.0))
    reference = rectangle_reference(plate, emitter, detector, pieces=(8, 8))
    _agrees(observe(plate, emitter, detector), reference)


def test_touching_with_emitter_and_detector_apart() -> None:
    plate, emitter = _plate(0.1, 0.1, (0.01, 0.0, 1e-3)), Emitter(position_m=(0.01, 0.0, 0.0))
    reference = rectangle_reference(plate, emitter, Detector(), pieces=(6, 6))
    _agrees(observe(plate, emitter), reference)


ANGLES = np.linspace(0, 1.4, 15)


@pytest.mark.parametrize(
    ("pattern", "rtol"),
    [
        (Linear(), 1e-9),
        (CosinePower(exponent=1e4), 1e-10),
        (RaisedCosine(cut_off_rad=0.3), 1e-9),
        (
            Table(
                angle_rad=tuple(ANGLES.tolist()),
                relative_intensity=tuple((np.cos(ANGLES) ** 2 + 0.1).tolist()),
            ),
            1e-8,
        ),
    ],
    ids=["linear", "power", "raised cosine", "table"],
)
def test_aimed_emitters(pattern: Pattern, rtol: float) -> None:
    plate = _plate(0.4, 0.4, (0.1, 0.0, 0.5))
    emitter = Emitter(pattern=pattern, aim=(0.1, 0.2, 1.0))
    reference = rectangle_reference(plate, emitter, Detector(), rtol=rtol, pieces=(4, 4))
    _agrees(observe(plate, emitter), reference)


def test_grazing_emitter() -> None:
    """Aimed along the plate's plane: half of its front hemisphere's rim is all that it lights."""
    plate = _plate(0.4, 0.4, (0.0, 0.0, 0.1))
    emitter = Emitter(aim=(1.0, 0.0, 0.0))
    reference = rectangle_reference(plate, emitter, Detector(), x=(0.0, 0.2), pieces=(3, 3))
    _agrees(observe(plate, emitter), reference)


def test_a_small_spot_on_a_large_plate_is_found() -> None:
    emitter = Emitter(pattern=RaisedCosine(cut_off_rad=0.02), aim=(0.3, 0.3, 1.0))
    small = _plate(0.04, 0.04, (0.15, 0.15, 0.5))
    large = _plate(4.0, 4.0, (0.1, 0.0, 0.5))
    assert observe(large, emitter).flux == pytest.approx(observe(small, emitter).flux, rel=1e-9)


@pytest.mark.parametrize(
    ("sphere", "emitter", "rtol"),
    [
        (Sphere(centre_m=(0, 0.3, 0.5), radius_m=0.2, material=GLOSSY), Emitter(), 1e-10),
        (Sphere(centre_m=(0, 0.3, 0.5), radius_m=0.2, material=MIXED), Emitter(), 1e-10),
        (Sphere(centre_m=(0.02, 0.01, 0.58), radius_m=0.57), Emitter(), 1e-9),
        (
            Sphere(centre_m=(0, 0.1, 0.5), radius_m=0.2),
            Emitter(position_m=(0.01, 0, 0), pattern=CosinePower(exponent=2.0)),
            3e-9,
        ),
    ],
    ids=["glossy", "mixed", "near", "apart"],
)
def test_spheres(sphere: Sphere, emitter: Emitter, rtol: float) -> None:
    axis = np.array(emitter.position_m) / 2 - np.array(sphere.centre_m)
    distance = float(np.linalg.norm(axis))
    f = integrand(sphere_chart(sphere, axis), sphere.material, emitter, Detector(), False)
    cap = math.acos(sphere.radius_m / distance) + (0.02 if any(emitter.position_m) else 0.0)
    reference = cubature(f, (0, -math.pi), (cap, math.pi), rtol, (4, 4))
    _agrees(observe(sphere, emitter), reference)


@pytest.mark.parametrize("material", [Material(), MIXED], ids=["dull", "mixed"])
def test_disk_beside_the_axis(material: Material) -> None:
    pose = Pose(position_m=(0.3, 0.1, 0.2), normal=(0.1, 0.2, -1))
    disk = Disk(radius_m=0.2, pose=pose, material=material)
    f = integrand(disk_chart(disk), material, Emitter(), Detector(), True)
    _agrees(observe(disk), cubature(f, (0, -math.pi), (0.2, math.pi), 1e-10, (3, 6)))


def test_uniform_is_a_power_of_zero() -> None:
    plate = _plate(0.4, 0.8, (0.1, 0.2, 0.5), (0.2, 0.3, -1.0), MIXED)
    one, other = (
        observe(plate, Emitter(pattern=p, position_m=(0.01, 0, 0)))
        for p in (Uniform(), CosinePower(exponent=0.0))
    )
    assert one.flux == pytest.approx(other.flux, rel=1e-11)
