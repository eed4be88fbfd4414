"""Sine waves: no wrong number of roots, no root off by more than a thousand of its roundings."""

import dataclasses

import numpy as np
import pytest

from inference.estimate import all_roots
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.extreme.balls import exact, roots_of
from tests.extreme.wave_scenes import Wave
from tests.extreme.waves import WAVES, certified_roots, tally_waves, wave_error


@pytest.mark.parametrize("technique", WAVES)
def test_counts_are_proved_and_roots_are_sharp(technique: str) -> None:
    found = tally_waves(technique, scenes=4, frames=8, rng=np.random.default_rng(9))
    assert found.frames > 32
    assert found.roots > 16
    assert found.wrong == []
    assert found.excused <= 2
    assert found.worst < 1e3, found.where


def test_balls_count_what_is_known() -> None:
    """sin x in (0, 100) has 31 roots; a double root is none that can be told."""
    assert len(roots_of(lambda x: (1 + x).sin(), exact(99.0)) or []) == 31
    near = roots_of(lambda x: (x - 1) * (x - 1 - exact(2.0**-50)), exact(7.0))
    assert near is not None
    assert [float(r) for r in near] == [1.0, 1.0 + 2.0**-50]
    assert roots_of(lambda x: (x - 1) * (x - 1), exact(7.0)) is None


# as many turns make the steps of Newton's rule shrink slowly: by a fold a root was 349 units off
MANY_TURNS = Wave(
    technique="background_cancelling",
    frequency_hz=2583704825.1005497,
    offset=1.1735796735125161,
    gain=9882411589.550514,
    c0=5.841830795464189e-07,
    c1=-0.001528637405725907,
    c2=0.033649151049321965,
    distance=1.100975918372353,
    strength=0.1493968282097789,
    c0s=2.01922519241936e-09,
    c1s=-8.985427655844293e-05,
)


@pytest.mark.parametrize("longer", [1.0, 20.0])
def test_roots_by_a_fold_after_many_turns_are_as_sharp_as_any(longer: float) -> None:
    readings = (-1953.5849629644872, 1365.7925269209302)
    e = dataclasses.replace(MANY_TURNS, distance=longer * MANY_TURNS.distance)
    given = Frames(np.array([readings]))
    result = all_roots(e.technique, e.sensor, parse_scene(e.document), given)
    roots = result.roots_m[0, : result.root_count[0]].tolist()
    assert len(roots) == len(certified_roots(e, *readings) or [])
    assert max(wave_error(e, *readings, r) for r in roots) < 10
