"""Scenes of surfaces, what a sensor reads of them, and what is refused."""

import itertools
import math
from typing import Any

import numpy as np
import pydantic
import pytest
from scipy.constants import h, speed_of_light

from simulator.errors import InvalidInputError
from simulator.optics.assembly import OpticalScene, illuminate, read
from simulator.optics.brdf import Material, fresnel_dielectric
from simulator.optics.crosstalk import CoverGlass, glass_crosstalk
from simulator.optics.detectors import Detector, Geiger, Photodiode
from simulator.optics.electronics import Electronics, physical_gain, saturation
from simulator.optics.emitters import Emitter, RaisedCosine, Table, lambertian, radiant_intensity
from simulator.optics.extended import point_emitters
from simulator.optics.light import Modulation
from simulator.optics.motion import linear, radial, rotation, series
from simulator.optics.radiometry import observe, observe_shell, shadow
from simulator.optics.surfaces import Disk, Plane, Rectangle, Shell, Sphere
from simulator.optics.vectors import Pose
from simulator.sensor import Noise, PulsedSensor, SineWaveSensor

PULSE = PulsedSensor(pulse_width_s=1e-7, gain=3.0, noise=Noise(read=(1e-6, 1e-6)))
SINE = SineWaveSensor(
    frequency_hz=5e6, phase_offset_rad=0.3, gain=3.0, noise=Noise(read=(1e-6, 1e-6))
)
DISK = Disk(radius_m=0.2, pose=Pose(position_m=(0, 0, 0.5)))
PLATE = Rectangle(width_m=0.3, height_m=0.2, pose=Pose(position_m=(0.5, 0, 0.8)))


def test_readings_follow_the_convention() -> None:
    scene = OpticalScene(surfaces=(DISK,))
    light = observe(DISK)
    w1, w2 = read(scene, PULSE).values
    assert w2 == pytest.approx(3 * light.flux)
    assert w1 == pytest.approx(w2 * light.distance_m / PULSE.r0)
    x = complex(*read(scene, SINE).values)
    assert abs(x) == pytest.approx(3 * light.flux, rel=1e-3)
    assert math.atan2(x.imag, x.real) == pytest.approx(
        SINE.wave_number * light.distance_m + 0.3, rel=1e-5
    )


def test_surfaces_add_and_background_is_shadowed_by_each() -> None:
    shell = Shell(radius_m=4.0)
    scene = OpticalScene(surfaces=(DISK, PLATE), background=shell)
    light = illuminate(scene)
    assert light.objects.flux == pytest.approx(observe(DISK).flux + observe(PLATE).flux)
    hidden = shadow(DISK, shell).flux + shadow(PLATE, shell).flux
    assert light.background.flux == pytest.approx(observe_shell(shell).flux - hidden)
    assert 0 < light.visible_share < 1
    w1, w2 = read(OpticalScene(background=shell), PULSE).values
    assert w1 / w2 == pytest.approx(4.0 / PULSE.r0)


def test_shadow_is_the_silhouette_whatever_the_shape() -> None:
    """A sphere hides what the disk through its horizon hides."""
    sphere = Sphere(centre_m=(0.1, 0.2, 1.0), radius_m=0.4)
    distance = math.sqrt(0.01 + 0.04 + 1.0)
    along = distance - 0.16 / distance
    radius = 0.4 * math.sqrt(1 - (0.4 / distance) ** 2)
    axis = tuple(v / distance for v in sphere.centre_m)
    pose = Pose(
        position_m=(along * axis[0], along * axis[1], along * axis[2]),
        normal=(axis[0], axis[1], axis[2]),
    )
    disk = Disk(radius_m=radius, pose=pose)
    for pattern in (lambertian(), RaisedCosine(cut_off_rad=1.0)):
        emitter = Emitter(pattern=pattern)
        one, other = (shadow(s, Shell(radius_m=5.0), emitter).flux for s in (sphere, disk))
        assert one == pytest.approx(other, rel=1e-9)


