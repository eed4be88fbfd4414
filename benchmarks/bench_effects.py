"""What a bench brings that the model has not: rulers tell distances, pulses have edges.

30 frames of a disk of 15 cm radius, 0.2 to 1.5 m away, and five without it, behind unknown
crosstalk; the noise is 1/300 of the median light. A table says how far ``conventional`` (crosstalk
known) and ``joint_fit`` are off, in their own standard deviations.

* A ruler tells the disk's distance at both ends, to a millimetre. Sensors read half of the mean
  path, which is more: by z / 5 at most under a Lambertian emitter.
* The pulse falls within a part of its width: objects nearer than a quarter of the way that light
  goes meanwhile give more late light than the model has.
* The wave has a third harmonic, which square demodulation folds back: the phase errs four times a
  turn.

    python -m benchmarks.bench_effects --sets 4
"""

import argparse
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.unstated_light import Outcome, disk
from inference.estimate import estimate
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

Array = NDArray[np.float64]

_HALF_LIGHT_SPEED = 299_792_458.0 / 2
_PULSE_S, _FREQUENCY_HZ = 3e-8, 2e7
_RADIUS, _EMPTY, _FRAMES, _RULER = 0.15, 5, 30, 1e-3


class Bench(NamedTuple):
    """What is seen, and what is stated."""

    kind: str
    fall: float = 0.0  # time in which the pulse falls, over its width
    harmonic: float = 0.0  # third, over the first
    ruler: str = ""  # "half path", "distance", or "distance, its sd stated"
    clock: float | None = None  # what is stated of `discrepancy.range_m` [m]


def readings(bench: Bench, r: Array, flux: Array) -> Array:
    """Return readings without noise, shape (n, 2)."""
    if bench.kind == "pulsed":
        late, fall = r / (_HALF_LIGHT_SPEED * _PULSE_S), max(bench.fall, 1e-12)
        # what a pulse that falls linearly about its end leaves behind it
        late = np.where(late < fall / 2, np.square(late + fall / 2) / (2 * fall), late)
        return np.asarray(flux[:, None] * np.stack([late, np.ones_like(r)], axis=1))
    phase = 2 * np.pi * _FREQUENCY_HZ / _HALF_LIGHT_SPEED * r
    turned = np.exp(1j * phase) + bench.harmonic * np.exp(-3j * phase)
    return np.asarray(flux[:, None] * np.stack([turned.real, turned.imag], axis=1))


def told_by(bench: Bench, z: Array, r: Array, rng: np.random.Generator) -> dict[str, Array]:
    """Return known ranges of the frames at both ends."""
    if not bench.ruler:
        return {}
    known, sd = np.full(_EMPTY + _FRAMES, np.nan), np.full(_EMPTY + _FRAMES, np.nan)
    ends = [0, _FRAMES - 1]
    at = (r if bench.ruler == "half path" else z)[ends]
    known[_EMPTY + np.array(ends)] = at + rng.normal(0.0, _RULER, 2)
    # the way to the rim, and what a plate of any size has at most
    more = np.minimum(_RADIUS**2 / (4 * z), z / 5)[ends] if "stated" in bench.ruler else 0.0
    sd[_EMPTY + np.array(ends)] = np.hypot(_RULER, more)
    return {"known_range_m": known, "known_range_sd_m": sd}


def one(bench: Bench, technique: str, seed: int) -> Outcome:
    """Answer one set."""
    rng = np.random.default_rng(seed)
    z = np.geomspace(0.2, 1.5, _FRAMES)
    r, flux = disk(z, _RADIUS, 0.6)
    median = float(np.median(flux))
    crosstalk, sd = median * np.array([0.03, 0.3]), median / 300.0
    seen = np.vstack([np.zeros((_EMPTY, 2)), readings(bench, r, flux)]) + crosstalk
    present = np.arange(_EMPTY + _FRAMES) >= _EMPTY
    noisy = seen + rng.normal(0.0, sd, seen.shape)
    frames = Frames(noisy, object_present=present, **told_by(bench, z, r, rng))
    prior: Any = {"prior": "normal", "mean": 0.0, "sd": 3 * median}
    scene: dict[str, Any] = {"crosstalk": [prior, prior]}
    if technique == "conventional":
        scene["crosstalk"] = crosstalk.tolist()
    if bench.clock is not None:
        scene["discrepancy"] = {"flux": 0.072, "range_m": bench.clock}
    (result,) = estimate(_sensor(bench.kind, sd), parse_scene(scene), frames, [technique]).results
    away = np.abs(result.range_m[present] - r) / result.sd_m[present]
    away[result.near_fold[present]] = np.nan
    worst = float(np.nanmax(away)) if np.isfinite(away).any() else float("nan")
    return Outcome(worst, bool(result.fit and result.fit["misfit"]))


def _sensor(kind: str, sd: float) -> Sensor:
    timing: dict[str, Any] = (
        {"pulse_width_s": _PULSE_S} if kind == "pulsed" else {"frequency_hz": _FREQUENCY_HZ}
    )
    return parse_sensor({"kind": kind, **timing, "noise": {"read": [sd, sd]}})


def row(name: str, answered: Callable[[str], list[Outcome]]) -> str:
    """Return a row of the table."""
    cells = []
    for technique in ("conventional", "joint_fit"):
        found = answered(technique)
        silent = [each.worst for each in found if not each.misfit]
        off = f"{min(silent):.1f} to {max(silent):.1f}" if silent else "-"
        cells.append(f"{off} | {len(found) - len(silent)} of {len(found)}")
    return f"| {name} | {cells[0].split(' |')[0]} | {cells[1]} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=4)
    sets = range(parser.parse_args().sets)
    width = _HALF_LIGHT_SPEED * _PULSE_S
    turn = _HALF_LIGHT_SPEED / (2 * np.pi * _FREQUENCY_HZ)
    benches = {
        f"{kind}, {ruler or 'no ruler'}": Bench(kind, ruler=ruler)
        for kind in ("pulsed", "sine_wave")
        for ruler in ("", "half path", "distance", "distance, its sd stated")
    }
    for fall in (0.05, 0.1, 0.2):
        size = fall * width / 8  # at contact
        benches[f"pulse that falls within {fall:.0%} of its width"] = Bench("pulsed", fall=fall)
        benches[f"the same, range_m {size:.3f} stated"] = Bench("pulsed", fall=fall, clock=size)
    for part in (0.003, 0.01, 0.03):
        size = part * turn
        benches[f"third harmonic of {part:.1%}"] = Bench("sine_wave", harmonic=part)
        told = Bench("sine_wave", harmonic=part, clock=size)
        benches[f"the same, range_m {size:.3f} stated"] = told
    print("| | conventional off by | joint_fit off by, where silent | misfit |\n|---|---|---|---|")
    for name, bench in benches.items():
        asked = bench
        answers = row(name, lambda technique, b=asked: [one(b, technique, s) for s in sets])  # type: ignore[misc]
        print(answers, flush=True)


if __name__ == "__main__":
    main()
