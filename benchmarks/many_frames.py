"""Time of the joint fit by number of frames, beside that where numpy solves frame by frame.

    python -m benchmarks.many_frames [--frames 100 300 1000]

An object that moves away from 0.15 to 1.5 m before crosstalk, both unknown and nothing else stated.
Systems of two equations and triangles are made by `inference.fits.likelihood.pairs` and
`triangle_of`, and by turns by `numpy.linalg`, one frame after the other.
"""

import argparse
import contextlib
import time
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.fits.answer import model_checks
from inference.fits.likelihood import erring, erring_climb, erring_point
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

__all__ = ["by_library", "timed"]

Array = NDArray[np.float64]

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-4, 1e-3]}})
SD = (0.01, 0.05)
OBJECT = {"c0": 0.08, "c1": 0.05, "c2": 0.1}


@contextlib.contextmanager
def by_library() -> Iterator[None]:
    """Let fits solve by `numpy.linalg`."""

    def solved(matrices: Array, parts: Array) -> Array:
        return np.asarray(np.linalg.solve(matrices, parts))

    def triangle(rows: Array) -> Array:
        return np.asarray(np.linalg.qr(rows, mode="r"))

    parts: list[tuple[Any, str, Any]] = [
        (erring_point, "solved", solved),
        (erring_point, "solved_by_root", solved),
        (erring_point, "cholesky", np.linalg.cholesky),
        (erring, "solved", solved),
        (model_checks, "solved_by_root", solved),
        (erring_climb, "triangle_of", triangle),
    ]
    with contextlib.ExitStack() as stack:
        for module, name, function in parts:
            stack.enter_context(mock.patch.object(module, name, function))
        yield


def timed(frames: int) -> tuple[float, Array]:
    """Fit frames; return processor time [s] and ranges [m], shape (n,)."""
    truth = parse_scene({"object": OBJECT, "crosstalk": [0.004, 0.02]})
    path = RadialTrajectory(from_m=0.15, to_m=1.5, frames=frames, spacing="log")
    readings = simulate(SENSOR, truth, path, seed=1).frames
    scene = parse_scene({"crosstalk": [{"prior": "halfnormal", "sd": sd} for sd in SD]})
    began = time.process_time()
    (result,) = estimate(SENSOR, scene, readings, ["joint_fit"]).results
    return time.process_time() - began, result.range_m


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, nargs="+", default=[100, 300, 1000])
    args = parser.parse_args()
    timed(20)  # which makes machine code
    print("| frames | joint fit | by numpy | ratio | ranges differ by |")
    print("|---|---|---|---|---|")
    for frames in args.frames:
        here, ranges = timed(frames)
        with by_library():
            there, others = timed(frames)
        apart = float(np.nanmax(np.abs(ranges / others - 1.0)))
        print(f"| {frames:,} | {here:.1f} s | {there:.1f} s | {here / there:.2f} | {apart:.0e} |")


if __name__ == "__main__":
    main()
