"""Speed of the optical simulator, as ratios to the slow and obvious way.

Run: python -m benchmarks.optics.speed
"""

import csv
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import integrate

from simulator.catalogue import APPENDIX_B, plate_scene
from simulator.optics.appendix_b import DISTANCES_M, simulate, sweep
from simulator.optics.radiometry import observe, observe_batch

PRINTED = Path(__file__).parents[2].parent / "shared" / "data" / "appendix_b_pulsed.csv"


SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("10 x 10 a piece", {"points": 10}),
    ("adaptive to 1e-8", {"tolerance": 1e-8}),
    ("adaptive to 1e-11", {"tolerance": 1e-11}),
)


def cpu(function: Callable[[], object], repeats: int = 3) -> float:
    """Return the least CPU time of several calls [s]; the first one compiles."""
    function()
    times: list[float] = []
    for _ in range(repeats):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def reference_flux(width: float, height: float, z: float) -> float:
    """scipy's adaptive quadrature of the kernel of a facing diffuse rectangle."""

    def kernel(y: float, x: float) -> float:
        return float(z**3 / (2 * np.pi**2 * (x * x + y * y + z * z) ** 3.5))

    return float(
        4 * integrate.dblquad(kernel, 0, width / 2, 0, height / 2, epsabs=0, epsrel=1e-10)[0]
    )


def main() -> None:
    plates = [plate_scene("W04H08R00T00").plate(float(d)) for d in np.logspace(-2, 0, 400)]
    glossy = [plate_scene("W04H08R01T00").plate(float(d)) for d in np.logspace(-2, 0, 400)]
    baseline = cpu(lambda: reference_flux(0.4, 0.8, 0.3))
    exact = observe_batch(plates, tolerance=1e-13)
    print(f"scipy dblquad of one diffuse rectangle to 1e-10: {baseline * 1e6:.0f} us (baseline)")
    agreement = observe(plate_scene("W04H08R00T00").plate(0.3)).flux / reference_flux(0.4, 0.8, 0.3)
    print(f"  agreement {abs(agreement - 1):.1e}")
    for name, bodies in (("diffuse", plates), ("Beckmann m = 0.1", glossy)):
        for label, arguments in SETTINGS:
            seconds = cpu(partial(observe_batch, bodies, **arguments)) / len(bodies)
            line = f"{name}, {label}: {seconds * 1e6:.0f} us a rectangle, batched"
            if name == "diffuse":
                lights = observe_batch(bodies, **arguments)
                worst = max(abs(a.flux / b.flux - 1) for a, b in zip(lights, exact, strict=True))
                line += f", {baseline / seconds:.0f} times the baseline, worst error {worst:.1e}"
            print(line)

    print(f"\n{len(APPENDIX_B)} scenes at {DISTANCES_M.size} distances, CPU time:")
    for system in ("pulsed", "sine_wave"):
        facets = cpu(lambda s=system: list(simulate(s)), 1)  # type: ignore[misc]
        true = cpu(lambda s=system: list(simulate(s, converged=True)), 1)  # type: ignore[misc]
        print(f"  {system}: facets {facets:.2f} s, true rectangles {true:.2f} s")
    worst = 0.0
    for scene in APPENDIX_B[::5]:
        _, flux = sweep(scene, "pulsed", converged=True, distances_m=DISTANCES_M[::8])
        lights = observe_batch([scene.plate(float(d)) for d in DISTANCES_M[::8]], tolerance=1e-12)
        worst = max(worst, *(abs(f / s.flux - 1) for f, s in zip(flux, lights, strict=True)))
    print(f"  worst error of the true rectangles' fixed rule: {worst:.1e}")
    if PRINTED.exists():
        with PRINTED.open() as file:
            printed = {row["code"]: row for row in csv.DictReader(file)}
        same = sum(
            row.printed()[1:]
            == tuple(f"{float(printed[row.code][n]):.2E}" for n in ("c0", "c1", "c2", "error"))
            for row in simulate("pulsed")
        )
        print(f"\nAppendix B pulsed: {same} of 108 rows equal in every printed digit")


if __name__ == "__main__":
    main()
