"""The tracker: what frames that are stated empty, and are not, do to crosstalk that is learnt.

    python -m benchmarks.stated_empty [--tracks 20]

Some frames that are stated empty, then an object that comes from 1.2 m to 0.36 m in 60 frames at
30 Hz, exactly as stated; a pulse of 100 ns and a sine wave of 5 MHz in turn, a signal-to-noise
ratio of 100 to 1,000 at 1 m, crosstalk known to a thousand noises. Some of the frames stated empty
are off by so many noises, in any direction. A track is off in silence where a range lies more than
five standard deviations off in a frame without misfit.
"""

import argparse
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.track import track
from simulator.frames import Frames
from tests.posterior.scenes import KINDS
from tests.tracking.scenes import PLATE, read, scene_of, sensor_of

__all__ = ["FAULTS", "Off", "followed"]

Array = NDArray[np.float64]
CROSSTALK = np.array([0.01, 0.02])
WAY = np.geomspace(1.2, 0.36, 60)
NOISES = (10.0, 100.0, 1000.0)
SIGNAL = 7.72e-3  # of the plate at 1 m


class Fault(NamedTuple):
    """Which of the frames stated empty are off."""

    empty: int
    off: tuple[int, ...]
    stays: bool = False  # whether what is off is the crosstalk from then on


FAULTS = {
    "none of 25": Fault(25, ()),
    "none of 5": Fault(5, ()),
    "one of 25": Fault(25, (12,)),
    "the first of 25": Fault(25, (0,)),
    "the last of 25": Fault(25, (24,)),
    "three in the middle of 25": Fault(25, (11, 12, 13)),
    "the last three of 25": Fault(25, (22, 23, 24)),
    "one of 5": Fault(5, (2,)),
    "the first of 3": Fault(3, (0,)),
    "the first of 2": Fault(2, (0,)),
    "the only one": Fault(1, (0,)),
    "changed before the last 13 of 25": Fault(25, tuple(range(12, 25)), stays=True),
    "changed before the last 3 of 25": Fault(25, (22, 23, 24), stays=True),
    "changed before the last of 25": Fault(25, (24,), stays=True),
}


class Off(NamedTuple):
    """What a track says."""

    told: int  # frames of the object with one range, without misfit
    silent: int  # of these how many lie more than five standard deviations off
    worst: float  # standard deviations that one of them is off at most
    crosstalk: float  # standard deviations that crosstalk is off after the frames stated empty
    wide: float  # median of relative standard deviations of ranges
    misfit: bool  # whether it is said in any of them, or of the object


def followed(fault: Fault, noises: float, seed: int) -> Off:
    """Follow one track."""
    rng = np.random.default_rng([seed, 17])
    noise = SIGNAL / float(np.exp(rng.uniform(np.log(100.0), np.log(1000.0))))
    sensor = sensor_of(noise, sorted(KINDS)[seed % 2])
    ranges = np.concatenate([np.full(fault.empty, np.inf), WAY])
    crosstalk = np.tile(CROSSTALK, (ranges.size, 1))
    turn = rng.uniform(0.0, 2.0 * np.pi)
    aside = noises * noise * np.array([np.cos(turn), np.sin(turn)])
    readings = read(sensor, scene_of(PLATE), ranges, rng)
    for frame in fault.off:
        readings[frame] += aside
    if fault.stays:
        readings[fault.empty :] += aside
        crosstalk[fault.off[0] :] += aside
    time_s = np.arange(ranges.size, dtype=np.float64) / 30.0
    there = np.arange(ranges.size) >= fault.empty
    frames = Frames(readings + CROSSTALK, time_s=time_s, object_present=there)
    prior = {"prior": "normal", "mean": 0.0, "sd": 1000.0 * noise}
    found = track(sensor, scene_of(PLATE, crosstalk=[prior, prior]), frames)
    assert found.crosstalk is not None
    assert found.crosstalk_sd is not None
    one = np.isfinite(found.range_m) & there
    off = (np.abs(found.range_m - ranges) / found.sd_m)[one & ~found.misfit]
    last = fault.empty - 1
    beside = np.abs(found.crosstalk[last] - crosstalk[last]) / found.crosstalk_sd[last]
    return Off(
        off.size,
        int((off > 5.0).sum()),
        float(off.max(initial=0.0)),
        float(beside.max()),
        float(np.median(found.sd_m[one] / ranges[one])) if one.any() else np.nan,
        bool(found.misfit.any()),
    )


def line(fault: str, noises: float, results: list[Off]) -> str:
    """Return what so many tracks say, in words."""
    told, silent, worst, crosstalk, wide, misfit = np.array(results).T
    text = f"{fault:34s} {noises:5.0f} noises: {(silent > 0).sum():3d} of {silent.size} off"
    text += f" in silence, by {worst.max():5.1f} sd at most; told {told.mean() / WAY.size:4.0%},"
    text += f" {np.nanmedian(wide):7.3%} wide; crosstalk {crosstalk.max():7.1f} sd off at most;"
    return text + f" misfit in {misfit.sum():3.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=20)
    seeds = range(parser.parse_args().tracks)
    for name, fault in FAULTS.items():
        for noises in NOISES if fault.off else (0.0,):
            print(line(name, noises, [followed(fault, noises, s) for s in seeds]), flush=True)


if __name__ == "__main__":
    main()