def test_a_closed_box_hides_everything() -> None:
    plane = Plane(pose=Pose(position_m=(0, 0, 0.3)))
    light = illuminate(OpticalScene(surfaces=(plane,), background=Shell(radius_m=2.0)))
    assert light.background.flux == pytest.approx(0.0, abs=1e-10 * light.bare_background.flux)


def test_hidden_surfaces_are_refused() -> None:
    behind = Rectangle(width_m=0.3, height_m=0.3, pose=Pose(position_m=(0.1, 0, 1.0)))
    with pytest.raises(InvalidInputError, match="/surfaces/1: is hidden in part by surface 0"):
        illuminate(OpticalScene(surfaces=(DISK, behind)))
    ball = Sphere(centre_m=(0.02, 0, 0.3), radius_m=0.02)
    with pytest.raises(InvalidInputError, match="/surfaces/0"):
        illuminate(OpticalScene(surfaces=(DISK, ball)))


@pytest.mark.parametrize(
    ("surface", "status"),
    [
        (Rectangle(width_m=1, height_m=1, pose=Pose(position_m=(0, 0, -1))), "out_of_view"),
        (Disk(radius_m=1, pose=Pose(position_m=(0, 0, -1))), "out_of_view"),
        (Sphere(radius_m=0.5, centre_m=(0, 0, -1)), "out_of_view"),
        (Plane(pose=Pose(position_m=(0, 0, -1))), "out_of_view"),
        (
            Rectangle(width_m=1, height_m=1, pose=Pose(position_m=(0, 0, 1), normal=(1, 0, 0))),
            "edge_on",
        ),
    ],
)
def test_dark_surfaces_have_a_status(surface: Any, status: str) -> None:
    light = observe(surface)
    assert light.flux == 0.0
    assert light.status == status
    assert light.reason
    assert read(OpticalScene(surfaces=(surface,)), PULSE).values == (0.0, 0.0)


def test_opposite_faces() -> None:
    plate = Rectangle(width_m=1, height_m=1, pose=Pose(position_m=(0, 0, 1)))
    light = observe(plate, Emitter(position_m=(0, 0, 2.0), aim=(0, 0, -1)))
    assert light.status == "opposite_faces"


def test_outside_the_emitters_cone_is_dark() -> None:
    plate = Rectangle(width_m=0.1, height_m=0.1, pose=Pose(position_m=(1.0, 0, 1)))
    light = observe(plate, Emitter(pattern=RaisedCosine(cut_off_rad=0.2)))
    assert light.flux == 0.0
    assert light.status == "dark"


BAD: list[tuple[Any, dict[str, Any]]] = [
    (Rectangle, {"width_m": 0.0, "height_m": 1.0, "pose": Pose(position_m=(0, 0, 1))}),
    (Rectangle, {"width_m": -1.0, "height_m": 1.0, "pose": Pose(position_m=(0, 0, 1))}),
    (Disk, {"radius_m": math.nan, "pose": Pose(position_m=(0, 0, 1))}),
    (Sphere, {"radius_m": math.inf, "centre_m": (0, 0, 1)}),
    (Pose, {"position_m": (0, math.nan, 0)}),
    (Pose, {"position_m": (0, 0, 1), "normal": (0, 0, 0)}),
    (Pose, {"position_m": (0, 0, 1), "normal": (1, 0, 0), "width_axis": (2, 0, 0)}),
    (Emitter, {"power_w": 0.0}),
    (Emitter, {"size_m": (0.0, 1.0)}),
    (Detector, {"area_m2": -1.0}),
    (Material, {"diffuse": 1.5}),
    (Material, {"roughness": 0.0}),
    (Table, {"angle_rad": (0.2, 0.1), "relative_intensity": (1.0, 1.0)}),
    (Table, {"angle_rad": (0.1, 0.1), "relative_intensity": (1.0, 1.0)}),
    (Table, {"angle_rad": (0.0, 0.1), "relative_intensity": (1.0, -1.0)}),
    (Table, {"angle_rad": (0.0, 0.1), "relative_intensity": (0.0, 0.0)}),
    (Table, {"angle_rad": (0.0, 2.0), "relative_intensity": (1.0, 1.0)}),
    (Table, {"angle_rad": (0.0, 0.1, 0.2), "relative_intensity": (1.0, 1.0)}),
    (Geiger, {"detection_efficiency": 0.0}),
    (CoverGlass, {"distance_m": 0.0}),
]


