"""The scenes of the demo, each sent to the service and answered by it."""

from pathlib import Path
from typing import Any

import numpy as np

from service.adapters.histograms import calibrate, pulsed
from service.adapters.recordings import read_recording
from service.demo.answers import Answer, Episode, of_estimates, of_posterior
from service.demo.running import Client
from service.demo.table import rows_shown

__all__ = ["EPISODES", "crosstalk", "derivatives", "nearest", "phases"]

Body = dict[str, Any]

_SEED = 1
_EMPTY = 5  # frames without the object
_PULSED: Body = {
    "kind": "pulsed",
    "pulse_width_s": 1e-7,
    "noise": {"read": [2e-6, 1e-4], "relative": 2e-4},
}
_PLATE: Body = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}  # 0.4 m x 0.4 m, diffuse


def _simulated(client: Client, sensor: Body, scene: Body, trajectory: Body) -> tuple[Body, Any]:
    body = {"sensor": sensor, "scene": scene, "trajectory": trajectory, "seed": _SEED}
    answer = client.post("/v1/simulations", body)
    return answer["frames"], answer["truth"]["range_m"]


def _estimates(
    client: Client, sensor: Body, scene: Body, frames: Body, truth: list[float], technique: str
) -> Answer:
    body = {"sensor": sensor, "scene": scene, "frames": frames, "techniques": [technique]}
    (result,) = client.post("/v1/estimates", body)["results"]
    # empty frames come last, and have no truth
    return of_estimates(technique, truth, result["frames"][: len(truth)])


def _posterior(
    client: Client,
    sensor: Body,
    scene: Body,
    frames: Body,
    truth: list[float],
) -> Answer:
    sampler = {"seed": _SEED, "method": "emcee"}
    body = {"sensor": sensor, "scene": scene, "frames": frames, "sampler": sampler}
    (posterior,) = client.posteriors([body])
    return of_posterior("posterior", truth, posterior)


def _posteriors_of_each(
    client: Client, sensor: Body, scene: Body, frames: Body, truth: list[float]
) -> Answer:
    """Ask for a posterior of each frame alone, of those that the table shows."""
    shown = rows_shown(len(truth))
    # one unknown: importance sampling is enough where it can be trusted
    body = {"sensor": sensor, "scene": scene, "sampler": {"seed": _SEED, "method": "auto"}}
    first, *others = [
        body | {"frames": {name: [column[i]] for name, column in frames.items()}} for i in shown
    ]
    # the first has the machine code made that all of them need
    posteriors = client.posteriors([first]) + client.posteriors(others)
    answers = [
        of_posterior("posterior", [truth[i]], posterior)
        for i, posterior in zip(shown, posteriors, strict=True)
    ]
    points = tuple(answer.points[0] for answer in answers)
    return Answer("posterior", points, "a posterior of each frame alone")


def nearest(client: Client, recordings: Path) -> Episode:
    """Send recorded photons of a plane where they are at hand, else a simulated plate."""
    scene: Body = {}
    if recordings.exists():
        sensor, frames, truth = _recorded(client, recordings)
        # nobody calibrated the emitter
        scene = {"object": {"c2": {"prior": "lognormal", "median": 1.0, "sigma": 3.0}}}
        title, source = "A plane, recorded photons", f"recorded ({recordings})"
    else:
        sensor = _PULSED
        trajectory = {"kind": "radial", "from_m": 0.1, "to_m": 2.0, "frames": 40, "spacing": "log"}
        frames, truth = _simulated(client, sensor, {"object": _PLATE}, trajectory)
        title, source = "A plate of unknown size", "simulated"
    answers = (
        _estimates(client, sensor, scene, frames, truth, "conventional"),
        _posterior(client, sensor, scene, frames, truth),
    )
    return Episode(title, source, answers)


