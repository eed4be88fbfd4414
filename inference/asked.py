"""A request for estimates, and what is found out of it once for all techniques."""

from collections.abc import Generator
from typing import NamedTuple

from inference.empty_frames import Contradiction, contradiction
from inference.estimates import LeftOut, TechniqueResult
from inference.first_step import first_step
from inference.known import known_of
from inference.plan import Plan, asked_with, obstacle
from inference.realtime.registry import TECHNIQUES
from inference.run import Said, by_prior, run
from inference.stated_light import StatedLight, stated_light
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Asked", "Found", "Turns", "asked_of"]


class Asked(NamedTuple):
    """A request, and what is found out of it once."""

    sensor: Sensor
    scene: Scene
    frames: Frames
    light: StatedLight | None  # where the crosstalk has priors
    against: Contradiction | None
    said: Said

    def rests_on_prior(self, name: str) -> bool:
        """Tell whether a technique needs the crosstalk, of which there is a prior."""
        own = TECHNIQUES.get(name)
        return self.light is not None and own is not None and "crosstalk" not in own.immune_to

    def obstacle(self, name: str) -> str | None:
        """Return why a technique is not asked, None if it is."""
        reason = ELSEWHERE.get(name)
        if reason is not None or self.rests_on_prior(name):
            return reason
        of, stated = asked_with(name, self.sensor, self.scene)
        return obstacle(ALL_TECHNIQUES[name], of, stated, known_of(stated, of), self.frames)

    def run(self, name: str) -> TechniqueResult | LeftOut:
        """Ask a technique that serves the scene."""
        if self.light is not None and self.rests_on_prior(name):
            return by_prior(self.sensor, self.light, self.frames, name, self.against)
        against = None if self.light is not None else self.against
        return run(self.sensor, self.scene, self.frames, name, against, self.said)

    def first_step(self, choice: Plan, refused: LeftOut | None) -> str:
        """Return what to do first where nothing answers."""
        return first_step(self.sensor, self.scene, self.frames, choice, refused)


class Found(NamedTuple):
    """Results, and why there are no others; see `Estimates`."""

    chosen: str | None
    results: tuple[TechniqueResult, ...]
    left_out: tuple[LeftOut, ...]
    do_first: str | None = None


Turns = Generator[Found, None, Found]
"""What is found, technique by technique, and in the end all of it."""


def asked_of(sensor: Sensor, scene: Scene, frames: Frames) -> Asked:
    """Return a request of which nothing has been asked yet.

    Parameters
    ----------
    sensor, scene, frames
        As for `inference.estimate.estimate`.
    """
    light = stated_light(sensor, scene)
    numbers, open_ = (scene, None) if light is None else (light.scene, light.sd)
    against = contradiction(numbers, sensor, frames, open_)
    return Asked(sensor, scene, frames, light, against, {})
