"""How wrong the Object Parameter Model is, by class of scene.

The thesis reads a mean square as a percentage: its "average error below 0.1 %" is a root mean
square of 2.6 % with facet noise, 1 to 3 % without. The misfit is smooth along log r, so that it
does not average out over frames; inference takes its size and correlation length from here.

The table in ``misfit_table.py`` is made by ``python -m simulator.optics.misfit``.
"""

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from simulator.catalogue import APPENDIX_B, PlateScene
from simulator.optics.appendix_b import DISTANCES_M, sweep
from simulator.optics.misfit_table import ROWS
from simulator.optics.parametrisation import fit_object
from simulator.optics.radiometry import observe_batch
from simulator.optics.surfaces import Disk, Sphere
from simulator.optics.vectors import Pose

__all__ = ["Misfit", "measure", "misfit_curve", "model_misfit", "scene_classes"]

Array = NDArray[np.float64]

_TABLE = Path(__file__).with_name("misfit_table.py")


@dataclass(frozen=True, slots=True)
class Misfit:
    """Misfit of the model over the scenes of a class, each fitted on 0.01 to 1 m.

    Attributes
    ----------
    scene_class : str
        Name of the class; "all" is every scene of Appendix B that is no pure square law.
    scenes : int
        Number of scenes.
    rms, mean_absolute, worst : float
        Of the relative misfit Phi_model / Phi - 1.
    correlation_length : float
        In log r: lag at which the autocorrelation of the misfit has fallen to exp(-1/2); nan where
        the misfit is nothing but rounding.
    extrapolated : float
        Worst relative misfit of the same fit between 1 and 2 m.
    """

    scene_class: str
    scenes: int
    rms: float
    mean_absolute: float
    worst: float
    correlation_length: float
    extrapolated: float


def misfit_curve(range_m: Array, flux: Array) -> Array:
    """Return the relative misfit Phi_model / Phi - 1 of the fitted model at each range."""
    return np.asarray(fit_object(range_m, flux).flux(range_m) / flux - 1.0)


def _correlation_length(curves: Iterable[tuple[Array, Array]]) -> float:
    """Return the lag in log r at which the pooled autocorrelation falls to exp(-1/2)."""
    step, lags = 0.05, 40
    sums = np.zeros(lags)
    counts = np.zeros(lags)
    for ranges, misfit in curves:
        logs = np.log(ranges)
        grid = np.arange(logs[0], logs[-1], step)
        values = np.interp(grid, logs, misfit)
        for lag in range(min(lags, grid.size)):
            sums[lag] += float(values[: grid.size - lag] @ values[lag:])
            counts[lag] += grid.size - lag
    if sums[0] == 0.0:
        return math.nan
    correlation = sums / np.maximum(counts, 1.0) / (sums[0] / counts[0])
    level = math.exp(-0.5)
    below = np.flatnonzero(correlation < level)
    if below.size == 0:
        return math.nan
    i = int(below[0])
    share = (correlation[i - 1] - level) / (correlation[i - 1] - correlation[i])
    return step * (i - 1 + float(share))


def scene_classes() -> dict[str, list[PlateScene]]:
    """Return Appendix B's plates by class: shape, reflectance and tilt."""
    shapes = {"square": lambda a: a == 1, "oblong 4:1": lambda a: a == 4, "strip 16:1": None}
    surfaces = {"diffuse": "R00", "rough": "R05", "glossy": "R01"}
    classes: dict[str, list[PlateScene]] = {}
    for material, code in surfaces.items():
        for shape, test in shapes.items():
            classes[f"{material} {shape}"] = [
                scene
                for scene in APPENDIX_B
                if code in scene.code
                and (test or (lambda a: a == 16))(
                    round(max(scene.width_m, scene.height_m) / min(scene.width_m, scene.height_m))
                )
            ]
    for tilt, degrees in (("T00", 0), ("T12", 15), ("T06", 30), ("T04", 45)):
        classes[f"tilt {degrees}"] = [s for s in APPENDIX_B if tilt in s.code]
    classes["all"] = list(APPENDIX_B)
    return classes