def _recorded(client: Client, path: Path) -> tuple[Body, Body, list[float]]:
    """Every other position from 0.1 to 0.4 m, its time axis calibrated to the robot's truth."""
    recording = read_recording(path)
    wanted = (recording.distance_m >= 0.1) & (recording.distance_m <= 0.4)
    recording = recording.select(wanted).select(slice(None, None, 2))
    sensor, frames = pulsed(recording)
    body = {
        "sensor": sensor.model_dump(mode="json", exclude_none=True),
        "scene": {},
        "frames": frames.to_columns(sensor),
        "techniques": ["conventional"],
    }
    (result,) = client.post("/v1/estimates", body)["results"]
    raw = np.array([frame["range_m"] for frame in result["frames"]])
    calibration = calibrate(raw, recording.distance_m)
    sensor, frames = pulsed(recording, calibration, gain=1e6)
    document = sensor.model_dump(mode="json", exclude_none=True)
    return document, dict(frames.to_columns(sensor)), recording.distance_m.tolist()


def crosstalk(client: Client, _: Path) -> Episode:
    """Send a plate of unknown size behind a cover glass, and five frames without it."""
    glass = {"object": _PLATE, "crosstalk": [0.004, 0.4]}
    way = {"kind": "radial", "from_m": 0.15, "to_m": 2.0, "frames": 24, "spacing": "log"}
    truth = _simulated(client, _PULSED, glass, way)[1]
    count = len(truth)
    # the ranges of an empty scene play no part
    trajectory = {
        "range_m": truth + [1.0] * _EMPTY,
        "time_s": [0.01 * i for i in range(count + _EMPTY)],
        "object_present": [True] * count + [False] * _EMPTY,
    }
    everything = _simulated(client, _PULSED, glass, trajectory)[0]
    frames = {
        name: column[:count] for name, column in everything.items() if name != "object_present"
    }
    unknown = [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 2.0}]
    ranges = {"prior": "reference", "low": 0.02, "high": 5.0}
    scene = {"crosstalk": unknown, "range_m": ranges}
    answers = (
        # as if there were none
        _estimates(client, _PULSED, {}, frames, truth, "conventional"),
        _estimates(client, _PULSED, scene, everything, truth, "joint_fit"),
        _posterior(client, _PULSED, scene, everything, truth),
    )
    return Episode("A cover glass: crosstalk of unknown size", "simulated", answers)


def derivatives(client: Client, _: Path) -> Episode:
    """Send a dark object before a background: derivatives leave two ranges, readings one."""
    sensor = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-9, 1e-8]}}
    background = {
        "strength": 0.00159154943092,
        "distance_m": 10.0,
        "shadow": {"c0": 0.059641, "c1": 0.013202},
    }
    shape = {"c0": 0.0817, "c1": 0.0574}
    truth_scene = {
        "object": shape | {"c2": 0.03},
        "background": background,
        "crosstalk": [2e-4, 5e-4],
    }
    trajectory = {"kind": "radial", "from_m": 1.0, "to_m": 3.2, "frames": 45}
    frames, truth = _simulated(client, sensor, truth_scene, trajectory)
    unknown = [{"prior": "normal", "mean": 0.0, "sd": 1e-3}] * 2
    known_object = {"object": shape | {"c2": 0.03}, "background": background, "crosstalk": unknown}
    technique = "background_cancelling_differential"
    answers = (
        _estimates(client, sensor, known_object, frames, truth, technique),
        _posterior(client, sensor, known_object, frames, truth),
    )
    return Episode("Crosstalk and a background", "simulated", answers)


def phases(client: Client, _: Path) -> Episode:
    """Send a sine wave before a far background: single frames that two ranges explain."""
    sensor = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [5e-6, 5e-6]}}
    known = {"object": {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}}
    behind = {"distance_m": 5.0, "shadow": {"c0": 0.0596, "c1": 0.0132}}
    truth_scene = known | {"background": behind | {"strength": 0.00636620}}
    trajectory = {"range_m": [1.0, 1.2, 1.3, 1.4, 1.5, 1.8, 2.0, 2.2, 2.5, 2.8, 3.1]}
    frames, truth = _simulated(client, sensor, truth_scene, trajectory)
    strength = {"prior": "lognormal", "median": 0.0075, "sigma": 0.3}
    scene = known | {"background": behind | {"strength": strength}}
    answers = (
        # as if there were none
        _estimates(client, sensor, {}, frames, truth, "conventional"),
        _estimates(client, sensor, scene, frames, truth, "background_cancelling"),
        _posteriors_of_each(client, sensor, scene, frames, truth),
    )
    return Episode("A sine wave, background of unknown strength", "simulated", answers)


EPISODES = (nearest, crosstalk, derivatives, phases)
