"""Reflectance against published constants, normalisation and the white furnace."""

import math
from typing import Any

import numpy as np
import pytest
from scipy import integrate, special

from simulator.optics.brdf import (
    ConstantFresnel,
    Dielectric,
    Material,
    beckmann,
    fresnel_dielectric,
    pack_material,
    reflect,
    smith_lambda,
    v_cavity,
)

ROUGHNESS = [0.05, 0.1, 0.3, 0.5, 1.0]


def test_fresnel_constants() -> None:
    # glass and water at normal incidence, textbook values
    assert fresnel_dielectric(1.0, 1.5) == pytest.approx(0.04, rel=1e-14)
    assert fresnel_dielectric(1.0, 1.333) == pytest.approx((0.333 / 2.333) ** 2, rel=1e-13)
    assert fresnel_dielectric(1.0, 10.0) == pytest.approx(0.66942, abs=5e-6)
    assert fresnel_dielectric(0.0, 1.5) == pytest.approx(1.0)
    assert fresnel_dielectric(0.3, 1.0) == 0.0
    assert fresnel_dielectric(0.0, 1.0) == 0.0
    # Hecht, Optics: glass at 60 degrees, r_perp^2 = 0.1764, r_par^2 = 0.0018
    assert fresnel_dielectric(0.5, 1.5) == pytest.approx(0.0891, abs=1e-4)


def test_fresnel_at_brewsters_angle() -> None:
    # the parallel part vanishes; what is left is half of ((n^2 - 1)/(n^2 + 1))^2
    n = 1.5
    cosine = 1 / math.hypot(1, n)
    assert fresnel_dielectric(cosine, n) == pytest.approx(0.5 * ((n * n - 1) / (n * n + 1)) ** 2)


@pytest.mark.parametrize("m", ROUGHNESS)
def test_beckmann_is_normalised_and_m_is_the_rms_slope(m: float) -> None:
    def density(angle: float) -> float:
        c, s = math.cos(angle), math.sin(angle)
        return 2 * math.pi * beckmann(c, (s / c) ** 2, m) * c * s

    points = [math.atan(m), math.atan(4 * m)]
    total = integrate.quad(density, 0, math.pi / 2, points=points, epsabs=0, epsrel=1e-12)[0]

    def moment(angle: float) -> float:
        return density(angle) * math.tan(angle) ** 2

    slope2 = integrate.quad(moment, 0, math.pi / 2, points=points, epsabs=0, epsrel=1e-12)[0]
    assert total == pytest.approx(1.0, rel=1e-10)
    assert slope2 == pytest.approx(m * m, rel=1e-10)


def test_beckmann_value() -> None:
    # D(0) = 1/(pi m^2); at tan = m it has fallen by e (1 + m^2)^-2
    assert beckmann(1.0, 0.0, 0.1) == pytest.approx(100 / math.pi)
    c = 1 / math.hypot(1, 0.1)
    assert beckmann(c, 0.01, 0.1) == pytest.approx(100 / math.pi / math.e * 1.01**2)
    assert beckmann(1e-3, 1e6, 0.01) == 0.0


@pytest.mark.parametrize("a", [0.05, 0.2, 0.5, 1.0, 1.5, 1.7, 3.0])
def test_smith_against_walters_published_fit(a: float) -> None:
    """Walter et al. 2007, eq. 27: relative error of G1 below 0.35 %."""
    m = 0.3
    g1 = 1 / (1 + smith_lambda(1 / (a * m) ** 2, m))
    fit = (3.535 * a + 2.181 * a**2) / (1 + 2.276 * a + 2.577 * a**2) if a < 1.6 else 1.0
    assert g1 == pytest.approx(fit, rel=0.0036)
    exact = (special.erf(a) - 1) / 2 + math.exp(-a * a) / (2 * a * math.sqrt(math.pi))
    assert smith_lambda(1 / (a * m) ** 2, m) == pytest.approx(exact, rel=1e-11)


