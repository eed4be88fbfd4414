"""A stream that calibrates itself, minutes long: error and coverage over time.

    python -m benchmarks.self_calibration [--minutes 10] [--seeds 1] [--erring] [--picture PATH]

An object goes to and fro between 0.3 and 1.5 m at 30 frames a second, leaves and returns; it is as
its model, or with `--erring` errs from it by as much as the default `discrepancy` supposes.
Crosstalk of a tenth of its light at 0.6 m drifts by a tenth of itself in two minutes, as a random
walk; at six tenths of the time a wall appears behind, and a fingerprint on the glass at eight
tenths adds a fifth of the crosstalk at once. The stated scene knows priors of object, crosstalk and
range alone: what the wall sends is crosstalk to it, and the shadow on the wall an error. `warm`
begins with two seconds that are known to be without the object (`object_present`); `cold` is told
nothing. Calibrations are computed at once, and applied 20 s later.

For each: calibrations asked for and taken, scenes given up, the share of frames with one range, and
of them the median relative error, the share of 90 % intervals that hold the truth, their median
width over the range; the share of all frames that have one range and hold it; both shares in the
90 s after the wall has come; the longest stretch without an interval that holds, when it begins and
by how many standard deviations it is off at most; the longest that is sure and wrong (one range,
five standard deviations off, no `misfit`); of frames without an object before the wall, the share
with a range.
"""

import argparse
import dataclasses
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.self_calibration.calibration import Asked, Outcome, answer
from inference.self_calibration.following import conclude, follow
from inference.self_calibration.plan import begin, plan_of
from inference.self_calibration.state import CalibrationState
from inference.tracking.settings import TrackingSettings
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor
from simulator.simulate import mean_readings, simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

HZ, LAG_S = 30, 20.0
NOISE = 8e-5
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
CROSSTALK = (1e-3, 5e-3)
WALL = {"strength": 2e-3, "distance_m": 3.0, "shadow": "object"}
STATED: dict[str, Any] = {
    "crosstalk": [{"prior": "halfnormal", "sd": 5e-3}, {"prior": "halfnormal", "sd": 0.025}],
    "range_m": {"prior": "loguniform", "low": 0.1, "high": 5.0},
}
SETTINGS = TrackingSettings(rate_sd=0.5)
_Z = 1.6448536269514722  # of a 90 % interval
_WRONG = 5.0
_BEHIND_S = 90.0  # after the wall has come
_COLORS = {"taken": "tab:green", "not_taken": "tab:orange", "doubted": "tab:red"}


def sensor_of() -> PulsedSensor:
    """Return the sensor."""
    return PulsedSensor.model_validate(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [NOISE, NOISE]}}
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Course:
    """Frames, and what is true.

    Attributes
    ----------
    frames : Frames
        As a stream has them.
    range_m : ndarray, shape (n,)
        True ranges [m]; nan where no object is there.
    crosstalk : ndarray, shape (n, 2)
        True crosstalk.
    wall_s, print_s : float
        When the wall and the fingerprint come [s].
    """

    frames: Frames
    range_m: Array
    crosstalk: Array
    wall_s: float
    print_s: float


def course(seconds: float, seed: int, cold: bool, erring: bool = False) -> Course:
    """Simulate a course; see above."""
    rng = np.random.default_rng(seed)
    sensor = sensor_of()
    n = round(seconds * HZ)
    t = np.arange(n) / HZ
    range_m = np.exp(np.log(0.67) + np.log(1.5 / 0.67) * np.sin(2 * np.pi * t / 17.3))
    share = t / seconds
    away = ((share > 0.35) & (share < 0.4)) | ((share > 0.68) & (share < 0.72))
    if not cold:
        away |= t < 2.0
    ranges = np.where(away, np.nan, range_m)
    default = parse_scene({"object": OBJECT})
    sizes = default.model_error
    errors = {"discrepancy": {"flux": sizes.flux, "range_m": sizes.range_m}} if erring else {}
    truth = parse_scene({"object": OBJECT, **errors})
    path = SampledTrajectory(
        range_m=np.where(away, 1.0, range_m).tolist(),
        time_s=t.tolist(),
        object_present=(~away).tolist(),
    )
    readings = simulate(sensor, truth, path, seed).frames.readings.copy()
    walk = np.cumsum(rng.standard_normal(n)) * 0.1 / np.sqrt(120 * HZ)
    level = 1.0 + walk + 0.2 * (share > 0.8)
    crosstalk = level[:, None] * np.array(CROSSTALK)
    readings += crosstalk + (share > 0.6)[:, None] * _wall(sensor, ranges)
    told = None if cold else np.where(t < 2.0, False, True)
    frames = Frames(readings=readings, time_s=t, object_present=told)
    return Course(frames, ranges, crosstalk, 0.6 * seconds, 0.8 * seconds)


