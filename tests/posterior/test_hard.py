"""A curved posterior, of a background of which all is unknown: from populations to an answer."""

import numpy as np
import pytest

from inference.posterior.fold import merge, prepare, progress, run, summarise, tasks
from inference.posterior.job import Job
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.stage import Starting, Tempering
from inference.posterior.stages.starting import begin
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import RadialTrajectory

STRENGTH = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
DISTANCE = {"prior": "lognormal", "median": 3.0, "sigma": 0.5}


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [7.7e-6, 7.7e-6]}}
    )
    truth = parse_scene(
        {
            "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
            "background": {
                "strength": 0.017,
                "distance_m": 3.0,
                "shadow": {"c0": 0.056, "c1": 0.02},
            },
        }
    )
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=6, spacing="log")
    return simulate(sensor, truth, path, 5)


@pytest.fixture(scope="module")
def job(simulation: Simulation) -> Job:
    scene = parse_scene({"background": {"strength": STRENGTH, "distance_m": DISTANCE}})
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [7.7e-6, 7.7e-6]}}
    )
    return prepare(
        sensor, scene, simulation.frames, SamplerSettings(seed=3, ensembles=2, target_ess=100)
    )


@pytest.fixture(scope="module")
def begun(job: Job) -> Checkpoint:
    return begin(job, Starting())


def test_more_is_called_for_than_a_warm_start(begun: Checkpoint) -> None:
    assert isinstance(begun.stage, Tempering)
    assert begun.stage.scouted


def test_stopped_before_any_draw_it_says_so(job: Job, begun: Checkpoint) -> None:
    posterior = summarise(job, begun, 0.0, 0.0)
    assert not posterior.verdict.converged
    assert "no steps were made" in posterior.verdict.reasons
    assert progress(job, begun).steps == 0
    assert not posterior.drawn
    assert np.isnan(posterior.range_m.q50).all()


@pytest.mark.thorough
def test_it_converges_to_the_truth(job: Job, begun: Checkpoint, simulation: Simulation) -> None:
    """The truth lies within the posterior's central 1 - 1e-6 for every range: once in 1e5 not."""
    checkpoint = begun
    for _ in range(60):
        chunk = tasks(job, checkpoint)
        if not chunk:
            break
        checkpoint = merge(job, checkpoint, [run(task) for task in chunk])
    posterior = summarise(job, checkpoint, 0.0, 0.0)
    assert posterior.verdict.converged, posterior.verdict.reasons
    assert all(p.ess_bulk >= 100 for p in posterior.parameters.values())
    centre, spread = np.log(posterior.range_m.q50), np.log(posterior.range_m.q95)
    spread = (spread - np.log(posterior.range_m.q05)) / 3.29
    # heavier tails than a normal law's: ten of its standard deviations
    assert np.abs((np.log(simulation.range_m) - centre) / spread).max() < 10
