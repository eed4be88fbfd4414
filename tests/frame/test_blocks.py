"""Frames in blocks: what a block says is the sum of what its frames say, the prior once."""

import math

import numpy as np
import pytest

from inference.frame.arguments import FrameScene, Instrument, RangePrior, Shape
from inference.frame.blocks import (
    Block,
    Frame,
    block_of,
    frame_count,
    frame_of,
    is_empty,
    one_block,
    own_blocks,
)
from inference.frame.log_density import empty_log_likelihood, log_density, slope_and_curvature
from inference.frame.range_prior import log_range_density, prior_curvature, prior_slope

FRAMES = np.array([[0.001, 0.02, 1.0], [0.0012, 0.03, 1.5], [0.0008, 0.015, 0.7]])
PRESENT = np.array([True, False, True])
PRIOR = RangePrior(0.3, -1.0, 0.0, 0.0, -0.5, 0.8, 0.02, 10.0, False)
SCENE = FrameScene(
    Shape(0.0074, 0.0769, -0.123),
    (0.0002, 0.001),
    None,
    PRIOR,
    Instrument(15.0, None, (1e-3, 2e-3), 1e-4, 0.02),
    None,
)


def singles() -> list[Block]:
    return [Block(Frame(*row.tolist()), None) for row in FRAMES]


def test_a_block_is_the_sum_of_its_frames_with_one_prior() -> None:
    u = -0.4
    r, block = math.exp(u), Block(None, FRAMES)
    prior = log_range_density(r, u, PRIOR)
    wanted = prior + sum(log_density(u, one, SCENE) - prior for one in singles())
    assert log_density(u, block, SCENE) == pytest.approx(wanted, rel=1e-13)
    held = (prior_slope(r, u, PRIOR), sum(prior_curvature(r, PRIOR)))
    for k, found in enumerate(slope_and_curvature(u, block, SCENE)):
        parts = [slope_and_curvature(u, one, SCENE)[k] - held[k] for one in singles()]
        assert found == pytest.approx(held[k] + sum(parts), rel=1e-12)
    empty = sum(empty_log_likelihood(one, SCENE) for one in singles())
    assert empty_log_likelihood(block, SCENE) == pytest.approx(empty, rel=1e-13)


def test_every_frame_is_a_block_of_its_own() -> None:
    data = own_blocks(FRAMES, PRESENT)
    assert data.blocks == 3
    assert data.strongest == 1.5
    for b in range(3):
        block = block_of(data, b)
        assert frame_count(block) == 1
        assert tuple(frame_of(block, 0)) == (*FRAMES[b], None)
        assert is_empty(data, b) == (not PRESENT[b])


def test_frames_of_one_range_come_first_and_empty_ones_alone() -> None:
    data = one_block(FRAMES, PRESENT)
    assert data.blocks == 2
    assert data.strongest == 1.0  # of those that may hold an object
    counts = [frame_count(block_of(data, b)) for b in range(data.blocks)]
    assert counts == [2, 1]
    assert [bool(is_empty(data, b)) for b in range(data.blocks)] == [False, True]
    assert tuple(frame_of(block_of(data, 0), 1)) == (*FRAMES[2], None)
    assert tuple(frame_of(block_of(data, 1), 0)) == (*FRAMES[1], None)


@pytest.mark.parametrize("present", [None, np.zeros(3, dtype=bool)])
def test_one_block_of_all_frames_or_of_none(present: np.ndarray | None) -> None:
    data = one_block(FRAMES, present)
    assert data.blocks == (1 if present is None else 3)
    assert [bool(is_empty(data, b)) for b in range(data.blocks)] == (
        [False] if present is None else [True] * 3
    )