@pytest.mark.parametrize(
    ("kind", "fields"), BAD, ids=[f"{k.__name__} {i}" for i, (k, _) in enumerate(BAD)]
)
def test_bad_descriptions(kind: Any, fields: dict[str, Any]) -> None:
    with pytest.raises(pydantic.ValidationError):
        kind(**fields)


def test_sensor_inside_a_sphere_or_outside_the_background() -> None:
    with pytest.raises(InvalidInputError, match="inside the sphere"):
        observe(Sphere(centre_m=(0, 0, 0.1), radius_m=0.5))
    with pytest.raises(InvalidInputError, match="/background/radius_m: the detector"):
        observe_shell(Shell(radius_m=1.0), detector=Detector(position_m=(0, 0, -2.0)))
    with pytest.raises(InvalidInputError, match="at one point"):
        shadow(DISK, Shell(radius_m=3.0), Emitter(position_m=(0.01, 0, 0)))


@pytest.mark.parametrize("pattern", [RaisedCosine(cut_off_rad=0.4), RaisedCosine(cut_off_rad=1.5)])
def test_patterns_are_normalised(pattern: RaisedCosine) -> None:
    x, w = np.polynomial.legendre.leggauss(200)
    for shape in (
        pattern,
        Table(angle_rad=(0.0, 0.3, 0.9, 1.5), relative_intensity=(5.0, 4.0, 1.0, 0.0)),
        Table(angle_rad=(0.2, 1.0), relative_intensity=(1.0, 3.0)),
    ):
        low, high = (0.0, math.pi / 2)
        ends = [low, 0.2, 0.3, 0.4, 0.9, 1.0, 1.5, high]
        total = 0.0
        for a, b in itertools.pairwise(ends):
            t = 0.5 * (b - a) * x + 0.5 * (a + b)
            total += 0.5 * (b - a) * float(np.sum(w * radiant_intensity(shape, t) * np.sin(t)))
        assert 2 * math.pi * total == pytest.approx(1.0, rel=1e-10)


def test_extended_emitter_is_the_mean_over_its_area() -> None:
    emitter = Emitter(size_m=(0.04, 0.02), pattern=lambertian())
    few, many = (
        sum(w * observe(DISK, e).flux for w, e in point_emitters(emitter, n)) for n in (5, 8)
    )
    assert few == pytest.approx(many, rel=1e-9)
    light = illuminate(OpticalScene(surfaces=(DISK,), emitter=emitter))
    assert light.objects.flux == pytest.approx(few, rel=1e-9)
    assert light.objects.flux != pytest.approx(observe(DISK, Emitter(pattern=lambertian())).flux)


def test_cover_glass() -> None:
    """Two faces of 4 % for thin glass; a mirror image at twice the distance."""
    thin = CoverGlass(distance_m=0.01, thickness_m=1e-9)
    f = fresnel_dielectric(1.0, 1.5)
    light = glass_crosstalk(thin)
    both = f + (1 - f) ** 2 * f / (1 - f * f)
    assert light.flux == pytest.approx(both / (2 * math.pi) / 0.02**2, rel=1e-6)
    assert light.distance_m == pytest.approx(0.01, rel=1e-6)
    # apart: the front face alone is a mirror, I_e F cos / L^2
    beside = Emitter(position_m=(0.015, 0, 0))
    length = math.hypot(0.015, 0.02)
    c = 0.02 / length
    f = fresnel_dielectric(c, 1.5)
    both = f + (1 - f) ** 2 * f / (1 - f * f)
    light = glass_crosstalk(thin, beside, modulation=Modulation(frequency_hz=5e6))
    assert light.flux == pytest.approx(both * c / (2 * math.pi) / length**2, rel=1e-6)
    assert light.distance_m == pytest.approx(length / 2, rel=1e-6)
    assert glass_crosstalk(CoverGlass(distance_m=0.01, refractive_index=1.0)).flux == 0.0
    with pytest.raises(InvalidInputError, match="/emitter/position_m"):
        glass_crosstalk(thin, Emitter(position_m=(0, 0, 0.001)))
    scene = OpticalScene(surfaces=(DISK,), cover_glass=thin)
    more = read(scene, PULSE).values[1] - read(OpticalScene(surfaces=(DISK,)), PULSE).values[1]
    assert more == pytest.approx(3 * glass_crosstalk(thin).flux)


