"""Flux, effective distance and phasor of a surface: the interface to the quadrature.

Everything is per Phi0 A_D [1/m^2], so that a sensor's gain turns it into readings.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.errors import InvalidInputError
from simulator.optics import marks as kinds
from simulator.optics.brdf import pack_material
from simulator.optics.charts import build_chart
from simulator.optics.detectors import Detector
from simulator.optics.emitters import Emitter, Narrow
from simulator.optics.light import Light, Modulation, Status, dark
from simulator.optics.narrow import observe_narrow
from simulator.optics.quadrature import GAUSS_KRONROD, gauss_rule, integrate
from simulator.optics.rays import COMPONENTS
from simulator.optics.round_charts import shell_chart
from simulator.optics.surfaces import Disk, Plane, Rectangle, Shell, Sphere, pack_surface

__all__ = [
    "observe",
    "observe_batch",
    "observe_shell",
    "shadow",
]

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Points = int | tuple[int, int]
AnySurface = Rectangle | Disk | Plane | Sphere

_STATUS: dict[int, Status] = {
    kinds.LIT: "lit",
    kinds.EDGE_ON: "edge_on",
    kinds.OPPOSITE: "opposite_faces",
    kinds.OUT_OF_VIEW: "out_of_view",
}


@compiled
def _observe_many(
    surfaces: Array,
    head: Array,
    table: Array,
    materials: Array,
    backdrop: Array,
    signal: Array,
    rules: tuple[Array, Array],
    tolerance: float,
) -> tuple[Array, Array, Counts]:
    count = surfaces.shape[0]
    values = np.zeros((count, COMPONENTS))
    errors = np.zeros(count)
    states = np.zeros((count, 2), dtype=np.int64)
    late = 1.0 / signal[1] if signal[1] > 0.0 else 0.0
    for i in range(count):
        if surfaces.shape[1] == 0:
            status, chart, region, marks = shell_chart(backdrop, head)
        else:
            status, chart, region, marks = build_chart(surfaces[i], head, table, materials[i], late)
        states[i, 0] = status
        if status != 0:
            continue
        here = signal.copy()
        here[2] = 1.0 / math.hypot(chart[15], math.hypot(chart[16], chart[17]))
        if surfaces.shape[1] == 0:
            here[2] = 1.0 / backdrop[3]
        value, error, rays = integrate(
            chart, head, table, materials[i], backdrop, here, rules, region, marks, tolerance
        )
        values[i] = value
        values[i, 1] /= here[2]
        errors[i] = error
        states[i, 1] = rays
        if rays == 0:
            states[i, 0] = 3
    return values, errors, states


def _pack_head(emitter: Emitter, detector: Detector) -> tuple[Array, Array]:
    pattern, table = emitter.pattern.pack()
    head = np.concatenate(
        [emitter.position_m, emitter.aim, detector.position_m, detector.normal, pattern]
    )
    return head, table


def _pack_shell(shell: Shell, emitter: Emitter, detector: Detector) -> Array:
    centre = np.array(shell.centre_m)
    position_e, position_d = np.array(emitter.position_m), np.array(detector.position_m)
    for position, name in ((position_e, "emitter"), (position_d, "detector")):
        if float(np.linalg.norm(position - centre)) >= shell.radius_m:
            raise InvalidInputError.at("/background/radius_m", f"the {name} lies outside the shell")
    return np.concatenate(
        [position_d - centre, [shell.radius_m], centre - position_e, pack_material(shell.material)]
    )


def _pack(modulation: Modulation) -> Array:
    return np.array(
        [modulation.wave_number, 1.0 / modulation.r0 if modulation.r0 > 0 else 0.0, 1.0]
    )


def _rules(points: Points | None) -> tuple[Array, Array]:
    if points is None:
        return GAUSS_KRONROD, GAUSS_KRONROD
    outer, inner = points if isinstance(points, tuple) else (points, points)
    if not (1 <= outer <= 1000 and 1 <= inner <= 1000):
        raise InvalidInputError.at("/points", "must be between 1 and 1000")
    return gauss_rule(outer), gauss_rule(inner)


def _lights(values: Array, errors: Array, states: Counts, modulation: Modulation) -> list[Light]:
    lights = []
    for value, error, (state, _) in zip(values, errors, states, strict=True):
        if state == kinds.INSIDE:
            raise InvalidInputError.at("/surface", "emitter or detector lies inside the sphere")
        flux = float(value[0])
        status = _STATUS[int(state)]
        if flux == 0.0:
            lights.append(dark("dark" if status == "lit" else status))
            continue
        lights.append(
            Light(
                flux=flux,
                distance_m=float(value[1]) / flux,
                late=float(value[2]) if modulation.r0 > 0 else math.nan,
                phasor=(
                    complex(value[3], value[4])
                    if modulation.wave_number > 0
                    else complex(math.nan, math.nan)
                ),
                error=float(error) / flux,
                status=status,
            )
        )
    return lights


def observe_batch(
    surfaces: Sequence[AnySurface],
    emitter: Emitter | None = None,
    detector: Detector | None = None,
    modulation: Modulation | None = None,
    *,
    tolerance: float = 1e-11,
    points: Points | None = None,
) -> list[Light]:
    """Return what each of several surfaces would send on its own.

    Parameters
    ----------
    surfaces : sequence of Rectangle, Disk, Plane or Sphere
        Surfaces, or one surface at several poses.
    emitter, detector : optional
        Defaults: a uniform emitter and a detector at the origin, along +z.
    modulation : Modulation, optional
        Default: neither pulse nor sine wave; flux and distance only.
    tolerance : float
        Relative, of the flux.
    points : int or (int, int), optional
        Fixed Gauss rules of that many points (across rays, along a ray) a piece instead of adaptive
        quadrature.

    Returns
    -------
    list of Light
        One for each surface.

    Raises
    ------
    InvalidInputError
        If emitter or detector lies inside a sphere.
    """
    emitter, detector = emitter or Emitter(), detector or Detector()
    modulation = modulation or Modulation()
    if not surfaces:
        return []
    if isinstance(emitter.pattern, Narrow):
        return [observe_narrow(s, emitter, detector, modulation) for s in surfaces]
    rows = np.vstack([pack_surface(s) for s in surfaces])
    materials = np.vstack([pack_material(s.material) for s in surfaces])
    head, table = _pack_head(emitter, detector)
    values, errors, states = _observe_many(
        rows, head, table, materials, np.empty(0), _pack(modulation), _rules(points), tolerance
    )
    return _lights(values, errors, states, modulation)


def observe(
    surface: AnySurface,
    emitter: Emitter | None = None,
    detector: Detector | None = None,
    modulation: Modulation | None = None,
    *,
    tolerance: float = 1e-11,
    points: Points | None = None,
) -> Light:
    """Return what a surface sends to the detector; see `observe_batch`."""
    return observe_batch(
        [surface], emitter, detector, modulation, tolerance=tolerance, points=points
    )[0]


def _backdrop_sums(
    rows: Array,
    shell: Shell,
    emitter: Emitter,
    detector: Detector,
    modulation: Modulation,
    tolerance: float,
) -> list[Light]:
    if isinstance(emitter.pattern, Narrow):
        raise InvalidInputError.at(
            "/emitter/pattern", "a narrow beam lights one point, not a background"
        )
    head, table = _pack_head(emitter, detector)
    backdrop = _pack_shell(shell, emitter, detector)
    materials = np.tile(pack_material(shell.material), (rows.shape[0], 1))
    values, errors, states = _observe_many(
        rows, head, table, materials, backdrop, _pack(modulation), _rules(None), tolerance
    )
    return _lights(values, errors, states, modulation)


def observe_shell(
    shell: Shell,
    emitter: Emitter | None = None,
    detector: Detector | None = None,
    modulation: Modulation | None = None,
    *,
    tolerance: float = 1e-11,
) -> Light:
    """Return what the bare shell sends: the background without an object (3.27).

    Raises
    ------
    InvalidInputError
        If emitter or detector lies outside the shell.
    """
    emitter, detector = emitter or Emitter(), detector or Detector()
    modulation = modulation or Modulation()
    return _backdrop_sums(np.empty((1, 0)), shell, emitter, detector, modulation, tolerance)[0]


def shadow(
    surface: AnySurface,
    shell: Shell,
    emitter: Emitter | None = None,
    detector: Detector | None = None,
    modulation: Modulation | None = None,
    *,
    tolerance: float = 1e-11,
) -> Light:
    """Return what a surface hides of the shell: the integral over its silhouette (3.28).

    Raises
    ------
    InvalidInputError
        If emitter and detector are not at one point: a shell point is then dark where either of
        two silhouettes covers it, which is not the integral over one.
    """
    emitter, detector = emitter or Emitter(), detector or Detector()
    modulation = modulation or Modulation()
    if emitter.position_m != detector.position_m:
        raise InvalidInputError.at(
            "/background", "the exact shadow needs emitter and detector at one point"
        )
    rows = pack_surface(surface)[None, :]
    return _backdrop_sums(rows, shell, emitter, detector, modulation, tolerance)[0]
