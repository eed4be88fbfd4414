"""Recorded photons against the robot's truth: the tables of docs/recorded.md.

    python -m benchmarks.recorded

Needs ../shared/data/tmf8820_plane.json.
"""

import sys

import numpy as np

from tests.recorded.experiment import (
    CROSSTALK,
    PATH,
    calibration_of,
    conventional_residual_m,
    crosstalk_answers,
    near_recording,
    zeta_and_power_law,
)


def main() -> None:
    if not PATH.exists():
        sys.exit(f"no recordings: {PATH} is absent")
    recording = near_recording()
    n = recording.distance_m.size
    print(f"{n} positions, {recording.distance_m[0]} to {recording.distance_m[-1]} m")
    calibration = calibration_of(recording)
    print(f"calibration: slope {calibration.slope:.5f}, offset {calibration.offset_m:.5f} m\n")
    print("| conventional range | residual sd [mm] | largest [mm] |\n|---|---|---|")
    for kind in ("pulsed", "sine_wave"):
        residual = conventional_residual_m(recording, kind)
        sd = np.sqrt(np.sum(residual**2) / (n - 2))
        print(f"| {kind} | {sd * 1e3:.2f} | {np.abs(residual).max() * 1e3:.2f} |")
    distance, zeta, b = zeta_and_power_law(recording)
    far = distance > 0.2
    off = np.abs(zeta - (1 + 1 / b))[far]
    print(
        f"\nzeta against 1 + 1/b at {far.sum()} positions above 0.2 m: largest difference "
        f"{off.max():.3f}, rms {np.sqrt(np.mean(off**2)):.3f}; "
        f"b from {b[far].min():.2f} to {b[far].max():.2f}"
    )
    for name, share in CROSSTALK.items():
        print(f"\nStatic crosstalk, {name} at 0.2 m:\n")
        print(
            "| answer | answered | median error [mm] | largest [mm] | median width of the 90 % "
            "interval [mm] | interval holds the truth | remark |\n|---|---|---|---|---|---|---|"
        )
        for answer in crosstalk_answers(recording, share):
            error = answer.error_m[np.isfinite(answer.error_m)] * 1e3
            width = np.nanmedian(answer.high_m - answer.low_m) * 1e3
            print(
                f"| {answer.name} | {answer.answered:.0%} | {np.median(error):+.1f} "
                f"| {np.abs(error).max():.1f} | {width:.2f} | {answer.inside:.0%} "
                f"| {answer.remark} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
