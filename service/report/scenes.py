"""The catalogue of the report: scenes, what makes their readings, and what is told of each."""

import dataclasses
from typing import Any, Literal

from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

__all__ = ["SCENES", "ReportScene", "sensor_at"]

Body = dict[str, Any]
Kind = Literal["pulsed", "sine_wave"]

# a plate of 0.4 m by 0.8 m, and an object whose brightness rises again with the range
_PLATE: Body = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
_FOLDED: Body = {"c0": 0.0769, "c1": -0.535, "c2": 0.0957}
_ROUGH: Body = {"c1": {"prior": "normal", "mean": -0.5, "sd": 0.05}}
_WALL: Body = {
    "strength": 0.0176838825658,
    "distance_m": 3.0,
    "shadow": {"c0": 0.0561, "c1": 0.0132},  # of real diffuse plates, and possible by its prior
}
# the same wall behind the plate without tilt, whose shadow is not as the object's light is
_REAL_WALL = _WALL | {"shadow": {"c0": 0.10204, "c1": -0.0285}}
# what is told of that shadow where it is unknown: by the default prior c1' is never negative
_REAL_SHADOW: Body = {
    "c0": {"prior": "lognormal", "median": 0.06, "sigma": 0.5},
    "c1": {"prior": "normal", "mean": 0.0, "sd": 0.03},
}
_SHADOWED = _WALL | {"shadow": "object"}
_AT_1_M = 0.00771  # what the plate reads there
_KINDS: dict[Kind, Body] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
_R0_M = 14.99
# crosstalk of half the plate's signal at a metre, and what is told of it where it is unknown
_CROSSTALK = {"pulsed": [2e-4, 4e-3], "sine_wave": [4e-3, 2e-3]}
_UNKNOWN_CROSSTALK: dict[Kind, list[Body]] = {
    "pulsed": [{"prior": "halfnormal", "sd": 1e-3}, {"prior": "halfnormal", "sd": 2e-2}],
    "sine_wave": [{"prior": "normal", "mean": 0.0, "sd": 1e-2}] * 2,
}
_STRENGTH: Body = {"prior": "lognormal", "median": 0.02, "sigma": 0.5}


@dataclasses.dataclass(frozen=True)
class ReportScene:
    """A scene, how its object moves, and what is told of it.

    Attributes
    ----------
    name : str
        What is there, in plain words.
    truth : Scene
        From which frames are simulated: all numbers.
    known : Scene
        What techniques of single frames and the tracker are told: all of the object.
    free : Scene
        What fits over many frames and posteriors are told: of the object nothing.
    snr : float
        Signal-to-noise ratio of both readings at 1 m.
    from_m, to_m : float
        The way of the object [m].
    empty : int
        Frames without the object among those of a fit or a posterior.
    plate : str
        Code of the plate whose light the optical simulator adds up; empty where the object
        parameter model makes the readings.
    quick : bool
        Whether it is part of the quick report.
    """

    name: str
    sensor: Sensor
    truth: Scene
    known: Scene
    free: Scene
    snr: float = 1e3
    from_m: float = 0.2
    to_m: float = 2.0
    empty: int = 0
    plate: str = ""
    quick: bool = False


def sensor_at(kind: Kind, snr: float) -> Sensor:
    """Return a sensor that reads the plate at 1 m with a signal-to-noise ratio."""
    noise = _AT_1_M / snr
    read = [noise / _R0_M, noise] if kind == "pulsed" else [noise, noise]
    return parse_sensor(_KINDS[kind] | {"noise": {"read": read}})


def _scene(
    name: str,
    kind: Kind = "pulsed",
    *,
    crosstalk: Literal["none", "known", "unknown"] = "none",
    wall: Literal["none", "known", "unknown"] = "none",
    own_shadow: bool = False,
    body: Body = _PLATE,
    free_object: Body | None = None,
    exact: bool = True,
    **more: Any,
) -> ReportScene:
    truth: Body = {"object": body}
    # what the model itself made is told to be exact; of real surfaces nothing is claimed
    told: Body = {"discrepancy": 0} if exact else {}
    if crosstalk != "none":
        truth["crosstalk"] = _CROSSTALK[kind]
        unknown = crosstalk == "unknown"
        told["crosstalk"] = _UNKNOWN_CROSSTALK[kind] if unknown else _CROSSTALK[kind]
    if wall != "none":
        cast = _REAL_WALL if more.get("plate") else _WALL
        truth["background"] = _SHADOWED if own_shadow else cast
        told["background"] = truth["background"]
        more = {"to_m": 1.5} | more
    free = dict(told) if free_object is None else {"object": free_object} | told
    if wall == "unknown":
        free["background"] = {"strength": _STRENGTH, "distance_m": 3.0}
        if own_shadow:
            free["background"]["shadow"] = "object"
        elif more.get("plate"):
            free["background"]["shadow"] = _REAL_SHADOW
        told["background"] = told["background"] | {"strength": _STRENGTH}
    return ReportScene(
        name,
        sensor_at(kind, more.get("snr", 1e3)),
        parse_scene(truth | {"discrepancy": 0}),
        parse_scene({"object": body} | told),
        parse_scene(free),
        **more,
    )


