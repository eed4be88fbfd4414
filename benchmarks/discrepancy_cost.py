"""Cost of a density evaluation with a model discrepancy, against the plain collapsed density.

    python -m benchmarks.discrepancy_cost

Pulsed readings of a plate at a signal-to-noise ratio of 1000 at 1 m, crosstalk unknown, a stroke
as the prior of the ranges; 32 parameter vectors of the posterior a call; processor time, best of
five.
"""

import time

import numpy as np

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.posterior.sampling.start import find_optima
from simulator.discrepancy import DISCREPANCY_SD
from simulator.scene import parse_scene
from tests.posterior.scenes import UNKNOWN_CROSSTALK, data, sensor_of


def microseconds(density: CollapsedDensity, z: np.ndarray) -> float:
    """Return the processor time of one evaluation [us]."""
    times = []
    for _ in range(6):  # the first compiles
        begin = time.process_time()
        density(z)
        times.append(time.process_time() - begin)
    return 1e6 * min(times[1:]) / len(z)


def main() -> None:
    sensor = sensor_of("pulsed")
    scene = {
        "crosstalk": UNKNOWN_CROSSTALK,
        "range_m": {"prior": "stroke", "low": 0.02, "high": 15.0},
    }
    truth = {"crosstalk": [0.002, 0.01], "discrepancy": DISCREPANCY_SD}
    print("| frames | plain [us] | with discrepancy [us] | ratio |\n|---|---|---|---|")
    for n in (1, 12, 40, 200, 400):
        frames = data(sensor, truth, n).frames
        plain = collapsed_density(sensor, parse_scene(scene), frames)
        density = with_discrepancy(plain, DISCREPANCY_SD)
        rng = np.random.default_rng(n)
        best = find_optima(density, rng)[0]
        z = best.z + rng.standard_normal((32, best.z.size)) @ best.factor.T
        first, second = microseconds(plain, z), microseconds(density, z)
        print(f"| {n} | {first:.0f} | {second:.0f} | {second / first:.1f} |", flush=True)


if __name__ == "__main__":
    main()
