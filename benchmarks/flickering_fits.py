"""Fits of a source that flickers with all of its light, behind unknown crosstalk.

    python -m benchmarks.flickering_fits [--sets 8]

40 frames of an object of which nothing is said, as exactly as the model, and eight without it;
the crosstalk is as bright as the middle frame's light, the noise a thousandth of that, and the
source flickers by half a percent (`"relative_of": "source"`). A line a sensor: ranges that are
told, those within 1.645 standard deviations, the farthest, and fits that say misfit.
"""

import argparse
from typing import Any

import numpy as np

from inference.estimate import estimate
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 3e-8},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7},
}
CROSSTALK = {"pulsed": (0.2, 1.0), "sine_wave": (0.8, -0.6)}
FRAMES, EMPTY, SNR, FLICKER = 40, 8, 1000.0, 5e-3
_Z = 1.6448536269514722


def asked(kind: str, seed: int) -> tuple[Any, bool]:
    """Return how far ranges are off in their standard deviations, and whether misfit is said."""
    rng = np.random.default_rng([5, seed])
    low = float(np.exp(rng.uniform(np.log(0.15), np.log(0.4))))
    high = low * float(np.exp(rng.uniform(np.log(2.5), np.log(5.0))))
    ranges = np.geomspace(low, high, FRAMES)
    c0, c1, c2 = 0.06 * float(np.exp(0.5 * rng.standard_normal())), 0.04, 0.1
    middle = float(np.median(c0 * c2 / (ranges**2 * (ranges**2 + c1 * ranges + c0))))
    noise = {"read": [middle / SNR] * 2, "relative": FLICKER, "relative_of": "source"}
    sensor = parse_sensor({**KINDS[kind], "noise": noise})
    crosstalk = [middle * part for part in CROSSTALK[kind]]
    truth = {"object": {"c0": c0, "c1": c1, "c2": c2}, "crosstalk": crosstalk, "discrepancy": 0}
    path = SampledTrajectory(
        range_m=[1.0] * EMPTY + ranges.tolist(),
        object_present=[False] * EMPTY + [True] * FRAMES,
    )
    frames = simulate(sensor, parse_scene(truth), path, rng).frames
    wide = {"prior": "normal", "mean": 0.0, "sd": 3 * middle}
    scene = parse_scene({"crosstalk": [wide, wide]})
    (result,) = estimate(sensor, scene, frames, ["joint_fit"]).results
    off = (result.range_m[EMPTY:] - ranges) / result.sd_m[EMPTY:]
    return off, bool(result.fit and result.fit["misfit"])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=8)
    sets = parser.parse_args().sets
    print("| sensor | told | held | farthest [sd] | misfit |\n|---|---|---|---|---|")
    for kind in KINDS:
        found = [asked(kind, seed) for seed in range(sets)]
        off = np.abs(np.concatenate([each for each, _ in found]))
        off, count = off[np.isfinite(off)], off.size
        print(
            f"| {kind} | {off.size} of {count} | {np.mean(off < _Z):.0%} | {off.max():.1f} "
            f"| {sum(misfit for _, misfit in found)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
