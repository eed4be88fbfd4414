"""Figure A-6: phase against distance of the conference paper's three techniques."""

import math
from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from simulator.optics.brdf import Material
from simulator.optics.emitters import Emitter, RaisedCosine
from simulator.optics.figures.style import axes, note
from simulator.optics.light import Modulation
from simulator.optics.radiometry import observe, observe_batch
from simulator.optics.surfaces import Rectangle
from simulator.optics.vectors import Pose

__all__ = ["FIGURES"]

Array = NDArray[np.float64]

_FREQUENCY = 5e6
_K = 4 * math.pi * _FREQUENCY / speed_of_light
_EMITTER = Emitter(pattern=RaisedCosine(cut_off_rad=math.pi / 2))
_MODULATION = Modulation(frequency_hz=_FREQUENCY)
_SAMPLE_S, _WINDOW = 1e-3, 10  # x_i - x_(i - window): the paper's moving-average difference
_NOISE = 2e-5  # of i and q, in Phi / (Phi0 A_D) [1/m^2]


def _person(distances: Array) -> NDArray[np.complex128]:
    """Return the phasors of a human-sized sheet, 1.5 m x 0.5 m."""
    sheets = [
        Rectangle(width_m=0.5, height_m=1.5, pose=Pose(position_m=(0.0, 0.0, float(d))))
        for d in distances
    ]
    lights = observe_batch(sheets, _EMITTER, modulation=_MODULATION, tolerance=1e-8)
    return np.array([light.phasor for light in lights])


def _distance_grid() -> tuple[Array, NDArray[np.complex128]]:
    grid = np.linspace(0.05, 3.2, 160)
    return grid, _person(grid)


def _at(r: Array, grid: Array, phasors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    # amplitude and phase vary smoothly: interpolate their logarithm
    logs = np.log(np.abs(phasors))
    phase = np.unwrap(np.angle(phasors))
    return np.asarray(
        np.exp(np.interp(np.log(r), np.log(grid), logs) + 1j * np.interp(r, grid, phase))
    )


def _figure_a_6(figure: Figure) -> None:
    rng = np.random.default_rng(6)
    grid, phasors = _distance_grid()
    pose = Pose(position_m=(0.0, 0.0, 0.4))
    can = Rectangle(width_m=0.1, height_m=0.1, pose=pose, material=Material(diffuse=0.7))
    scatter = observe(can, _EMITTER, modulation=_MODULATION).phasor
    power = -np.gradient(np.log(np.abs(phasors)), np.log(grid))

    def moving(speed: float) -> tuple[Array, NDArray[np.complex128], Array]:
        """Return distance, readings, and phase from the derivative of an approaching object."""
        step = speed * _SAMPLE_S
        count = int((3.0 - 0.3) / step)
        r = 3.0 - step * np.arange(count, dtype=np.float64)
        x = _at(r, grid, phasors) + scatter
        x = x + _NOISE * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
        change = x[_WINDOW:] - x[:-_WINDOW]
        middle = 0.5 * (r[_WINDOW:] + r[:-_WINDOW])
        # A'/A = -N/r turns the derivative by atan(k r / N) back (docs/model.md, appendix-a-23); it
        # approaches, so that the amplitude grows and the phase is not turned by pi
        n = np.interp(middle, grid, power)
        half = _WINDOW // 2
        return middle, x[half : half + middle.size], np.angle(change) + np.arctan(_K * middle / n)

    ax = axes(
        figure,
        "Figure A-6: phase v.s. distance transfer characteristics",
        "distance of the object of interest [m]",
        "phase [degrees]",
    )
    r = np.linspace(0.3, 3.0, 200)
    still = _at(r, grid, phasors)
    degrees = 180 / math.pi
    ideal = np.unwrap(np.angle(still)) * degrees
    slow_r, slow_x, slow_phase = moving(2.5)
    ax.plot(slow_r, slow_phase * degrees, "C1-", lw=0.6, label="vector differentiation, 2.5 m/s")
    fast_r, _, fast_phase = moving(20.0)
    ax.plot(fast_r, fast_phase * degrees, "r-", lw=1.2, label="vector differentiation, 20 m/s")
    ax.plot(r, np.angle(still + scatter) * degrees, "g-", label="conventional, with backscatter")
    # the static part is what is left after the moving one is taken away, whose phase the derivative
    # gives to noise / change, and to about 1e-3 in any case
    amplitude = np.abs(_at(slow_r, grid, phasors))
    n = np.interp(slow_r, grid, power)
    change = n * 2.5 * _SAMPLE_S * _WINDOW / slow_r
    weight = 1.0 / ((_NOISE / change) ** 2 + (1e-3 * amplitude) ** 2)
    modelled = amplitude * np.exp(1j * slow_phase)
    found = np.sum(weight * (slow_x - modelled)) / np.sum(weight)
    ax.plot(
        r,
        np.angle(still + scatter - found) * degrees,
        "b-",
        lw=1,
        label="static, calibrated by differentiation",
    )
    ax.plot(r, ideal, "k--", lw=1, label="ideal")
    ax.set_ylim(0, 45)
    ax.legend(fontsize=8)
    note(
        figure,
        "5 MHz; object 1.5 m x 0.5 m; backscatter: 0.1 m x 0.1 m of 70 % at 0.4 m; raised-cosine"
        f" emitter to 90°; 1 kHz frames, difference over {_WINDOW}; noise {_NOISE:g} 1/m²",
    )


FIGURES: dict[str, Callable[[Figure], None]] = {"A-6": _figure_a_6}
