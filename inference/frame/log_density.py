"""The density of frames along their range: what the collapsed likelihood integrates.

Kernels take a block: the frames that have one range in common.
"""

import math

from inference.frame.arguments import FrameScene, Pair
from inference.frame.blocks import Block, frame_count, frame_of
from inference.frame.gaussian import (
    covariance_slope,
    empty_gaussian,
    gaussian,
    log_top,
    precision_product,
    precision_times,
)
from inference.frame.known_range import (
    known_information,
    known_log_density,
    known_rounding,
    known_slope,
)
from inference.frame.mean_readings import readings_along, readings_at, with_surroundings
from inference.frame.range_prior import (
    LEAST_INFORMATION,
    log_range_density,
    log_resolved,
    prior_curvature,
    prior_slope,
)
from simulator.compiled import compiled
from simulator.inlined import inlined

__all__ = [
    "empty_log_likelihood",
    "log_density",
    "rounding",
    "slope_and_curvature",
]

_DIFFERENCE = 1e-3  # in log r, over which the resolution changes slowly
_EPSILON = 2.0**-52


@compiled
def _information(u: float, gain: float, scene: FrameScene) -> float:
    """Return the Fisher information of a frame on its log r."""
    signal, _, mean, slope = readings_along(u, math.exp(u), gain, scene)
    return precision_product(slope, slope, mean, signal, scene.instrument)


@compiled
def _log_resolution(u: float, block: Block, scene: FrameScene) -> float:
    """Return the log of the reference prior of a block's log r, I its Fisher information.

    What is known of the range beside the readings is part of it: a range that is known exactly has
    no other law than that.

    It is that of sqrt(I / I0) where the readings tell ranges apart, and log-uniform where they do
    so to worse than I0 = `LEAST_INFORMATION`. Of any other prior nobody asks for it: a call, which
    hands over all of a scene, takes longer than to look whether.
    """
    total = 0.0
    for j in range(frame_count(block)):
        frame = frame_of(block, j)
        total += _information(u, frame.gain, scene)
        total += known_information(math.exp(u), frame.known)
    return log_resolved(max(total, 0.0) / LEAST_INFORMATION, scene.range_prior.dark)


@inlined
@compiled
def log_density(u: float, block: Block, scene: FrameScene) -> float:
    """Return log p(readings, u | theta) of a block less `log_top` of each frame.

    Parameters
    ----------
    u : float
        log r.
    block : Block
        The frames.
    scene : FrameScene
        The parameters.
    """
    r, prior, total, told = math.exp(u), scene.range_prior, 0.0, 0.0
    for j in range(frame_count(block)):
        frame = frame_of(block, j)
        if prior.resolves:
            signal, _, mean, slope = readings_along(u, r, frame.gain, scene)
            told += precision_product(slope, slope, mean, signal, scene.instrument)
            told += known_information(r, frame.known)
        else:
            signal, mean = readings_at(u, r, frame.gain, scene)
        residual = (frame.first - mean[0], frame.second - mean[1])
        total += gaussian(residual, mean, signal, scene.instrument)
        total += known_log_density(r, frame.known, scene.offset)
    total += log_range_density(r, u, prior)
    if prior.resolves:
        total += log_resolved(max(told, 0.0) / LEAST_INFORMATION, prior.dark)
    return total


@compiled
def slope_and_curvature(u: float, block: Block, scene: FrameScene) -> Pair:
    """Return the slope of `log_density` along u and its Gauss-Newton curvature, never negative.

    The curvature holds the covariance fixed.
    """
    r, prior, instrument = math.exp(u), scene.range_prior, scene.instrument
    rise, bend = prior_slope(r, u, prior), 0.0
    for j in range(frame_count(block)):
        frame = frame_of(block, j)
        signal, signal_slope, mean, slope = readings_along(u, r, frame.gain, scene)
        residual = frame.first - mean[0], frame.second - mean[1]
        rise += precision_product(residual, slope, mean, signal, instrument)
        rise += covariance_slope(residual, mean, slope, signal, signal_slope, instrument)
        bend += precision_product(slope, slope, mean, signal, instrument)
        rise += known_slope(r, frame.known, scene.offset)
        bend += known_information(r, frame.known)
    if prior.resolves:
        ahead = _log_resolution(u + _DIFFERENCE, block, scene)
        behind = _log_resolution(u - _DIFFERENCE, block, scene)
        rise += (ahead - behind) / (2 * _DIFFERENCE)
    of_logarithm, of_range = prior_curvature(r, prior)
    return rise, bend + of_logarithm + of_range


@compiled
def rounding(u: float, block: Block, scene: FrameScene) -> float:
    """Return by how much rounding moves `log_density` from one u to the next, in size.

    A residual e is the difference of a reading and a mean y that are known to eps |y|, and that of
    log r itself moves the mean by its slope. In one reading of standard deviation s that is
    eps |y| / s (1 + |e| / s) nat: at readings 1e8 times above their noise more than panels agree
    to anyway.
    """
    r, instrument, total = math.exp(u), scene.instrument, 0.0
    for j in range(frame_count(block)):
        frame = frame_of(block, j)
        signal, _, mean, slope = readings_along(u, r, frame.gain, scene)
        residual = (frame.first - mean[0], frame.second - mean[1])
        pull = precision_times(residual, mean, signal, instrument)
        first = precision_times((1.0, 0.0), mean, signal, instrument)[0]
        second = precision_times((0.0, 1.0), mean, signal, instrument)[1]
        moved = (1.0 + abs(u)) * abs(slope[0]), (1.0 + abs(u)) * abs(slope[1])
        size = abs(frame.first) + abs(mean[0]) + abs(signal[0]) + moved[0]
        total += size * (abs(pull[0]) + math.sqrt(first))
        size = abs(frame.second) + abs(mean[1]) + abs(signal[1]) + moved[1]
        total += size * (abs(pull[1]) + math.sqrt(second))
        total += known_rounding(r, u, frame.known, scene.offset)
    return _EPSILON * total


@compiled
def empty_log_likelihood(block: Block, scene: FrameScene) -> float:
    """Return the log density of frames of which it is known that no object is in them."""
    total = 0.0
    for j in range(frame_count(block)):
        frame = frame_of(block, j)
        mean = with_surroundings((0.0, 0.0), math.inf, frame.gain, scene)
        residual = (frame.first - mean[0], frame.second - mean[1])
        total += empty_gaussian(residual, mean, scene.instrument)
        total += log_top(scene.instrument.read)
    return total
