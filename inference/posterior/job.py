"""What is to be inferred, and where the work stands."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.density.static import with_common_range
from inference.posterior.archive import pack, pack_parts, unpack, unpack_parts
from inference.posterior.checks import check_scene_for_posterior
from inference.posterior.sampling.ensemble import Ensemble
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.verdict import Chains, Verdict, chains_of
from inference.posterior.selection.selection import Selection
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames, check_frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.validated import parse

__all__ = ["Checkpoint", "Job", "chains", "prepare"]


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """What is to be inferred, checked.

    Attributes
    ----------
    sensor, scene : Sensor, Scene
        As given.
    frames : Frames
        As given, saturated ones included.
    settings : SamplerSettings
        With a seed.
    """

    sensor: Sensor
    scene: Scene
    frames: Frames
    settings: SamplerSettings

    @property
    def seed(self) -> int:
        """The seed of every random stream of the job."""
        seed = self.settings.seed
        if seed is None:
            raise ValueError("a job is made by `prepare`, which draws the seed")
        return seed

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Frames that are not saturated, shape (n,)."""
        if self.sensor.full_scale is None:
            return np.ones(len(self.frames), dtype=bool)
        limit = np.asarray(self.sensor.full_scale)
        return np.asarray((np.abs(self.frames.readings) < limit).all(axis=1))

    def to_bytes(self) -> bytes:
        """Return the job for a store."""
        arrays: dict[str, NDArray[Any]] = {}
        meta = {
            "sensor": self.sensor.model_dump(mode="json"),
            "scene": self.scene.model_dump(mode="json", exclude_none=True),
            "settings": self.settings.model_dump(mode="json"),
            "frames": pack_parts(self.frames, "frames", arrays),
        }
        return pack(meta, arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Job":
        """Read what `to_bytes` wrote."""
        meta, arrays = unpack(data)
        return cls(
            parse_sensor(meta["sensor"]),
            parse_scene(meta["scene"]),
            unpack_parts(meta["frames"], arrays),
            parse(SamplerSettings, meta["settings"]),
        )

    def density(self) -> CollapsedDensity:
        """Return the collapsed density of the usable frames."""
        density = collapsed_density(self.sensor, self.scene, self.frames.select(self.usable))
        if self.scene.motion == "static":
            return with_common_range(density)
        if self.scene.discrepancy is None:
            return density
        return with_discrepancy(density, self.scene.discrepancy)

    def stream(self, *purpose: int) -> np.random.Generator:
        """Return the random stream of one purpose; streams of different purposes are distinct."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=purpose))


@dataclasses.dataclass(frozen=True, eq=False)
class Checkpoint:
    """Where a job stands.

    Attributes
    ----------
    method : "emcee" or "importance"
        What is being done.
    optima : Mixture or None
        Laplace approximations at the optima; None where nothing is unknown.
    proposal : Proposal or None
        What the independent move proposes from; adapted to pilot draws that are then thrown away.
    calls : int
        Density evaluations so far.
    verdict : Verdict
        On the draws so far.
    adaptations : int
        How often the proposal was adapted.
    populations : tuple of Population or None
        On their way from the prior to the posterior, where the Laplace shapes do not fit; None
        before they are drawn.
    ensembles : tuple of Ensemble
        Empty with importance sampling, and as long as populations are on their way.
    weighted : WeightedDraws or None
        With importance sampling.
    ess, r_hat : float or None
        Least effective sample size and largest R-hat so far.
    finished : bool
        Whether more steps would serve nothing.
    selection : Selection or None
        With optional terms in the scene: which of them stay.
    """

    method: str
    optima: Mixture | None
    proposal: Proposal | None
    calls: int
    verdict: Verdict
    adaptations: int = 0
    populations: tuple[Population | None, ...] = ()
    ensembles: tuple[Ensemble, ...] = ()
    weighted: WeightedDraws | None = None
    ess: float | None = None
    r_hat: float | None = None
    finished: bool = False
    selection: Selection | None = None

    def to_bytes(self) -> bytes:
        """Return the checkpoint for a store."""
        arrays: dict[str, NDArray[Any]] = {}
        meta = {
            field.name: pack_parts(getattr(self, field.name), field.name, arrays)
            for field in dataclasses.fields(self)
        }
        return pack(meta, arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> "Checkpoint":
        """Read what `to_bytes` wrote."""
        meta, arrays = unpack(data)
        return cls(**{name: unpack_parts(item, arrays) for name, item in meta.items()})


def prepare(sensor: Sensor, scene: Scene, frames: Frames, settings: SamplerSettings) -> Job:
    """Check a request before any time is spent on it.

    Parameters
    ----------
    sensor, scene, frames : Sensor, Scene, Frames
        The request.
    settings : SamplerSettings
        Without a seed, one is drawn from the operating system.

    Returns
    -------
    Job

    Raises
    ------
    InvalidInputError
        Pointers below /scene, /frames.
    RefusedError
        Where no honest answer exists; with the remedy.
    """
    check_frames(sensor, frames)
    if scene.motion == "tangential":
        raise RefusedError(
            "the object's amplitude changes from frame to frame in tangential motion, and the "
            "posterior has one amplitude for all frames; use the technique `differential`"
        )
    if settings.seed is None:
        # of 53 bits, which readers of JSON that know only floats do not round
        seed = int(np.random.SeedSequence().generate_state(1, np.uint64)[0] >> 11)
        settings = settings.model_copy(update={"seed": seed})
    job = Job(sensor, scene, frames, settings)
    if not job.usable.any():
        raise RefusedError("every frame is saturated: lower the gain or the exposure")
    check_scene_for_posterior(sensor, scene, frames.select(job.usable))
    return job


def chains(job: Job, checkpoint: Checkpoint) -> Chains:
    """Return the kept draws of an emcee checkpoint."""
    if checkpoint.optima is None:
        raise ValueError("nothing was sampled")
    names = parameters_of(job.sensor, job.scene).names
    return chains_of(checkpoint.ensembles, checkpoint.optima.nearest, names)
