"""What a frame costs in single-frame techniques, counted: evaluations, machine code, memory."""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest

from inference.estimate import estimate
from inference.realtime.registry import TECHNIQUES
from inference.realtime.solving.background_balance import solve_balance
from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import Curve, CurveParameters
from inference.realtime.solving.curves.registry import CURVES
from inference.realtime.solving.invert import invert
from inference.realtime.solving.monotone_intervals import monotone_intervals
from inference.realtime.solving.reach import Span
from inference.realtime.techniques import background_intensity
from simulator.frames import Frames
from simulator.sensor import Noise
from tests.contract.scenes import MENU, frames_of, sensor_of, span
from tests.counting import counted_calls, counting, peak_bytes, types_asked_for

# mean evaluations of a curve for a root. Newton's steps in the logarithm are of third order where
# they are small: from 30 % off 3 suffice, and as many again where the curve is steep. A curve that
# has no power law is bracketed to the last bit: Chandrupatla's method takes 9 to 11, halving 53.
# Today 3.1, 3.1, 3.1, 3.4, 3.9, 4.7, 10.2 and 10.0; the margin is a third
MEAN = {
    "intensity": 4.2,
    "intensity_w1": 4.2,
    "differential_ratio": 4.2,
    "differential_phase": 4.6,
    "cancelling_ratio": 5.2,
    "cancelling_quadrature": 6.3,
    "both_ratio": 13.6,
    "both_phase": 13.3,
}
WORST = 32  # today 21: where Newton's steps leave the interval, and a bracket is needed as well


def evaluations(curve: Curve, noise: float = 0.0) -> Iterator[tuple[int, int]]:
    """Yield evaluations and roots of a target for random objects, walls and ranges.

    ``noise`` is that of the target, in units of what moves the range by a factor of e.
    """
    rng = np.random.default_rng(3)
    for _ in range(12):
        c0, distance = 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-0.5, 1.5)
        p = CurveParameters(
            c0=c0,
            c1=2.0 * math.sqrt(c0) * math.expm1(rng.normal(0.0, 0.4)),
            distance=distance,
            wave=3.0 * 10.0 ** rng.uniform(-1.5, 0.2) / distance,
            c0_shadow=0.75 * c0,
            c1_shadow=0.2 * math.sqrt(c0),
            contrast=10.0 ** rng.uniform(-3, 0),
        )
        winds = curve.period > 0 or curve.name == "cancelling_quadrature"
        high = min(distance, 0.5 * math.pi / p.wave) if winds else distance
        intervals = monotone_intervals(curve, p, 0.0, high)
        none = np.zeros((1, intervals.low.size, 2))
        for u in high * 10.0 ** rng.uniform(-3, -1e-3, 8):
            target = np.array([dispatch.value(curve.kind, float(u), p)])
            sd = np.array([noise * u * abs(dispatch.slope(curve.kind, float(u), p))])
            span = Span(0.0, high, 3.0)
            (roots, *_), calls = counted_calls(
                invert, curve.kind, p, intervals, curve.period, target, np.ones(1), sd, span, none
            )
            count = calls["dispatch.power_law"] + calls["dispatch.residual"]
            yield count, int(np.isfinite(roots).sum())


@pytest.mark.parametrize("curve", CURVES, ids=[curve.name for curve in CURVES])
def test_evaluations_for_a_root(curve: Curve) -> None:
    made = [(count, roots) for count, roots in evaluations(curve) if roots > 0]
    assert len(made) > 80
    assert sum(count for count, _ in made) <= MEAN[curve.name] * sum(roots for _, roots in made)
    assert max(count / roots for count, roots in made) <= WORST


@pytest.mark.parametrize("curve", CURVES, ids=[curve.name for curve in CURVES])
def test_evaluations_for_a_root_in_noise(curve: Curve) -> None:
    """A root of small noise costs what it did; in more noise two more are looked for."""
    quiet, little, much = (
        sum(count for count, _ in evaluations(curve, noise)) for noise in (0.0, 1e-9, 0.02)
    )
    assert little == quiet
    # ends count as roots where they are met, and the others are no harder
    assert quiet < much < 4 * quiet


def test_evaluations_for_a_root_before_a_wall(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ends of each interval, Newton's steps from the conventional range, and one more."""
    total: Counter[str] = Counter()
    monkeypatch.setattr(background_intensity, "solve_balance", counting(solve_balance, total))
    sensor, setting = sensor_of("pulsed"), MENU[6]
    frames = frames_of(sensor, setting, span(40), np.random.default_rng(4))
    quiet = sensor.model_copy(update={"noise": Noise(read=(1e-9, 1e-9))})
    result = estimate(quiet, setting.scene, frames, ["background_intensity"]).results[0]
    assert int(result.root_count.sum()) == 40
    # today 3 a frame: two ends and the last step; the rest is Newton's
    assert total["background_balance._balance"] <= 4 * 40
    estimate(sensor, setting.scene, frames, ["background_intensity"])
    # noise of some percent of the range: four more answers a frame
    assert total["background_balance._balance"] <= (4 + 5 * 4) * 40


def variants(frames: Frames) -> Iterator[Frames]:
    """Yield frames that differ in all but what they are of."""
    n = len(frames)
    assert frames.derivatives is not None
    yield frames.select(slice(0, 1))
    yield frames.select(slice(None, None, 2))
    yield dataclasses.replace(
        frames,
        readings=np.asfortranarray(frames.readings),
        derivatives=np.asfortranarray(frames.derivatives),
    )
    yield dataclasses.replace(frames, gain=np.linspace(1.0, 2.0, n))
    yield dataclasses.replace(frames, object_present=np.arange(n) > 0)
    yield dataclasses.replace(frames, derivatives=None, time_s=np.linspace(0.0, 1.0, n))


def test_a_kernel_is_compiled_once_for_a_kind_of_sensor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither how many frames there are, nor how they lie in memory, nor their columns count."""
    asked = types_asked_for(monkeypatch)
    rng = np.random.default_rng(1)
    for kind in ("pulsed", "sine_wave"):
        sensor = sensor_of(kind)
        for setting in MENU:
            frames = frames_of(sensor, setting, span(9), rng)
            for each in (frames, *variants(frames)):
                estimate(sensor, setting.scene, each, list(TECHNIQUES))
    assert len(asked) > 10
    # a wave is None for a pulse, and then absent from the machine code
    with_a_wave = {"background_cancelling._physical", "net._fill", "windows.differences"}
    for name, kinds in asked.items():
        short = ".".join(name.split(".")[-2:])
        assert len(kinds) <= (2 if short in with_a_wave else 1), (name, kinds)


@pytest.mark.parametrize(
    ("technique", "most"),
    [
        # roots, standard deviations, noise, counts: 8 bytes each; status, reason, fold: 1 each
        ("conventional", 36.0),
        # today 141: those of a root with its slope, gaps and noise, and what is between
        ("intensity", 180.0),
    ],
)
def test_bytes_a_frame(technique: str, most: float) -> None:
    """At the peak, beside the readings; so many frames that what does not grow counts nothing."""
    sensor, setting, n = sensor_of("pulsed"), MENU[0], 60_000
    few = frames_of(sensor, setting, span(1000), np.random.default_rng(5))
    frames = Frames(np.tile(few.readings, (n // 1000, 1)))

    def work() -> None:
        estimate(sensor, setting.scene, frames, [technique])

    work()  # machine code is made
    assert peak_bytes(work) <= most * n