def test_thick_glass_returns_later() -> None:
    thick = glass_crosstalk(CoverGlass(distance_m=0.001, thickness_m=0.003))
    thin = glass_crosstalk(CoverGlass(distance_m=0.001, thickness_m=1e-6))
    assert thick.distance_m > thin.distance_m
    assert thick.flux < thin.flux


def test_electrical_crosstalk_and_drift() -> None:
    electronics = Electronics(
        crosstalk=(0.01, 0.02), gain_drift_per_k=-1e-3, delay_drift_s_per_k=1e-11
    )
    scene = OpticalScene(surfaces=(DISK,), electronics=electronics)
    plain = read(OpticalScene(surfaces=(DISK,)), PULSE).values
    assert read(scene, PULSE).values == pytest.approx((plain[0] + 0.01, plain[1] + 0.02))
    warm = read(scene, PULSE, temperature_k=308.15).values
    assert warm[1] == pytest.approx(plain[1] * 0.99 + 0.02)
    shift = 0.5 * speed_of_light * 1e-10 / PULSE.r0
    assert warm[0] == pytest.approx((plain[0] + plain[1] * shift) * 0.99 + 0.01)
    cold = complex(*read(OpticalScene(surfaces=(DISK,)), SINE).values)
    turned = complex(*read(scene, SINE, temperature_k=308.15).values) - complex(0.01, 0.02)
    assert np.angle(turned / cold) == pytest.approx(2 * math.pi * 5e6 * 1e-10)
    with pytest.raises(InvalidInputError, match="/temperature_k"):
        read(scene, PULSE, temperature_k=-1.0)


def test_resolution_and_full_scale() -> None:
    sensor = PULSE.model_copy(update={"full_scale": (0.1, 0.3)})
    scene = OpticalScene(surfaces=(DISK,), electronics=Electronics(adc_bits=8))
    reading = read(scene, sensor)
    assert reading.values[1] == pytest.approx(reading.mean[1], abs=0.3 / 255 / 2)
    assert reading.values[1] / (0.3 / 255) == pytest.approx(round(reading.values[1] / (0.3 / 255)))
    assert not reading.saturated
    near = Disk(radius_m=0.2, pose=Pose(position_m=(0, 0, 0.1)))
    full = read(OpticalScene(surfaces=(near,)), sensor)
    assert full.saturated
    assert full.values[1] == 0.3
    with pytest.raises(InvalidInputError, match="/electronics/adc_bits"):
        read(scene, PULSE)


def test_detectors() -> None:
    diode = Photodiode(quantum_efficiency=0.8, wavelength_m=850e-9, avalanche_gain=50)
    assert diode.responsivity == pytest.approx(0.8 * 850e-9 / 1.23984e-6, rel=1e-5)
    assert diode.signal(1e-9) == pytest.approx(50e-9 * diode.responsivity)
    spad = Geiger(dead_time_s=20e-9, dark_rate_hz=100.0)
    assert spad.signal(1e-3) == pytest.approx(1 / 20e-9, rel=1e-3)
    assert spad.power(spad.signal(1e-12)) == pytest.approx(1e-12)
    assert spad.power(1 / 20e-9) == math.inf
    photon = h * speed_of_light / 850e-9
    gain = physical_gain(Emitter(power_w=0.1), Detector(area_m2=1e-6, response=spad), 1e-3)
    assert gain == pytest.approx(0.1 * 1e-6 * 1e-3 * 0.3 / photon)
    detector = Detector(area_m2=1e-4, response=spad)
    share = saturation(Emitter(), detector, 1e-6)
    rate = spad.trigger_rate(1e-10)
    assert share == pytest.approx(1 / (1 + rate * 20e-9))
    dim = read(OpticalScene(surfaces=(DISK,), detector=detector), PULSE).values
    bright = read(OpticalScene(surfaces=(DISK,)), PULSE).values
    assert dim[1] < bright[1]
    assert dim[0] / dim[1] == pytest.approx(bright[0] / bright[1])