@pytest.mark.parametrize("m", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("zenith", [0.1, 0.7, 1.2])
@pytest.mark.parametrize("masking", ["v_cavity", "smith"])
def test_weak_white_furnace(m: float, zenith: float, masking: str) -> None:
    """int D G1 max(0, w.h) dh = cos(zenith): what is seen of the facets fills the projected area.

    Heitz, JCGT 3(2), 2014: Smith's and the V-cavities' masking satisfy it (with no shadowing, which
    loses what is reflected into the surface).
    """
    w = np.array([math.sin(zenith), 0.0, math.cos(zenith)])

    def visible(phi: float, theta: float) -> float:
        h = (math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta))
        wh = w[0] * h[0] + w[2] * h[2]
        if wh <= 0:
            return 0.0
        if masking == "smith":
            g = 1 / (1 + smith_lambda(math.tan(zenith) ** 2, m))
        else:
            g = v_cavity(w[2], h[2], wh)
        return float(g * wh * beckmann(h[2], math.tan(theta) ** 2, m) * math.sin(theta))

    total = 0.0
    nodes, weights = np.polynomial.legendre.leggauss(160)
    theta = math.pi / 4 * (nodes + 1)
    phi = math.pi / 2 * (nodes + 1)
    for t, wt in zip(theta, weights, strict=True):
        row = sum(wp * visible(p, t) for p, wp in zip(phi, weights, strict=True))
        total += wt * row * math.pi / 4 * math.pi / 2 * 2
    # kinks of the masking limit the fixed rule
    assert total == pytest.approx(math.cos(zenith), rel=2e-3)


@pytest.mark.parametrize("masking", ["v_cavity", "smith"])
@pytest.mark.parametrize("m", [0.3, 1.0])
def test_white_furnace_is_not_exceeded(masking: str, m: float) -> None:
    material = pack_material(
        Material.model_validate(
            {"diffuse": 0.0, "specular": 1.0, "roughness": m, "masking": masking}
        )
    )
    nodes, weights = np.polynomial.legendre.leggauss(80)
    wi = np.array([math.sin(0.8), 0.0, math.cos(0.8)])
    total = 0.0
    for x, wx in zip(nodes, weights, strict=True):
        theta = math.pi / 4 * (x + 1)
        for y, wy in zip(nodes, weights, strict=True):
            phi = math.pi * (y + 1)
            wo = np.array(
                [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
            )
            h = wi + wo
            length = float(np.linalg.norm(h))
            h = h / length
            tan2 = float(h[0] ** 2 + h[1] ** 2) / float(h[2]) ** 2
            f = reflect(material, 0, wi[2], wo[2], h[2], tan2, length / 2)
            total += f / wi[2] * math.sin(theta) * wx * wy * math.pi / 4 * math.pi
    assert 0.5 < total < 1.0 + 1e-6


@pytest.mark.parametrize("masking", ["v_cavity", "smith", "none"])
def test_light_takes_the_same_way_back(masking: Any) -> None:
    """Helmholtz: what is reflected does not change where incidence and exit change places."""
    packed = pack_material(
        Material(diffuse=0.3, specular=0.7, roughness=0.6, fresnel=Dielectric(), masking=masking)
    )
    # directions in one plane, on both sides of the normal and on one
    for first, second in ((0.2, -1.3), (0.1, 1.4), (1.2, 1.35)):
        half = 0.5 * (first + second)
        between = math.cos(0.5 * (first - second)), math.tan(half) ** 2
        there, back = (
            reflect(packed, 0, math.cos(a), math.cos(b), math.cos(half), between[1], between[0])
            for a, b in ((first, second), (second, first))
        )
        assert there == pytest.approx(back, rel=1e-14)


def test_mixture_is_the_sum_of_its_parts() -> None:
    glass = Dielectric(refractive_index=1.5)
    both = pack_material(Material(diffuse=0.3, specular=0.6, roughness=0.3, fresnel=glass))
    dull = pack_material(Material(diffuse=0.3))
    shiny = pack_material(Material(diffuse=0.0, specular=0.6, roughness=0.3, fresnel=glass))
    angles = (0.8, 0.7, 0.9, 0.2, 0.95)
    assert reflect(both, 0, *angles) == pytest.approx(
        reflect(dull, 0, *angles) + reflect(shiny, 0, *angles)
    )


def test_a_material_that_reflects_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="reflects nothing"):
        Material(diffuse=0.0, specular=0.0)
    assert Material(fresnel=ConstantFresnel(reflectance=0.5)).diffuse == 1.0