def _wall(sensor: PulsedSensor, ranges: Array) -> Array:
    """Return what a wall adds to the readings."""

    def mean(scene: Scene) -> Array:
        terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
        return mean_readings(sensor, terms, ranges)

    return mean(parse_scene({"object": OBJECT, "background": WALL})) - mean(
        parse_scene({"object": OBJECT})
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Followed:
    """What a stream said of a course: one entry a frame, and its events."""

    range_m: Array
    sd_m: Array
    unique: NDArray[np.bool_]
    misfit: NDArray[np.bool_]
    known: NDArray[np.bool_]
    events: list[dict[str, Any]]
    asked: int
    compute_s: float
    laws: list[tuple[float, Scene]]  # of the scene, when each was taken [s]


def followed(of: Course, seed: int, compute: Callable[..., Outcome] = answer) -> Followed:
    """Follow a course, the calibrations computed at once and applied `LAG_S` later."""
    sensor = sensor_of()
    plan = plan_of(sensor, parse_scene(STATED), SETTINGS, seed)
    state = begin(plan)
    spent = 0.0

    def concluding(state: CalibrationState) -> CalibrationState:
        nonlocal spent
        asked = state.asked
        assert isinstance(asked, Asked)
        begun = time.perf_counter()
        outcome = compute(sensor, asked)
        spent += time.perf_counter() - begun
        return conclude(state, outcome, asked.decided_at + round(LAG_S * HZ))

    rows, known, events, laws = [], [], [], []
    n = len(of.frames)
    for start in range(0, n, HZ):
        part = of.frames.select(slice(start, start + HZ))
        numbers = range(start + 1, start + 1 + len(part))
        state, pieces = follow(plan, state, part, numbers, concluding)
        known += [state.known] * len(part)
        for piece in pieces:
            rows.append((piece.track.range_m, piece.track.sd_m, piece.track.status,
                         piece.track.misfit))  # fmt: skip
            if piece.event is not None:
                events.append(piece.event)
                if piece.event["kind"] == "taken":
                    laws.append((piece.event["sequence"] / HZ, state.scene))
    range_m, sd_m, status, misfit = (np.concatenate(column) for column in zip(*rows, strict=True))
    unique = status == Status.UNIQUE
    return Followed(
        range_m, sd_m, unique, misfit, np.array(known), events, state.number, spent, laws
    )


def longest_s(wrong: NDArray[np.bool_]) -> float:
    """Return the longest stretch of frames that are all wrong [s]."""
    longest = run = 0
    for one in wrong.tolist():
        run = run + 1 if one else 0
        longest = max(longest, run)
    return longest / HZ


def where_longest(wrong: NDArray[np.bool_], off: Array) -> tuple[float, float]:
    """Return when the longest stretch begins [s], and how far off its frames are at most [sd]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wrong, [False]]).astype(np.int8)))
    if not edges.size:
        return 0.0, 0.0
    starts, ends = edges[::2], edges[1::2]
    at = int(np.argmax(ends - starts))
    return float(starts[at]) / HZ, float(off[starts[at] : ends[at]].max())


def wrong_of(of: Course, said: Followed) -> NDArray[np.bool_]:
    """Tell where an answer is sure and wrong."""
    with np.errstate(invalid="ignore"):
        off = np.abs(said.range_m - of.range_m) > _WRONG * said.sd_m
    return np.asarray(off & said.unique & ~said.misfit)


def figures(of: Course, said: Followed) -> dict[str, float]:
    """Return the numbers that are told."""
    there = np.isfinite(of.range_m)
    asked = there & said.unique
    t = of.frames.time_s
    assert t is not None
    with np.errstate(invalid="ignore"):
        error = np.abs(said.range_m - of.range_m)
        held = error <= _Z * said.sd_m
    taken = sum(event["kind"] == "taken" for event in said.events)
    ghosts = ~there & said.unique
    missed = asked & ~held & ~said.misfit
    since, off = where_longest(missed, error / said.sd_m)
    bare = ~there & (t < of.wall_s)
    behind = there & (t >= of.wall_s) & (t < of.wall_s + _BEHIND_S)
    return {
        "asked": said.asked,
        "taken": taken,
        "given up": sum(event["kind"] == "doubted" for event in said.events),
        "known": float(said.known.mean()),
        "one range": float(said.unique[there].mean()),
        "error": float(np.median((error / of.range_m)[asked])),
        "held": float(held[asked].mean()),
        "width": float(np.median((2 * _Z * said.sd_m / of.range_m)[asked])),
        "right": float(held[asked].sum() / there.sum()),
        "wall held": float(held[asked & behind].mean()) if (asked & behind).any() else 0.0,
        "wall right": float((held & asked)[behind & there].mean()) if behind.any() else 0.0,
        "misfit": float(said.misfit[there].mean()),
        "missed s": longest_s(missed),
        "missed at s": since,
        "missed sd": off,
        "wrong s": longest_s(wrong_of(of, said)),
        "wrong": float(wrong_of(of, said)[there].mean()),
        "ghosts": float(ghosts[bare].mean()) if bare.any() else 0.0,
        "compute s": said.compute_s,
    }


def draw(path: Path, courses: Iterable[tuple[str, Course, Followed]]) -> None:
    """Draw ranges, errors and shares of intervals that hold the truth over time.

    Parameters
    ----------
    path : Path
        Where to, as PNG.
    courses : iterable of (str, Course, Followed)
        A column each; the first of a name.
    """
    from matplotlib.figure import Figure

    first = {name: (of, said) for name, of, said in reversed(list(courses))}
    names = sorted(first, reverse=True)
    figure = Figure(figsize=(6.5 * len(names), 8.0), layout="constrained")
    axes = figure.subplots(3, len(names), sharex="col", squeeze=False)
    for column, name in enumerate(names):
        of, said = first[name]
        assert of.frames.time_s is not None
        t = of.frames.time_s
        with np.errstate(invalid="ignore"):
            error = (said.range_m - of.range_m) / of.range_m
            wide = _Z * said.sd_m / of.range_m
            held = np.where(np.isfinite(error), np.abs(error) <= wide, np.nan)
        ranges, errors, shares = axes[:, column]
        ranges.plot(t, said.range_m, ".", ms=1.5, color="tab:blue", label="one range")
        ranges.plot(t, of.range_m, lw=0.8, color="black", label="truth")
        ranges.set(title=f"{name} start", ylabel="range [m]", ylim=(0.1, 6.0), yscale="log")
        ranges.set_yticks([0.1, 0.3, 1, 3], ["0.1", "0.3", "1", "3"])
        ranges.set_yticks([], minor=True)
        errors.fill_between(t, -100 * wide, 100 * wide, color="tab:blue", alpha=0.3, lw=0)
        errors.plot(t, 100 * error, ".", ms=1.5, color="tab:blue")
        errors.set(ylabel="error, 90 % interval\n[% of range]", ylim=(-40, 40))
        seconds = np.arange(t.size // (10 * HZ)) * 10.0
        rows = held[: seconds.size * 10 * HZ].reshape(seconds.size, -1)
        answered = np.isfinite(rows).sum(axis=1)
        share = np.nansum(rows, axis=1) / np.maximum(answered, 1)
        shares.bar(
            seconds, np.where(answered > 0, 100 * share, np.nan), 9.0, align="edge", color="silver"
        )
        shares.axhline(90, color="black", lw=0.8)
        shares.set(ylabel="intervals that hold\nthe truth [%]", xlabel="time [s]", ylim=(0, 105))
        for ax in axes[:, column]:
            ax.axvline(of.wall_s, color="tab:purple", lw=1.5, label="wall comes")
            ax.axvline(of.print_s, color="tab:brown", lw=1.5, label="fingerprint")
            for kind, color in _COLORS.items():
                at = [e["sequence"] / HZ for e in said.events if e["kind"] == kind]
                label = kind.replace("_", " ")
                for k, x in enumerate(at):
                    ax.axvline(x, color=color, lw=0.8, ls="--", label=label if k == 0 else None)
    # below all panels, each kind of line once
    known: dict[str, Any] = {}
    for ax in axes[0]:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            known.setdefault(label, handle)
    figure.legend(
        list(known.values()),
        list(known),
        loc="outside lower center",
        ncols=len(known),
        frameon=False,
    )
    figure.savefig(path, dpi=100)


def main(arguments: Iterable[str] | None = None) -> None:
    """Print the figures, and draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--erring", action="store_true", help="objects that err from their model")
    parser.add_argument("--start", choices=("warm", "cold"), help="one of the two alone")
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args(None if arguments is None else list(arguments))
    drawn = []
    for name in [args.start] if args.start else ["warm", "cold"]:
        for seed in range(args.seeds):
            of = course(60 * args.minutes, seed, name == "cold", args.erring)
            said = followed(of, seed)
            drawn.append((name, of, said))
            cells = ", ".join(f"{key} {value:.4g}" for key, value in figures(of, said).items())
            print(f"{name} {seed}: {cells}", flush=True)
            for event in said.events:
                print(
                    f"  {event['sequence'] / HZ:7.1f} s {event['kind']:9} {event['reason'][:100]} "
                    f"{event['before']['range_m']} -> {event['after']['range_m']}",
                    flush=True,
                )
    if args.picture is not None:
        draw(args.picture, drawn)


if __name__ == "__main__":
    main()