def test_noise_has_the_stated_moments(monkeypatch: pytest.MonkeyPatch) -> None:
    """2000 frames: variances known to 3.2 %, so that 4 sigma is 13 %; false alarms below 1e-3."""
    noise = Noise(read=(1e-3, 2e-3), shot=1e-4, relative=0.01)
    sensor = PULSE.model_copy(update={"noise": noise})
    scene = OpticalScene(surfaces=(DISK,))
    rng = np.random.default_rng(11)
    clean = read(scene, sensor)
    mean = clean.mean
    # the light of a scene is no chance: it is looked for once
    with monkeypatch.context() as patch:
        patch.setattr("simulator.optics.assembly.illuminate", lambda *_, **__: clean.light)
        draws = np.array([read(scene, sensor, rng).values for _ in range(2000)])
    cov = np.cov(draws.T)
    assert cov[0, 0] == pytest.approx(1e-6 + 1e-4 * mean[0] + 1e-4 * mean[0] ** 2, rel=0.13)
    assert cov[1, 1] == pytest.approx(4e-6 + 1e-4 * mean[1] + 1e-4 * mean[1] ** 2, rel=0.13)
    want = 1e-4 * mean[0] + 1e-4 * mean[0] * mean[1]
    assert cov[0, 1] == pytest.approx(want, abs=4 * math.sqrt(cov[0, 0] * cov[1, 1] / 2000))
    again = np.random.default_rng(11)
    assert read(scene, sensor, again).values == tuple(draws[0])


def test_motion() -> None:
    start = Pose(position_m=(0.3, 0.0, 0.4))
    assert radial(start, 1.0)(0.5).position_m == pytest.approx((0.6, 0.0, 0.8))
    assert linear(start, (0.0, 2.0, 0.0))(0.5).position_m == pytest.approx((0.3, 1.0, 0.4))
    turned = rotation(start, (0, 1, 0), math.pi / 2)(1.0)
    assert turned.normal == pytest.approx((-1, 0, 0))
    assert turned.position_m == start.position_m
    around = rotation(start, (0, 0, 1), math.pi, about_m=(0, 0, 0))(1.0)
    assert around.position_m == pytest.approx((-0.3, 0, 0.4))


@pytest.mark.parametrize("sensor", [PULSE, SINE], ids=["pulsed", "sine wave"])
def test_series_has_the_truth(sensor: Any) -> None:
    scene = OpticalScene(surfaces=(DISK,), background=Shell(radius_m=5.0))
    times = np.linspace(0, 1, 5)
    out = series(scene, radial(DISK.pose, 0.5), times, sensor)
    assert out.frames.readings.shape == (5, 2)
    assert np.all(np.diff(out.range_m) > 0)
    assert np.all(np.diff(out.flux) < 0)
    z = 0.5 + 0.5 * times
    assert out.visible_share == pytest.approx(z**2 / (z**2 + 0.04))
    with pytest.raises(InvalidInputError, match="/moving"):
        series(scene, radial(DISK.pose, 0.5), times, sensor, moving=1)
    with pytest.raises(InvalidInputError, match="/time_s"):
        series(scene, radial(DISK.pose, 0.5), np.array([]), sensor)


def test_scene_is_plain_data() -> None:
    scene = OpticalScene(surfaces=(DISK, PLATE), background=Shell(radius_m=4.0))
    assert OpticalScene.model_validate_json(scene.model_dump_json()) == scene
    with pytest.raises(pydantic.ValidationError):
        OpticalScene.model_validate({"surfaces": [{"kind": "cube"}]})
