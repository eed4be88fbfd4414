"""Fits of readings that a driver has smoothed over frames, which nothing states.

    python -m benchmarks.smoothed_readings [--sets 12]

24 to 60 frames of a sine wave's object as exactly as the model, of which nothing is said, on its
way away or there and back, at signal-to-noise ratios of 100 to 1000; in most sets behind unknown
crosstalk, in some after five empty frames. The driver hands on an exponential moving average of i
and q, as of so many frames. Stated is the noise of the readings before it, or what a sensor at
rest shows behind it. A line each: fits that say misfit, others whose `assumptions` say that frames
scatter less than their noise, how far the worst frame of those is off that say neither, and sets
whose readings say so by themselves, whatever is asked of them.
"""

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.fits.answer.smoothed import SMOOTHED
from inference.smoothed_readings import smoothed_readings
from simulator.constants import SPEED_OF_LIGHT
from simulator.frames import Frames
from simulator.object_arrays import object_fluxes
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

FREQUENCY_HZ, BEFORE = 2e7, 40
WAYS = ((1, "before"), (3, "before"), (4, "before"), (8, "before"), (4, "behind"), (8, "behind"))


def smoothed(readings: Array, share: float) -> Array:
    """Return the exponential moving average of readings with a share of each new one."""
    out = readings.copy()
    for i in range(1, len(out)):
        out[i] = (1.0 - share) * out[i - 1] + share * readings[i]
    return out


def asked(seed: int, over: int, stated: str) -> tuple[bool, bool, float, bool]:
    """Return what a set says, and its worst frame [sd].

    That is whether it says misfit, or that frames scatter too little about the fit; at the end
    whether its readings differ too little from frame to frame.
    """
    rng = np.random.default_rng([9, seed])
    n = int(rng.integers(24, 60))
    low = float(np.exp(rng.uniform(np.log(0.15), np.log(0.5))))
    high = low * float(np.exp(rng.uniform(np.log(1.5), np.log(4.0))))
    t = np.linspace(0.0, 1.0, n)
    ranges = low * (high / low) ** (t if rng.random() < 0.67 else np.sin(np.pi * t) ** 2)
    c0 = 0.06 * float(np.exp(0.7 * rng.standard_normal()))
    flux = object_fluxes(ranges, 0.1 * c0, c0, 0.0)
    middle, snr = float(np.median(flux)), float(10 ** rng.uniform(2.0, 3.0))
    phase = 4.0 * np.pi * FREQUENCY_HZ / SPEED_OF_LIGHT * ranges
    seen = flux[:, None] * np.column_stack([np.cos(phase), np.sin(phase)])
    behind, empty = rng.random() < 0.7, int(rng.choice([0, 5]))
    crosstalk = 0.2 * middle * rng.standard_normal(2) * behind
    empty *= int(behind)
    share, parts = 2.0 / (over + 1.0), []
    # the driver has run for long before either
    for part in (np.zeros((empty, 2)), seen):
        whole = np.vstack([np.repeat(part[:1], BEFORE, axis=0), part]) + crosstalk
        whole = whole + middle / snr * rng.standard_normal(whole.shape)
        parts.append(smoothed(whole, share)[BEFORE:] if len(part) else part)
    noise = middle / snr * (1.0 if stated == "before" else np.sqrt(share / (2.0 - share)))
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": FREQUENCY_HZ, "noise": {"read": [noise, noise]}}
    )
    wide = {"prior": "normal", "mean": 0.0, "sd": 3.0 * middle}
    scene: dict[str, Any] = {"crosstalk": [wide, wide]} if behind else {}
    frames = Frames(np.vstack(parts), object_present=np.arange(empty + n) >= empty)
    found = estimate(sensor, parse_scene(scene), frames, ["joint_fit"])
    alone = smoothed_readings(sensor, frames) is not None
    if not found.results:
        return False, False, np.nan, alone
    (result,) = found.results
    off = np.abs(result.range_m[empty:] - ranges) / result.sd_m[empty:]
    worst = float(np.nanmax(off)) if np.isfinite(off).any() else np.nan
    misfit = bool(result.fit and result.fit["misfit"])
    return misfit, SMOOTHED in found.assumptions, worst, alone


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=12)
    sets = parser.parse_args().sets
    print(
        "| smoothed over | noise | misfit | says scatter | of the others beyond 4 sd, worst "
        "| readings alone |"
    )
    print("|---|---|---|---|---|---|")
    for over, stated in WAYS:
        found = [asked(seed, over, stated) for seed in range(sets)]
        misfit = sum(one for one, _, _, _ in found)
        said = sum(other and not one for one, other, _, _ in found)
        silent = [worst for one, other, worst, _ in found if not (one or other)]
        rest, alone = np.array(silent or [np.nan]), sum(each for _, _, _, each in found)
        worst = f"{np.nanmax(rest):.1f} sd" if np.isfinite(rest).any() else "-"
        print(
            f"| {over} | {stated} | {misfit} of {sets} | {said} "
            f"| {np.count_nonzero(rest > 4.0)} of {np.count_nonzero(np.isfinite(rest))}, {worst} "
            f"| {alone} of {sets} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
