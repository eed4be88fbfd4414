"""How the light of the optical simulator errs against time, by knobs of its own."""

import functools
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from service.report.cells import Effort
from service.report.clock import best, peak_bytes
from service.report.row import Costs, Row
from service.report.scores import Scores
from simulator.catalogue import plate_scene
from simulator.optics.brdf import pack_material
from simulator.optics.facets import ELLIPSE, facet_plate, facet_polar_grid
from simulator.optics.radiometry import observe_batch

__all__ = ["LIGHT", "light_rows"]

Array = NDArray[np.float64]

LIGHT = "Light of a glossy plate, made by the optical simulator"
_PLATE = plate_scene("W04H08R05T06")
_POINTS = (2, 3, 4, 6, 8, 12, 16)
_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
_FACETS = (10, 20, 50, 100, 200)
# many more, whose sum stands for the limit: facets have an outline of their own
_FINE = 800


def light_rows(effort: Effort) -> Iterator[Row]:
    """Measure the light of a plate at 40 distances by fixed rules, adaptive rules and facets.

    Parameters
    ----------
    effort : Effort
        A quick one leaves out every other value of the knobs.

    Yields
    ------
    Row
        Errors are of the flux, relative to what many more points or facets give.
    """
    distances = np.geomspace(0.05, 2.0, 40)
    plates = [_PLATE.plate(distance) for distance in distances.tolist()]
    every = 1 if effort.draws else 2

    def by_points(points: int) -> Array:
        return np.array([light.flux for light in observe_batch(plates, points=points)])

    def adaptive(tolerance: float) -> Array:
        return np.array([light.flux for light in observe_batch(plates, tolerance=tolerance)])

    def facets(count: int) -> Array:
        theta, step = facet_polar_grid(count)
        size = (0.5 * _PLATE.width_m, 0.5 * _PLATE.height_m)
        material = pack_material(_PLATE.material)
        sums = facet_plate(distances, _PLATE.tilt_rad, *size, ELLIPSE, material, 0.0, theta, step)
        return np.asarray(sums[:, 0])

    exact, limit = adaptive(1e-13), facets(_FINE)
    for points in _POINTS[::every]:
        rule = functools.partial(by_points, points)
        yield _row("fixed rules", f"{points} points", points, exact, rule)
    for tolerance in _TOLERANCES[::every]:
        rule = functools.partial(adaptive, tolerance)
        yield _row("adaptive rules", f"tolerance {tolerance:.0e}", -tolerance, exact, rule)
    for count in _FACETS[::every]:
        rule = functools.partial(facets, count)
        yield _row("facets", f"{count} x {count} facets", count, limit, rule)


def _row(method: str, knob: str, order: float, exact: Array, action: Callable[[], Array]) -> Row:
    flux, seconds = best(action)
    error = np.abs(flux / exact - 1.0)
    median, tail = np.quantile(error, [0.5, 0.95]).tolist()
    costs = Costs(frame_s=seconds / exact.size, run_s=seconds, peak_bytes=peak_bytes(action))
    scores = Scores(median, tail, None, None, 1.0, 0.0, 0.0)
    return Row(LIGHT, method, "light", "", knob, float(order), exact.size, scores, costs)
