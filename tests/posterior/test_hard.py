"""A curved posterior, of a background of which all is unknown: from populations to an answer."""

import numpy as np
import pytest

from inference.posterior.fold import merge, prepare, progress, run, start, summarise, tasks
from inference.posterior.job import Checkpoint, Job
from inference.posterior.settings import SamplerSettings
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
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=12, spacing="log")
    return simulate(sensor, truth, path, 5)


@pytest.fixture(scope="module")
def job(simulation: Simulation) -> Job:
    scene = parse_scene({"background": {"strength": STRENGTH, "distance_m": DISTANCE}})
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [7.7e-6, 7.7e-6]}}
    )
    return prepare(sensor, scene, simulation.frames, SamplerSettings(seed=3, target_ess=100))


@pytest.fixture(scope="module")
def begun(job: Job) -> Checkpoint:
    return start(job)


def test_populations_are_called_for(begun: Checkpoint) -> None:
    assert len(begun.populations) == 2
    assert begun.ensembles == ()


def test_stopped_before_any_draw_it_says_so(job: Job, begun: Checkpoint) -> None:
    posterior = summarise(job, begun, 0.0, 0.0)
    assert not posterior.verdict.converged
    assert "no steps were made" in posterior.verdict.reasons
    assert progress(job, begun).steps == 0
    assert np.isfinite(posterior.range_m.q50).all()


def test_through_a_store_to_convergence(
    job: Job, begun: Checkpoint, simulation: Simulation
) -> None:
    """The same to the last bit, whether checkpoints and pieces go through bytes or not.

    The truth lies within the posterior's central 1 - 1e-6 for every range: a false alarm of 1e-5.
    """
    stored, direct = begun, begun
    for _ in range(60):
        chunk = tasks(job, direct)
        if not chunk:
            break
        direct = merge(job, direct, [run(task) for task in chunk])
        if not stored.ensembles:  # populations and the first steps of the ensembles
            again = Job.from_bytes(job.to_bytes())
            stored = Checkpoint.from_bytes(stored.to_bytes())
            stored = merge(again, stored, [run(task) for task in tasks(again, stored)])
            assert len(stored.ensembles) == len(direct.ensembles)
            for one, other in zip(stored.ensembles, direct.ensembles, strict=True):
                assert np.array_equal(one.coords, other.coords)
            for first, second in zip(stored.populations, direct.populations, strict=True):
                assert first is not None
                assert second is not None
                assert np.array_equal(first.z, second.z)
                assert first.log_evidence == second.log_evidence
    posterior = summarise(job, direct, 0.0, 0.0)
    assert posterior.verdict.converged, posterior.verdict.reasons
    assert all(p.ess_bulk >= 100 for p in posterior.parameters.values())
    centre, spread = np.log(posterior.range_m.q50), np.log(posterior.range_m.q95)
    spread = (spread - np.log(posterior.range_m.q05)) / 3.29
    # heavier tails than a normal law's: ten of its standard deviations
    assert np.abs((np.log(simulation.range_m) - centre) / spread).max() < 10
