"""A job whose time ended before its sampling began: with draws, or what is known without."""

import functools
import math

import pytest

from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.looking import LookTask
from inference.posterior.stages.stage import Starting
from inference.posterior.stages.stopped import stopped
from tests.posterior.scenes import example

LIMIT = 8.0


@functools.cache
def _job() -> fold.Job:
    settings = SamplerSettings(seed=7, max_seconds=LIMIT)
    return fold.prepare(*example("pulsed", crosstalk=False), settings)


@functools.cache
def _looked() -> tuple[fold.Checkpoint, Starting]:
    """Return where the optima are known, and nothing is drawn yet."""
    begun = fold.start(_job())
    found = fold.merge(_job(), begun, [fold.run(task) for task in fold.tasks(_job(), begun)])
    assert isinstance(found.stage, Starting)
    assert found.stage.optima
    return found, found.stage


def test_beyond_its_time_nothing_is_begun_and_what_is_known_is_said() -> None:
    found = fold.summarise(_job(), _looked()[0], LIMIT, LIMIT)
    assert not found.drawn
    assert found.verdict.reasons[0] == "stopped at the time limit of 8 s"
    assert "its time ended before sampling began" in found.verdict.reasons
    assert not found.verdict.converged
    assert all(math.isnan(row.mean) for row in found.parameters.values())
    assert found.fit.misfit is None
    assert all(row.status != "identified" for row in found.identifiability)
    assert found.runtime.likelihood_calls == _looked()[0].calls
    optima = _looked()[1].optima
    assert found.modes[0].log_density == pytest.approx(optima[0].log_density)
    assert all(mode.weight is None for mode in found.modes)


@pytest.mark.parametrize("cpu_s", [0.0, LIMIT - 0.1])
def test_within_its_time_draws_are_made(cpu_s: float) -> None:
    found = fold.summarise(_job(), _looked()[0], cpu_s, cpu_s)
    assert found.drawn
    assert all(row.q05 < row.q95 for row in found.parameters.values())


def test_a_short_limit_is_passed_by_some_seconds_where_that_gives_draws() -> None:
    settings = SamplerSettings(seed=7, max_seconds=0.5)
    job = fold.prepare(*example("pulsed", crosstalk=False), settings)
    assert fold.summarise(job, _looked()[0], 4.9, 4.9).drawn
    assert not fold.summarise(job, _looked()[0], 5.0, 5.0).drawn


def test_where_no_optimum_is_known_one_is_looked_for() -> None:
    """Nothing could be said otherwise."""
    found = stopped(_job(), Starting(), 2 * LIMIT)
    assert not isinstance(found.stage, Starting)
    assert found.calls > 0
    assert fold.summarise(_job(), fold.start(_job()), 2 * LIMIT, 2 * LIMIT).drawn


def test_scouts_set_out_last_where_time_is_short() -> None:
    """What is found is the same; where time ends before them, there are optima to tell of."""
    hurried = fold.prepare(
        *example("pulsed", crosstalk=False), SamplerSettings(seed=7, max_seconds=0.5)
    )
    begun = fold.start(hurried)
    ways = [task.way for task in fold.tasks(hurried, begun) if isinstance(task, LookTask)]
    assert ways == ["fitted", "climbed"]
    pieces = [fold.run(task) for task in fold.tasks(hurried, begun)]
    found = fold.merge(hurried, begun, pieces)
    assert isinstance(found.stage, Starting)
    assert found.stage.optima
    assert not fold.summarise(hurried, found, 5.0, 5.0).drawn
    pieces = [fold.run(task) for task in fold.tasks(hurried, found)]
    assert len(pieces) == 1
    (other, _), now = _looked(), fold.merge(hurried, found, pieces)
    assert now.to_bytes() == other.to_bytes()