def _round_sweeps() -> dict[str, list[tuple[Array, Array, Array, Array]]]:
    """Return disks and spheres, on which Appendix B is silent."""
    near, far = DISTANCES_M, np.linspace(1.0, 2.0, 11)
    result: dict[str, list[tuple[Array, Array, Array, Array]]] = {"disk": [], "sphere": []}
    for radius in (0.05, 0.1, 0.2, 0.4, 0.8):
        for name in result:
            sweeps = []
            for distances in (near, far):
                bodies: Sequence[Disk | Sphere]
                if name == "disk":
                    bodies = [
                        Disk(radius_m=radius, pose=Pose(position_m=(0, 0, float(d))))
                        for d in distances
                    ]
                else:
                    bodies = [
                        Sphere(radius_m=radius, centre_m=(0, 0, float(d) + radius))
                        for d in distances
                    ]
                lights = observe_batch(bodies, points=12)
                sweeps.append(np.array([light.distance_m for light in lights]))
                sweeps.append(np.array([light.flux for light in lights]))
            result[name].append((sweeps[0], sweeps[1], sweeps[2], sweeps[3]))
    return result


def _summary(name: str, sweeps: Sequence[tuple[Array, Array, Array, Array]]) -> Misfit:
    curves, beyond = [], [0.0]
    for ranges, flux, far_ranges, far_flux in sweeps:
        fit = fit_object(ranges, flux)
        curves.append((ranges, fit.flux(ranges) / flux - 1.0))
        beyond.append(float(np.max(np.abs(fit.flux(far_ranges) / far_flux - 1.0))))
    every = np.concatenate([misfit for _, misfit in curves])
    return Misfit(
        scene_class=name,
        scenes=len(curves),
        rms=float(np.sqrt(np.mean(every**2))),
        mean_absolute=float(np.mean(np.abs(every))),
        worst=float(np.max(np.abs(every))),
        correlation_length=_correlation_length(curves),
        extrapolated=max(beyond),
    )


def measure() -> tuple[Misfit, ...]:
    """Measure the misfit of every class on true rectangles, disks and spheres.

    Plates that are a square law to better than 0.1 % are left out of "all" and of the tilts: there
    is nothing to misfit, and nothing to identify.
    """
    far = np.linspace(1.0, 2.0, 11)
    sweeps = {
        scene.code: (
            *sweep(scene, "pulsed", converged=True),
            *sweep(scene, "pulsed", converged=True, distances_m=far),
        )
        for scene in APPENDIX_B
    }
    rows = []
    for name, scenes in scene_classes().items():
        chosen = [sweeps[scene.code] for scene in scenes]
        if name == "all" or name.startswith("tilt"):
            chosen = [s for s in chosen if np.max(np.abs(misfit_curve(s[0], s[1]))) > 1e-3]
        rows.append(_summary(name, chosen))
    rows += [_summary(name, chosen) for name, chosen in _round_sweeps().items()]
    return tuple(rows)


@functools.cache
def model_misfit() -> dict[str, Misfit]:
    """Return the committed table of misfits by class of scene.

    Returns
    -------
    dict of str to Misfit
        "all" holds the default size of a discrepancy term, ``rms``, and its
        ``correlation_length`` in log r.
    """
    return {row[0]: Misfit(*row) for row in ROWS}


def _write() -> None:
    lines = [
        '"""Measured by ``python -m simulator.optics.misfit``; columns are those of `Misfit`."""',
        "",
        '__all__ = ["ROWS"]',
        "",
        "ROWS: tuple[tuple[str, int, float, float, float, float, float], ...] = (",
    ]
    for row in measure():
        name, scenes, *numbers = astuple(row)
        digits = ", ".join(repr(float(f"{number:.4g}")) for number in numbers)
        lines.append(f'    ("{name}", {scenes}, {digits}),')
    _TABLE.write_text("\n".join([*lines, ")", ""]), encoding="utf-8")


if __name__ == "__main__":
    _write()