SCENES: tuple[ReportScene, ...] = (
    _scene("Bare object", quick=True),
    _scene("Bare object, sine wave", "sine_wave", quick=True),
    _scene("Known crosstalk", crosstalk="known"),
    _scene("Known crosstalk, sine wave", "sine_wave", crosstalk="known"),
    _scene("Unknown crosstalk", crosstalk="unknown", quick=True),
    _scene("Unknown crosstalk, 5 empty frames", crosstalk="unknown", empty=5, quick=True),
    _scene(
        "Unknown crosstalk, 5 empty frames, sine wave", "sine_wave", crosstalk="unknown", empty=5
    ),
    _scene("Known wall behind", wall="known", quick=True),
    _scene("Known wall behind, sine wave", "sine_wave", wall="known"),
    _scene("Wall of unknown strength and shadow", wall="unknown"),
    _scene("Wall of unknown strength and shadow, 5 empty frames", wall="unknown", empty=5),
    _scene(
        "Wall of unknown strength, the object's own shadow",
        wall="unknown",
        own_shadow=True,
        empty=5,
    ),
    _scene(
        "Wall of unknown strength, the object's own shadow, sine wave",
        "sine_wave",
        wall="unknown",
        own_shadow=True,
        empty=5,
    ),
    _scene("Known crosstalk and known wall", crosstalk="known", wall="known"),
    _scene(
        "Unknown crosstalk, known wall, 5 empty frames", crosstalk="unknown", wall="known", empty=5
    ),
    _scene(
        "Crosstalk and wall unknown, 5 empty frames", crosstalk="unknown", wall="unknown", empty=5
    ),
    _scene("Near: 3 to 20 cm", from_m=0.03, to_m=0.2),
    _scene("Near: 3 to 20 cm, sine wave", "sine_wave", from_m=0.03, to_m=0.2),
    _scene("Far: 1 to 10 m", from_m=1.0, to_m=10.0),
    _scene("Far: 1 to 10 m, sine wave", "sine_wave", from_m=1.0, to_m=10.0),
    _scene("Through the fold", body=_FOLDED, free_object=_ROUGH, from_m=0.1, to_m=0.8, quick=True),
    _scene(
        "Through the fold, sine wave",
        "sine_wave",
        body=_FOLDED,
        free_object=_ROUGH,
        from_m=0.1,
        to_m=0.8,
    ),
    _scene("Signal-to-noise ratio 10", snr=10.0),
    _scene("Signal-to-noise ratio 100", snr=100.0),
    _scene("Signal-to-noise ratio 10,000", snr=1e4),
    _scene("Signal-to-noise ratio 100,000", snr=1e5),
    _scene("Signal-to-noise ratio 1,000,000", snr=1e6),
    _scene("Signal-to-noise ratio 10, sine wave", "sine_wave", snr=10.0),
    _scene("Signal-to-noise ratio 100, sine wave", "sine_wave", snr=100.0),
    _scene("Signal-to-noise ratio 10,000, sine wave", "sine_wave", snr=1e4),
    _scene("Signal-to-noise ratio 100,000, sine wave", "sine_wave", snr=1e5),
    _scene("Signal-to-noise ratio 1,000,000, sine wave", "sine_wave", snr=1e6),
    _scene("Real plate", plate="W04H08R00T00", exact=False, quick=True),
    _scene("Real plate before a known wall", plate="W04H08R00T00", wall="known", exact=False),
    _scene(
        "Real plate before a wall of unknown strength and shadow, 5 empty frames",
        plate="W04H08R00T00",
        wall="unknown",
        empty=5,
        exact=False,
    ),
    _scene("Real plate, sine wave", "sine_wave", plate="W04H08R00T00", exact=False),
    _scene("Real plate, told that the model is exact", plate="W04H08R00T00"),
    _scene("Real glossy plate, tilted", plate="W04H08R05T06", exact=False),
    _scene(
        "Real plate, unknown crosstalk, 5 empty frames",
        plate="W04H08R00T00",
        crosstalk="unknown",
        empty=5,
        exact=False,
    ),
)
"""All scenes, those of the quick report in their order among the others."""
