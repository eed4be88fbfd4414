"""Light that a delay moves out of the late window: no range of it is sure."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.constants import SPEED_OF_LIGHT
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

WIDTH_S, FRAMES = 4e-8, 200
R0 = SPEED_OF_LIGHT * WIDTH_S / 2
NOISE = np.array([1e-4, 1e-3])
DRIFT = 3e-11  # [s/K]: 9 cm in 20 K
_UNIQUE = int(Status.UNIQUE)


def asked(
    range_m: float, warm_k: float, offset_s: float, scene_of: dict[str, Any] | None = None
) -> TechniqueResult:
    """Return what `conventional` says of one range, its light cut where the windows end."""
    rng = np.random.default_rng(7)
    shift = SPEED_OF_LIGHT / 2 * (offset_s + DRIFT * warm_k)
    share = np.clip((range_m + shift) / R0, 0.0, 1.0)
    w = np.array([share, 1.0]) + NOISE * rng.standard_normal((FRAMES, 2))
    stated = {"kind": "pulsed", "pulse_width_s": WIDTH_S, "noise": {"read": NOISE.tolist()}}
    columns = {"w1": w[:, 0], "w2": w[:, 1]}
    if offset_s:
        stated |= {"timing_offset_s": offset_s}
    if warm_k:
        stated |= {"temperature": {"reference_k": 300.0, "delay_drift_s_per_k": DRIFT}}
        columns |= {"temperature_k": np.full(FRAMES, 300.0 + warm_k)}
    sensor = parse_sensor(stated)
    frames = frames_from_columns(sensor, columns)
    scene = parse_scene(scene_of or {})
    return estimate(sensor, scene, frames, ["conventional"]).results[0]


@pytest.mark.parametrize(
    ("range_m", "warm_k", "offset_s"),
    [
        (6.3, 20.0, 0.0),  # beyond the reach, which ends at r0 less 9 cm
        (5.95, 20.0, 0.0),
        (0.02, -20.0, 0.0),  # nearer than 9 cm no light is late
        (0.05, -20.0, 0.0),
        (0.02, 0.0, -5e-10),
        (0.06, 0.0, -5e-10),
        (6.2, 0.0, 5e-10),
        (0.05, -10.0, -5e-10),  # both together
    ],
)
def test_what_the_windows_cut_is_near_a_fold(
    range_m: float, warm_k: float, offset_s: float
) -> None:
    """Without the rule all but those of the positive offset are sure, and up to 72 sd off."""
    found = asked(range_m, warm_k, offset_s)
    unique = found.status == _UNIQUE
    assert unique.any()
    off = np.abs(found.range_m - range_m)[unique] / found.sd_m[unique]
    assert np.median(off) > 5.0
    assert found.near_fold[unique].all()


@pytest.mark.parametrize(("warm_k", "offset_s"), [(20.0, 0.0), (-20.0, 0.0), (0.0, -5e-10)])
@pytest.mark.parametrize("range_m", [0.2, 1.0, 5.0])
def test_what_they_do_not_cut_is_as_sure_as_it_was(
    range_m: float, warm_k: float, offset_s: float
) -> None:
    """None of 200 frames is five standard deviations off, but once in 9,000 runs."""
    found = asked(range_m, warm_k, offset_s)
    assert (found.status == _UNIQUE).all()
    assert not found.near_fold.any()
    assert np.max(np.abs(found.range_m - range_m) / found.sd_m) < 5.0


@pytest.mark.parametrize(("range_m", "warm_k"), [(5.895, 20.0), (0.0905, -20.0)])
def test_an_end_that_the_scene_does_not_allow_is_none(range_m: float, warm_k: float) -> None:
    """An object a centimetre or half a millimetre within the window: nothing else may be there."""
    assert asked(range_m, warm_k, 0.0).near_fold.any()
    inside = {"range_m": {"prior": "uniform", "low": 0.0901, "high": 5.9}}
    found = asked(range_m, warm_k, 0.0, inside)
    assert (found.status == _UNIQUE).any()
    assert not found.near_fold.any()
