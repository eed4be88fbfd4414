"""Laplace's integral over the flux error's coefficients is made at their maximum, and of it."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import collapsed_density
from inference.density.discrepant import DiscrepantDensity, with_discrepancy
from inference.density.frame_integrals import fill_log_likelihoods
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

Array = NDArray[np.float64]

GROWS = "noise that grows with the light"
BOTH = "both"
CASES: dict[str, tuple[str, float, tuple[float, float], dict[str, float]]] = {
    # kind, SNR at 1 m, how far frames go: in the dark the law of ranges follows the curve
    GROWS: ("pulsed", 30.0, (0.3, 1.0), {"relative": 0.3}),
    "a pulse in the dark": ("pulsed", 1.0, (0.5, 3.0), {}),
    "a wave in the dark": ("sine_wave", 1.0, (0.5, 3.0), {}),
    BOTH: ("sine_wave", 3.0, (0.3, 2.5), {"relative": 0.2, "shot": 1e-6}),
}


def of_coefficients(density: DiscrepantDensity, z: Array, coefficients: Array) -> float:
    """Integrate ranges alone, under a given curve: slow, and without an expansion."""
    terms = density.parameters.terms(z[None])
    rows = density.integral_rows(terms)._replace(
        flux_errors=np.ascontiguousarray(density.knots @ coefficients)[None],
        flux_grid=(density.basis.first, 1.0 / density.basis.spacing),
    )
    out = np.empty((1, density.data.blocks))
    fill_log_likelihoods(out, rows, density.data, density.instrument)
    return float(out.sum()) - 0.5 * float(coefficients @ coefficients)


# a kind of its own to compile, and its noise is that of both
@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=pytest.mark.thorough if case == GROWS else ()) for case in CASES],
)
def test_the_integral_is_laplaces_at_the_maximum(case: str) -> None:
    """A curve changes what noise, and the law of ranges in the dark, are: slopes know of both."""
    kind, snr, span, noise = CASES[case]
    sensor, crosstalk = sensor_of(kind, snr, **noise), [0.002, 0.01]
    truth: dict[str, Any] = {"crosstalk": crosstalk}
    if case == BOTH:  # with all terms, as other tests compile it
        truth["background"] = {
            "strength": 1e-3,
            "distance_m": 4.0,
            "shadow": {"c0": 0.06, "c1": 0.01},
        }
    frames = data(sensor, truth, 80, seed=3, span=span).frames
    scene = {"object": OBJECT} | truth
    density = with_discrepancy(collapsed_density(sensor, parse_scene(scene), frames), 0.05)
    z = np.empty(0)
    (centre,), (factor,), values = density.expansions(np.empty((1, 0)))
    top = of_coefficients(density, z, centre)
    logdet = float(np.log(np.abs(np.diagonal(factor))).sum())
    # of a climb 1e-3 nats may be left, and the integral counts them
    assert float(values.sum()) == pytest.approx(top - logdet, abs=2e-3)
    steps = 1e-3 * np.eye(centre.size)
    slopes = [
        (of_coefficients(density, z, centre + step) - of_coefficients(density, z, centre - step))
        / 2e-3
        for step in steps
    ]
    gain = 0.5 * float(np.sum(np.linalg.solve(factor.T, np.array(slopes)) ** 2))
    assert gain < 1e-3
