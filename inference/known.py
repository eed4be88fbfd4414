"""What a scene states as known numbers, which is all that techniques of single frames can use."""

import dataclasses
import math

from simulator.remembered import remembered
from simulator.scene import Quantity, Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["Known", "known_of"]

# standard deviations, of a normal law, at which ranges end whose law has none: as
# inference.realtime.assemble takes an end of all ranges
_ENDLESS = 4.5


@dataclasses.dataclass(frozen=True)
class Known:
    """Known numbers by scene path, in the units of the scene.

    Attributes
    ----------
    numbers : dict of str to float
        Such as ``object.c0``, ``background.distance_m``, ``background.shadow.c1``; unknown ones
        are absent, as are those of optional terms.
    crosstalk : (float, float) or None
        What to subtract from the readings; None where it is unknown.
    support : (float, float)
        Where the scene's ``range_m`` has mass [m]; (0, inf) where it is not given. Of a pulse with
        a timing offset, where the late window is neither empty nor the whole pulse as well.
    stated_end_m : float or None
        Up to where ranges are to be expected that differ by whole turns of phase [m]: the end of
        the stated ``range_m``, and of a law without an end what one range of 300,000 is beyond.
        None where it is not given.
    """

    numbers: dict[str, float]
    crosstalk: tuple[float, float] | None
    support: tuple[float, float]
    stated_end_m: float | None

    def get(self, path: str) -> float:
        """Return a known number."""
        return self.numbers[path]

    def has(self, *paths: str) -> bool:
        """Whether all of these are known."""
        return all(path in self.numbers for path in paths)

    @property
    def unit(self) -> float:
        """Power of two near sqrt(c0) [m]: a unit of length that rounds nothing."""
        c0 = self.numbers.get("object.c0", 1.0)
        return 2.0 ** round(0.5 * math.log2(c0))


@remembered
def known_of(scene: Scene, sensor: Sensor | None = None) -> Known:
    """Collect the known numbers of a scene.

    Parameters
    ----------
    scene : Scene
        The scene; an optional term may be absent, so that none of its numbers counts as known.
    sensor : Sensor, optional
        Its timing offset cuts the support.
    """
    quantities: dict[str, Quantity | None] = {
        "object.c0": scene.object.c0,
        "object.c1": scene.object.c1,
        "object.c2": scene.object.c2,
    }
    if scene.background is not None:
        shadow = scene.shadow
        assert shadow is not None  # noqa: S101  # a background always has a shadow
        if not scene.background.optional:
            quantities["background.strength"] = scene.background.strength
        quantities["background.distance_m"] = scene.background.distance_m
        quantities["background.shadow.c0"], quantities["background.shadow.c1"] = shadow
    numbers = {
        path: float(value) for path, value in quantities.items() if isinstance(value, float | int)
    }
    crosstalk: tuple[float, float] | None = (0.0, 0.0)
    if scene.crosstalk_values is not None:
        first, second = scene.crosstalk_values
        crosstalk = None
        if isinstance(first, float | int) and isinstance(second, float | int):
            crosstalk = (float(first), float(second))
        if "crosstalk" in scene.optional_terms:
            crosstalk = None
    support, end = (0.0, math.inf), None
    if isinstance(scene.range_m, Stroke | Reference):
        support = (scene.range_m.low, scene.range_m.high)
        end = support[1]
    elif scene.range_m is not None:
        distribution = scene.range_m.distribution()
        support = (max(distribution.low, 0.0), distribution.high)
        end = support[1] if support[1] < math.inf else float(distribution.from_normal(_ENDLESS))
    if isinstance(sensor, PulsedSensor) and isinstance(sensor.timing_offset_s, float | int):
        shift = sensor.known_shift_m
        support = (max(support[0], -shift), min(support[1], sensor.r0 - shift))
    return Known(numbers, crosstalk, support, end)
