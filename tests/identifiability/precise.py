"""The slow, obvious reference: readings in 50 digits, derivatives by differences of 1e-20."""

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from simulator.sensor import PulsedSensor, Sensor
from tests.identifiability.published import System

__all__ = ["DIGITS", "precise_jacobian", "precise_readings", "projected"]

Array = NDArray[np.float64]
DIGITS = 50
STEP = mp.mpf("1e-20")

OBJECT = ("object.c0", "object.c1", "object.c2")


def precise_readings(
    sensor: Sensor, values: dict[str, mp.mpf], r: mp.mpf | None, gain: float = 1.0
) -> list[mp.mpf]:
    """Mean readings of one frame; without an object where r is None. docs/model.md, conventions."""

    def carrier(length: mp.mpf) -> list[mp.mpf]:
        if isinstance(sensor, PulsedSensor):
            return [min(length / mp.mpf(sensor.r0), mp.mpf(1)), mp.mpf(1)]
        phase = mp.mpf(sensor.wave_number) * length + mp.mpf(sensor.known_phase_rad)
        return [mp.cos(phase), mp.sin(phase)]

    total = [mp.mpf(0), mp.mpf(0)]
    if r is not None:
        c0, c1, c2 = (values[name] for name in OBJECT)
        flux = mp.mpf(sensor.known_gain) * gain * c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
        total = [t + flux * c for t, c in zip(total, carrier(r), strict=True)]
    if "background.strength" in values:
        visible = mp.mpf(1)
        if r is not None:
            d0, d1 = values["background.shadow.c0"], values["background.shadow.c1"]
            visible = (r**2 + d1 * r) / (r**2 + d1 * r + d0)
        light = gain * values["background.strength"] * visible
        bare = carrier(values["background.distance_m"])
        total = [t + light * c for t, c in zip(total, bare, strict=True)]
    first, second = (f"crosstalk.{column}" for column in sensor.columns)
    if first in values:
        total = [total[0] + values[first], total[1] + values[second]]
    return total


def _moved(values: dict[str, mp.mpf], name: str, shared: bool, unit: float) -> dict[str, mp.mpf]:
    """Move one unknown by STEP along its dimensionless coordinate."""
    moved = dict(values)
    if name.endswith(".c1"):
        moved[name] += STEP * mp.sqrt(values[name.replace(".c1", ".c0")])
    elif name.startswith("crosstalk"):
        moved[name] += STEP * unit
    else:
        moved[name] *= mp.exp(STEP)
        if name.endswith(".c0"):  # c1 / sqrt(c0) is held
            moved[name.replace(".c0", ".c1")] *= mp.exp(STEP / 2)
    if shared:
        for part in ("c0", "c1"):
            moved[f"background.shadow.{part}"] = moved[f"object.{part}"]
    return moved


def precise_jacobian(system: System, experiment: Experiment, sds: Array) -> list[mp.matrix]:
    """Whitened derivatives of every frame: a matrix (2, d + 1), the last column along log r."""
    with mp.workdps(DIGITS):
        values = {name: mp.mpf(value) for name, value in system.values.items()}
        if system.shared:
            for part in ("c0", "c1"):
                values[f"background.shadow.{part}"] = values[f"object.{part}"]
        frames = []
        for log_r, sd in zip(experiment.log_r, sds, strict=True):
            r = None if np.isnan(log_r) else mp.exp(mp.mpf(log_r))
            here = precise_readings(experiment.sensor, values, r)
            columns = []
            for name in experiment.names:
                unit = 1.0
                if name.startswith("crosstalk"):
                    unit = float(experiment.unknowns.units[3 if name.endswith(("w1", ".i")) else 4])
                there = precise_readings(
                    experiment.sensor, _moved(values, name, system.shared, unit), r
                )
                columns.append(there)
            columns.append(
                here if r is None else precise_readings(experiment.sensor, values, r * mp.exp(STEP))
            )
            frames.append(
                mp.matrix(
                    [[(c[k] - here[k]) / STEP / mp.mpf(sd[k]) for c in columns] for k in range(2)]
                )
            )
        return frames


def projected(frames: list[mp.matrix]) -> mp.matrix:
    """Rows of all frames across their range directions."""
    with mp.workdps(DIGITS):
        rows = []
        for frame in frames:
            d = frame.cols - 1
            t1, t2 = frame[0, d], frame[1, d]
            size = mp.sqrt(t1**2 + t2**2)
            if size == 0:
                rows += [[frame[k, j] for j in range(d)] for k in range(2)]
            else:
                rows.append([(t1 * frame[1, j] - t2 * frame[0, j]) / size for j in range(d)])
        return mp.matrix(rows)
