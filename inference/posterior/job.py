"""What is to be inferred, checked before any time is spent on it."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.density.representatives import Representatives, standing_for
from inference.density.static import with_common_range
from inference.frame.blocks import RANGE
from inference.frame.known_range import columns_of
from inference.posterior.answer.clock import with_clock_error
from inference.posterior.archive import pack, pack_parts, unpack, unpack_parts
from inference.posterior.checks import check_scene_for_posterior
from inference.posterior.libraries import import_libraries
from inference.posterior.settings import SamplerSettings
from inference.posterior.streams import Stream
from simulator.at_temperature import warmth
from simulator.errors import RefusedError
from simulator.frames import Frames, check_frames
from simulator.model_error import ErrorSizes, ModelError
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.validated import parse

__all__ = ["MOST_AT_ONCE", "MOST_SAMPLED", "Job", "prepare"]

MOST_SAMPLED = 600  # frames; of more, some hundred are sampled in the name of all
MOST_AT_ONCE = 2000  # frames whose ranges are drawn and judged together


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
    representatives : Representatives or None
        Usable frames that are sampled in the name of all; None where all are.
    numbers : ndarray of int, shape (n,), or None
        Of a part of a job: which of the frames that were sent these are.
    flux_times : float
        By what the error of the flux is larger than the scene allows, where its readings ask for
        that.
    noise_times : float
        By what the variance of the noise is larger than stated, likewise.
    """

    sensor: Sensor
    scene: Scene
    frames: Frames
    settings: SamplerSettings
    representatives: Representatives | None = None
    numbers: NDArray[np.intp] | None = None
    flux_times: float = 1.0
    noise_times: float = 1.0

    @property
    def seed(self) -> int:
        """The seed of every random stream of the job."""
        seed = self.settings.seed
        if seed is None:
            raise ValueError("a job is made by `prepare`, which draws the seed")
        return seed

    @property
    def model_error(self) -> ModelError:
        """Sizes of the model's errors: those that the scene allows, or the readings ask for."""
        error = self.scene.allowed_error
        return dataclasses.replace(error, flux=self.flux_times * error.flux)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Frames that are not saturated, and of known temperature where it counts, shape (n,)."""
        usable = ~self.frames.saturated(self.sensor)
        warm = warmth(self.sensor, self.frames)
        return np.asarray(usable if warm is None else usable & np.isfinite(warm))

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
        import_libraries()
        meta, arrays = unpack(data)
        return cls(
            parse_sensor(meta["sensor"]),
            parse_scene(meta["scene"]),
            unpack_parts(meta["frames"], arrays),
            parse(SamplerSettings, meta["settings"]),
        )

    def density(self) -> CollapsedDensity:
        """Return the collapsed density of the usable frames."""
        error = self.scene.allowed_error
        frames = with_clock_error(self.frames.select(self.usable), error.range_m)
        density = collapsed_density(self.sensor, self.scene, frames)
        if self.scene.motion == "static":
            return with_common_range(density)
        if self.representatives is not None:
            return standing_for(density, self.representatives)
        if error.integrated and error.flux > 0:
            return with_discrepancy(density, error.flux)
        return density

    @property
    def sampled_frames(self) -> int:
        """How many frames a density is computed from."""
        by = self.representatives
        return int(self.usable.sum()) if by is None else len(by.chosen)

    @property
    def is_large(self) -> bool:
        """Whether it has so many frames that a few of them are sampled in the name of all."""
        integrated = self.scene.model_error.integrated and self.scene.model_error.flux > 0
        coupled = integrated or self.scene.motion == "static"
        return not coupled and int(self.usable.sum()) > MOST_SAMPLED

    @property
    def can_integrate_error(self) -> bool:
        """Whether there is an error of the flux that is not, but could be, integrated out."""
        error = self.scene.allowed_error
        few = len(self.frames) <= MOST_SAMPLED and self.scene.motion == "radial"
        return few and error.flux > 0 and not error.integrated

    def with_error_integrated(self) -> "Job":
        """Return the job with the error of the flux integrated out in full.

        Linear response starts from the posterior of an exact model. Where that lies too far from
        the truth it cannot be put right to first order (docs/model.md, model-response).
        """
        error = self.scene.allowed_error
        sizes = ErrorSizes(flux=error.flux, range_m=error.range_m, shadow=error.shadow)
        scene = self.scene.model_copy(update={"discrepancy": sizes})
        return dataclasses.replace(self, scene=scene)

    def parts(self) -> tuple["Job", ...]:
        """Return jobs of a part of the frames each, none larger than what is judged at once.

        Frames are dealt out at random: each part is a picture of the whole.
        """
        usable = np.flatnonzero(self.usable)
        if not self.is_large or len(usable) <= MOST_AT_ONCE:
            return (dataclasses.replace(self, representatives=None),)
        count = -(-len(usable) // MOST_AT_ONCE)
        dealt = self.stream(Stream.PARTS).permutation(usable)
        return tuple(self.part(np.sort(dealt[k::count])) for k in range(count))

    def of_sent(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return indices of frames of this part as those of the frames that were sent."""
        return index if self.numbers is None else self.numbers[index]

    def part(self, numbers: NDArray[np.intp]) -> "Job":
        """Return the job of some of the frames alone."""
        frames = self.frames.select(numbers)
        return dataclasses.replace(self, frames=frames, representatives=None, numbers=numbers)

    def seeds(self, purpose: Stream, *numbers: int) -> np.random.SeedSequence:
        """Return the seed of one purpose; those of different purposes are independent."""
        return np.random.SeedSequence(self.seed, spawn_key=(purpose, *numbers))

    def stream(self, purpose: Stream, *numbers: int) -> np.random.Generator:
        """Return the random stream of one purpose."""
        return np.random.default_rng(self.seeds(purpose, *numbers))


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
    if columns_of(frames).shape[1] > RANGE and job.can_integrate_error:
        # readings that outweigh what is known of ranges contradict it where no model is exact
        job = job.with_error_integrated()
    if not job.usable.any():
        if sensor.temperature is not None:
            raise RefusedError("every frame is saturated, or its temperature_k is null")
        raise RefusedError("every frame is saturated: lower the gain or the exposure")
    check_scene_for_posterior(sensor, scene, frames.select(job.usable))
    import_libraries()
    return job
