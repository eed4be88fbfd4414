"""The slow, obvious way: the printed kernel on a parametrised surface, by adaptive cubature."""

import itertools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, special

from simulator.optics.brdf import Dielectric, Material
from simulator.optics.detectors import Detector
from simulator.optics.emitters import (
    CosinePower,
    Emitter,
    Linear,
    RaisedCosine,
    Table,
    Uniform,
    radiant_intensity,
)
from simulator.optics.surfaces import Disk, Rectangle, Sphere

Array = NDArray[np.float64]
Chart = Callable[[Array, Array], tuple[Array, Array, Array]]


def _unit(v: Array) -> Array:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def emitted(emitter: Emitter, cosine: Array) -> Array:
    """I_e / Phi0, written down again from the definitions."""
    angle = np.arccos(np.clip(cosine, -1, 1))
    front = cosine > 0
    pattern = emitter.pattern
    if isinstance(pattern, Uniform):
        value = np.full(angle.shape, 1 / (2 * math.pi))
    elif isinstance(pattern, CosinePower):
        n = pattern.exponent
        value = (n + 1) / (2 * math.pi) * np.where(front, np.abs(cosine), 0) ** n
    elif isinstance(pattern, Linear):
        value = (math.pi / 2 - angle) / (math.pi * (math.pi - 2))
    elif isinstance(pattern, RaisedCosine):
        a0 = pattern.cut_off_rad

        def shape(a: float) -> float:
            return 0.5 * (1 + math.cos(math.pi * a / a0))

        norm = integrate.quad(lambda a: shape(a) * math.sin(a), 0, a0, epsabs=0, epsrel=1e-13)[0]
        value = np.where(angle < a0, 0.5 * (1 + np.cos(np.pi * angle / a0)), 0)
        value = value / (2 * math.pi * norm)
    else:
        assert isinstance(pattern, Table)
        value = radiant_intensity(pattern, angle)
    return np.where(front, value, 0.0)


def brdf(material: Material, wi: Array, wo: Array, n: Array) -> Array:
    """f_r of 2.6 to 2.10 as corrected."""
    ci, co = np.sum(wi * n, -1), np.sum(wo * n, -1)
    value = np.full(ci.shape, material.diffuse / math.pi)
    if material.specular > 0:
        h = _unit(wi + wo)
        ch, coh = np.sum(h * n, -1), np.sum(wo * h, -1)
        m = material.roughness
        t2 = np.sum(np.cross(n, h) ** 2, -1) / ch**2
        d = np.exp(-t2 / m**2) / (math.pi * m**2 * ch**4)
        if material.masking == "v_cavity":
            g = np.minimum(1, np.minimum(2 * ch * ci / coh, 2 * ch * co / coh))
        elif material.masking == "smith":
            total = np.ones(ci.shape)
            for c in (ci, co):
                a = c / (m * np.sqrt(np.maximum(1 - c * c, 1e-300)))
                total += (special.erf(a) - 1) / 2 + np.exp(-(a**2)) / (2 * a * math.sqrt(math.pi))
            g = 1 / total
        else:
            g = np.ones(ci.shape)
        if isinstance(material.fresnel, Dielectric):
            index = material.fresnel.refractive_index
            ct = np.sqrt(1 - (1 - coh**2) / index**2)
            rs = (coh - index * ct) / (coh + index * ct)
            rp = (index * coh - ct) / (index * coh + ct)
            f = (rs**2 + rp**2) / 2
        else:
            f = np.full(ci.shape, material.fresnel.reflectance)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = value + material.specular * d * g * f / (4 * ci * co)
    return np.asarray(value)


