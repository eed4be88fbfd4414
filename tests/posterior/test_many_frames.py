"""Posteriors of more frames than are sampled: a few hundred stand for all."""

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.representatives import drawn_by_information, standing_for
from inference.posterior import fold
from inference.posterior.criticism.many_frames import bias_of_many_frames
from inference.posterior.sampling.proposal import mixture_of
from inference.posterior.sampling.represent import doubts, represent
from inference.posterior.sampling.start import Optimum, refine
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import Starting
from inference.posterior.stages.starting import begin
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

Array = NDArray[np.float64]

TRUTH = {f"object.{name}": value for name, value in OBJECT.items()}
CROSSTALK = (0.002, 0.01)


def frames_of(
    sensor: Sensor, n: int, span: tuple[float, float] = (0.1, 2.0), crosstalk: bool = False
) -> tuple[Frames, Array]:
    """Return frames along a span, each tenth without object, in no order; and their ranges."""
    simulated = data(sensor, frames=n, span=span)
    rng, present = np.random.default_rng(1), np.arange(n) % 10 > 0
    noise = rng.standard_normal((n, 2)) * sensor.noise.read
    readings = np.where(present[:, None], simulated.frames.readings, noise)
    if crosstalk:
        readings = readings + CROSSTALK
    order = rng.permutation(n)
    frames = Frames(readings, object_present=present).select(order)
    return frames, np.where(present, np.geomspace(*span, n), np.nan)[order]


def density_and_truth(sensor: Sensor, frames: Frames) -> tuple[CollapsedDensity, Array]:
    """Return the density of all frames, with crosstalk for sine waves, and the truth."""
    scene = parse_scene({} if sensor.kind == "pulsed" else {"crosstalk": UNKNOWN_CROSSTALK})
    density = collapsed_density(sensor, scene, frames)
    truth = TRUTH | dict(zip(density.parameters.names[3:], CROSSTALK, strict=False))
    values = np.array([[truth[name] for name in density.parameters.names]])
    return density, density.parameters.standard(values)[0]


def optimum_of_some(density: CollapsedDensity, z: Array) -> Optimum:
    # without gaps, as all flags are: others would have machine code of their own
    present = None if density.present is None else np.ascontiguousarray(density.present[::20])
    some = dataclasses.replace(
        density, frames=np.ascontiguousarray(density.frames[::20]), present=present
    )
    found = refine(some, z)
    assert found is not None
    return found


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_a_few_hundred_frames_have_the_likelihood_of_all(kind: str) -> None:
    """To a thousandth of a nat: no mean is off by more of its standard deviations than that."""
    sensor = sensor_of(kind)
    density, z = density_and_truth(
        sensor, frames_of(sensor, 4000, crosstalk=kind == "sine_wave")[0]
    )
    start, rng = optimum_of_some(density, z), np.random.default_rng(0)
    by, optima, _ = represent(density, [start], rng)
    standing = standing_for(density, by)
    assert len(by.chosen) <= 300
    assert (by.weights > 0).all()
    draws = mixture_of(optima).draw(rng, 20)
    off = density.log_likelihood(draws) - standing.log_likelihood(draws)
    assert np.ptp(off) < 1e-3
    # what is met at points is met for the number of frames, so for the evidence, too
    assert by.weights.sum() == pytest.approx(len(density.frames), rel=1e-9)
    assert abs(off.mean()) < 1e-3 * abs(density.log_likelihood(draws).mean())
    # twenty times the frames of the first optimum: its spread shrinks as the root of that
    shrunk = np.linalg.det(np.linalg.solve(start.factor, optima[0].factor)) ** (1 / z.size)
    assert shrunk == pytest.approx(20**-0.5, rel=0.3)
    assert not doubts(density, standing, draws)
    # planted: frames drawn as well, their weights as they were drawn
    drawn = drawn_by_information(density, optima[0].z, 300, rng)
    (reason,) = doubts(density, standing_for(density, drawn), draws)
    assert "may be off by as many standard deviations" in reason


def test_the_bias_of_many_frames_is_measured() -> None:
    """At an SNR of 20 and 4000 frames it is two standard deviations, and is known to one in 1.2.

    Compared with where the optimum lies off the truth, whose noise is one standard deviation:
    tested at 4 of both together (false alarm 2e-4 for three parameters).
    """
    sensor = sensor_of("pulsed", 20.0)
    density, z = density_and_truth(sensor, frames_of(sensor, 4000, (0.3, 3.0))[0])
    rng = np.random.default_rng(1)
    _, optima, _ = represent(density, [optimum_of_some(density, z)], rng)
    best = optima[0]
    draws = best.z + rng.standard_normal((500, z.size)) @ best.factor.T
    bias = bias_of_many_frames(density, draws, rng)
    sd = np.sqrt(np.square(best.factor).sum(axis=1))
    assert np.abs(bias / sd).max() > 1.0
    assert np.abs((best.z - z - bias) / sd).max() < 4.0 * np.hypot(1.0, 0.5)


@pytest.mark.slow
def test_ranges_of_all_frames_are_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    """In parts; and a job that was stored in between goes on to the same last bit."""
    sensor = sensor_of("pulsed")
    n, most = 300, 240  # instead of 600, from which on some hundred stand for all
    monkeypatch.setattr("inference.posterior.job.MOST_SAMPLED", most)
    monkeypatch.setattr("inference.posterior.job.MOST_AT_ONCE", n // 2)
    frames, ranges = frames_of(sensor, n)
    settings = SamplerSettings(seed=3, target_ess=100, method="importance")
    job = fold.prepare(sensor, parse_scene({}), frames, settings)
    checkpoint = begin(job, Starting())
    by = checkpoint.representatives
    assert by is not None
    assert len(by.chosen) < most < n
    again = type(checkpoint).from_bytes(checkpoint.to_bytes())
    found = fold.summarise(type(job).from_bytes(job.to_bytes()), again, 0.0, 0.0)
    assert found.verdict.converged
    assert found.fit.misfit is False
    q05, q95 = found.range_m.q05, found.range_m.q95
    seen = np.isfinite(ranges)
    assert np.array_equal(np.isfinite(q05), seen)
    assert [bool(modes) for modes in found.range_m.modes] == seen.tolist()
    off = (found.range_m.mean - ranges)[seen] / found.range_m.sd[seen]
    assert np.abs(off).max() < 7.0  # 405 ranges, normal: false alarm 2e-9
    # frames err together, by what all share: a band for the share that is held, not a binomial one
    assert ((q05 <= ranges) & (ranges <= q95))[seen].mean() > 0.6
    part, draws = fold.draw(job, checkpoint)
    assert part.numbers is not None
    assert draws.range_m.shape[-1] == len(part.numbers) == n // 2
    assert np.array_equal(np.isfinite(draws.range_m[0, 0, 0]), seen[part.numbers])
