"""Windows and phasors against direct integration of the waveforms in time (2.30 to 2.41)."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from simulator.catalogue import plate_scene
from simulator.optics.appendix_b import sweep
from simulator.optics.light import Modulation
from simulator.optics.radiometry import observe
from simulator.optics.surfaces import Rectangle
from simulator.optics.vectors import Pose

Array = NDArray[np.float64]

PLATE = Rectangle(width_m=2.0, height_m=1.0, pose=Pose(position_m=(0.2, 0.1, 0.6)))


def _elements(order: int = 160) -> tuple[Array, Array]:
    """Return range and dPhi of the plate's elements, by plain Gauss-Legendre in the plane."""
    x, w = np.polynomial.legendre.leggauss(order)
    u, v = np.meshgrid(0.2 + 1.0 * x, 0.1 + 0.5 * x, indexing="ij")
    weight = np.outer(1.0 * w, 0.5 * w)
    z = 0.6
    r = np.sqrt(u * u + v * v + z * z)
    return r, weight * z**3 / r**7 / (2 * math.pi**2)


def test_windows_are_the_integrals_of_the_delayed_pulse() -> None:
    """The late window opens when the pulse ends; T_p is short enough for light to be all late."""
    pulse = 2 * 0.9 / speed_of_light  # r0 = 0.9 m, within the plate's ranges
    r, flux = _elements()
    delay = 2 * r / speed_of_light
    assert float(np.min(delay)) < pulse < float(np.max(delay))
    # overlap of [delay, delay + T_p] with [T_p, infinity), and the whole
    start = np.maximum(delay, pulse)
    late = float(np.sum(flux * (delay + pulse - start)))
    whole = float(np.sum(flux)) * pulse
    light = observe(PLATE, modulation=Modulation(pulse_width_s=pulse))
    assert light.flux * pulse == pytest.approx(whole, rel=1e-10)
    # the kink at tau = T_p limits the plain rule
    assert light.late * pulse == pytest.approx(late, rel=3e-5)


def test_late_window_in_time() -> None:
    """The same by sampling the waveform itself: a square pulse integrated over the late window."""
    pulse = 2 * 0.9 / speed_of_light
    r, flux = _elements(40)
    times = np.linspace(0, 4 * pulse, 40_001)
    delay = (2 * r / speed_of_light).ravel()
    order = np.argsort(delay)
    # Phi(t) = sum of dPhi with delay <= t < delay + T_p, from the cumulative sum over delays
    cumulative = np.concatenate([[0.0], np.cumsum(flux.ravel()[order])])

    def arrived(t: Array) -> Array:
        return cumulative[np.searchsorted(delay[order], t, side="right")]

    power = arrived(times) - arrived(times - pulse)
    step = float(times[1] - times[0])
    late = float(np.sum(power[times >= pulse])) * step
    whole = float(np.sum(power)) * step
    light = observe(PLATE, modulation=Modulation(pulse_width_s=pulse))
    # Riemann sums over 10^4 steps a pulse
    assert late / whole == pytest.approx(light.late / light.flux, rel=1e-3)


@pytest.mark.parametrize("frequency", [5e6, 60e6])
def test_phasor_is_the_demodulated_sine(frequency: float) -> None:
    """x = (2/T) int Phi(t) exp(j w t) dt with light emitted as cos(w t), over whole periods."""
    r, flux = _elements()
    omega = 2 * math.pi * frequency
    periods, steps = 3, 64
    t = np.arange(periods * steps) / (steps * frequency)
    received = np.array(
        [float(np.sum(flux * np.cos(omega * (s - 2 * r / speed_of_light)))) for s in t]
    )
    i = 2 * float(np.mean(received * np.cos(omega * t)))
    q = 2 * float(np.mean(received * np.sin(omega * t)))
    modulation = Modulation(frequency_hz=frequency)
    light = observe(PLATE, modulation=modulation)
    assert light.phasor.real == pytest.approx(i, rel=1e-9)
    assert light.phasor.imag == pytest.approx(q, rel=1e-9)
    k = 4 * math.pi * frequency / speed_of_light
    assert light.phase_distance_m(modulation) == pytest.approx(math.atan2(q, i) % (2 * math.pi) / k)


def test_long_pulse_and_low_frequency_agree() -> None:
    pulsed, sine = Modulation(pulse_width_s=1e-6), Modulation(frequency_hz=1e3)
    light = observe(PLATE, modulation=pulsed)
    assert light.pulse_distance_m(pulsed) == pytest.approx(light.distance_m, rel=1e-12)
    assert observe(PLATE, modulation=sine).phase_distance_m(sine) == pytest.approx(
        light.distance_m, rel=1e-8
    )


def test_beyond_r0_everything_is_late() -> None:
    modulation = Modulation(pulse_width_s=1e-9)  # r0 = 15 cm
    light = observe(PLATE, modulation=modulation)
    assert light.late == pytest.approx(light.flux, rel=1e-12)
    assert light.pulse_distance_m(modulation) == pytest.approx(modulation.r0)


def test_appendix_b_sine_distance_is_that_of_the_phasor() -> None:
    scene = plate_scene("W08H08R00T06")
    ranges, flux = sweep(scene, "sine_wave", converged=True, distances_m=np.array([0.3, 1.0]))
    pulsed, _ = sweep(scene, "pulsed", converged=True, distances_m=np.array([0.3, 1.0]))
    # arg of a sum over a spread of phases k (r - r_e) differs from the mean by their third moment
    assert ranges == pytest.approx(pulsed, rel=1e-2)
    assert np.all(flux > 0)