def integrand(
    chart: Chart, material: Material, emitter: Emitter, detector: Detector, two_sided: bool
) -> Callable[[Array], Array]:
    """dPhi, r dPhi per parameter area, for `scipy.integrate.cubature`."""
    e, d = np.array(emitter.position_m), np.array(detector.position_m)

    def f(x: Array) -> Array:
        p, n, area = chart(x[:, 0], x[:, 1])
        ri, ro = np.linalg.norm(p - e, axis=-1), np.linalg.norm(p - d, axis=-1)
        wi, wo = (e - p) / ri[:, None], (d - p) / ro[:, None]
        if two_sided:
            n = n * np.sign(np.sum(wi * n, -1))[:, None]
        ci, co = np.sum(wi * n, -1), np.sum(wo * n, -1)
        cd = -np.sum(wo * np.array(detector.normal), -1)
        ce = -np.sum(wi * np.array(emitter.aim), -1)
        ok = (ci > 0) & (co > 0) & (cd > 0) & (ce > 0)
        value = np.zeros(ri.shape)
        if np.any(ok):
            fr = brdf(material, wi[ok], wo[ok], n[ok])
            value[ok] = (
                fr * emitted(emitter, ce[ok]) * ci[ok] * co[ok] * cd[ok] / (ri[ok] * ro[ok]) ** 2
            ) * area[ok]
        return np.column_stack([value, value * 0.5 * (ri + ro)])

    return f


def flat_chart(surface: Rectangle | Disk) -> Chart:
    """Cartesian coordinates in the plane."""
    u, v, n = (np.array(a) for a in surface.pose.axes())
    centre = np.array(surface.pose.position_m)

    def chart(x: Array, y: Array) -> tuple[Array, Array, Array]:
        p = centre + x[:, None] * u + y[:, None] * v
        return p, np.broadcast_to(n, p.shape), np.ones(x.shape)

    return chart


def disk_chart(surface: Disk) -> Chart:
    """Polar coordinates about the centre of the disk."""
    flat = flat_chart(surface)

    def chart(x: Array, y: Array) -> tuple[Array, Array, Array]:
        p, n, _ = flat(x * np.cos(y), x * np.sin(y))
        return p, n, x

    return chart


def sphere_chart(surface: Sphere, axis: Array) -> Chart:
    """Polar angle and azimuth about an axis."""
    a = _unit(axis)
    b = _unit(np.cross(a, [0.3, 0.5, 0.8]))
    c = np.cross(a, b)
    centre, radius = np.array(surface.centre_m), surface.radius_m

    def chart(x: Array, y: Array) -> tuple[Array, Array, Array]:
        s = np.sin(x)
        n = np.cos(x)[:, None] * a + (s * np.cos(y))[:, None] * b + (s * np.sin(y))[:, None] * c
        return centre + radius * n, n, radius**2 * s

    return chart


def cubature(
    f: Callable[[Array], Array],
    low: tuple[float, float],
    high: tuple[float, float],
    rtol: float = 1e-10,
    pieces: tuple[int, int] = (1, 1),
) -> tuple[float, float]:
    """Flux and mean distance."""
    total = np.zeros(2)
    xs, ys = (np.linspace(low[i], high[i], pieces[i] + 1) for i in (0, 1))
    for x0, x1 in itertools.pairwise(xs):
        for y0, y1 in itertools.pairwise(ys):
            result = integrate.cubature(
                f, [x0, y0], [x1, y1], rule="gk21", rtol=rtol, atol=0, max_subdivisions=3000
            )
            total += result.estimate
    return float(total[0]), float(total[1] / total[0])


def rectangle_reference(
    surface: Rectangle,
    emitter: Emitter,
    detector: Detector,
    x: tuple[float, float] | None = None,
    y: tuple[float, float] | None = None,
    rtol: float = 1e-10,
    pieces: tuple[int, int] = (1, 1),
) -> tuple[float, float]:
    """Flux and distance of a rectangle, or of the part between given limits."""
    a, b = surface.width_m / 2, surface.height_m / 2
    x, y = x or (-a, a), y or (-b, b)
    f = integrand(flat_chart(surface), surface.material, emitter, detector, True)
    return cubature(f, (x[0], y[0]), (x[1], y[1]), rtol, pieces)
