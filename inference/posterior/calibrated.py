"""A posterior as a scene: what frames have told, for all frames to come."""

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.answer.draws import Draws
from inference.posterior.answer.posterior import Posterior
from inference.posterior.learnt_error import learnt_error
from inference.posterior.selection.models import reduced
from simulator.errors import Problem, RefusedError
from simulator.frames import Frames
from simulator.joint import Joint
from simulator.joint_checks import priors_of
from simulator.parameters import Parameters, parameters_of
from simulator.priors import Prior
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor

__all__ = ["calibrated_scene", "refuse_known_object", "scene_of_draws"]

Array = NDArray[np.float64]

_LEAST_SHARE = 0.01  # of the draws, of a mode that counts
_LEAST_DRAWS = 5  # an unknown, of a mode that counts
_FARTHEST = 9.0  # standard deviations of a prior: beyond, a draw at its end has no coordinate
_RIDGE = 1e-9  # of a variance: what keeps a law of two unknowns that are one a law


def calibrated_scene(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    posterior: Posterior,
    date: str | None = None,
    other_objects: bool = False,
) -> Scene:
    """Make a scene of what a posterior knows, to be used wherever a scene is.

    Parameters
    ----------
    sensor, scene, frames : Sensor, Scene, Frames
        What `infer` was given.
    posterior : Posterior
        Its answer.
    date : str, optional
        To be written into the calibration.
    other_objects : bool
        Whether the frames to come are of other objects: nothing is kept of the object then, nor of
        its shadow, and what is known of crosstalk, background and sensor stays.

    Returns
    -------
    Scene
        With the priors as they were, the terms that the posterior kept, and ``joint`` and
        ``calibration``. Where the posterior has not converged or is a misfit it is refused
        wherever it is used, until ``calibration.accept`` says otherwise.

    Raises
    ------
    RefusedError
        Where nothing was drawn, or the object is stated in numbers and others are to come.
    """
    kept = () if posterior.selection is None else posterior.selection.decisions
    findings = {
        "converged": posterior.verdict.converged,
        "misfit": posterior.fit.misfit,
        "reasons": posterior.verdict.reasons,
        "left_out": [dataclasses.asdict(row) for row in posterior.left_out],
        "seed": posterior.seed,
        "date": date,
    }
    if not posterior.drawn:
        raise RefusedError("nothing was drawn: there is nothing that this posterior knows")
    stays = [decision.term for decision in kept if decision.kept]
    whole = reduced(scene, stays)
    return scene_of_draws(sensor, whole, frames, posterior.draws, findings, other_objects)


def refuse_known_object(names: Iterable[str]) -> None:
    """Refuse to make a scene for other objects of one whose object is known.

    Parameters
    ----------
    names : iterable of str
        What is unknown of it.

    Raises
    ------
    RefusedError
        Where that is nothing of the object.
    """
    if not any(name.startswith("object.") for name in names):
        raise RefusedError(
            "object is stated in numbers, which other objects do not have: state priors of it, of "
            "a known plate narrow ones, or leave it out, and calibrate again",
            Problem("/scene/object", "is stated in numbers"),
        )


def scene_of_draws(
    sensor: Sensor,
    scene: Scene,
    frames: Frames,
    draws: Draws,
    findings: Mapping[str, Any],
    other_objects: bool = False,
) -> Scene:
    """Make a scene of draws.

    Parameters
    ----------
    sensor, scene, frames : Sensor, Scene, Frames
        As sampled: the terms that were kept.
    draws : Draws
        Of their posterior, moved by the errors of the model.
    findings : mapping
        Members of `simulator.joint.Calibration` that are not in the draws.
    other_objects : bool
        As for `calibrated_scene`.

    Raises
    ------
    RefusedError
        As there.
    """
    if other_objects:
        refuse_known_object(draws.names)
    prior = scene.model_copy(update={"joint": None, "calibration": None})
    parameters = parameters_of(sensor, prior)
    kept = [j for j, name in enumerate(parameters.names) if not name.startswith("range_m.")]
    names = [draws.names[j] for j in kept]
    # behind the scene's unknowns is the offset of these frames' displacements, which says nothing
    # of others
    natural = draws.parameters.reshape(-1, len(draws.names))[:, : len(parameters)]
    error = scene.model_error
    document = prior.model_dump(mode="json", exclude_none=True)
    calibration = {
        "sensor": sensor.model_dump(mode="json", exclude_none=True),
        "frames": {"count": len(frames), "sha256": _digest(frames)},
        "model_error": [error.flux, error.range_m],
        **{key: value for key, value in findings.items() if value is not None},
    }
    if names:
        z = _coordinates(parameters, natural)[:, kept]
        modes = _modes(z, draws.mode.reshape(-1))
        law = Joint.model_validate({"unknowns": names, "modes": modes})
        told = [name for name in names if not (other_objects and _of_object(name))]
        if told:
            rest = law.marginal(told)
            stay = [names.index(name) for name in told]
            document["joint"] = rest.model_dump(mode="json")
            priors = [priors_of(sensor, prior)[name] for name in told]
            of_draws = natural[:, [kept[j] for j in stay]]
            calibration["unknowns"] = list(_learnt(told, priors, of_draws))
            calibration["distance"] = _distance(rest, z[:, stay])
        heaviest = max(law.modes, key=lambda mode: mode.weight)
        centre = np.zeros((1, len(parameters)))
        centre[0, kept] = heaviest.mean
        learnt = learnt_error(sensor, parameters.terms(centre), frames, len(names))
        if learnt is not None:
            calibration["learnt_error"] = learnt.model_dump(mode="json")
            if learnt.flux > error.flux or learnt.range_m > error.range_m:
                document["discrepancy"] = {
                    "flux": max(learnt.flux, error.flux),
                    "range_m": max(learnt.range_m, error.range_m),
                }
                if scene.background is not None:
                    document["discrepancy"]["shadow"] = error.shadow
    document["calibration"] = calibration
    return parse_scene(document)


def _of_object(name: str) -> bool:
    """Tell whether an unknown is of the object that was there: the shadow is its own, too."""
    return name.startswith(("object.", "background.shadow."))


def _digest(frames: Frames) -> str:
    """Return the digest of all columns, whatever there are."""
    digest = hashlib.sha256()
    for field in dataclasses.fields(frames):
        column = getattr(frames, field.name)
        if column is not None:
            digest.update(f"{field.name}:{column.dtype.str}:{column.shape}".encode())
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def _coordinates(parameters: Parameters, natural: Array) -> Array:
    """Return z under the independent priors; a draw at the end of a support is held near it."""
    with np.errstate(all="ignore"):
        z = parameters.standard(natural)
    return np.clip(
        np.nan_to_num(z, nan=0.0, posinf=_FARTHEST, neginf=-_FARTHEST), -_FARTHEST, _FARTHEST
    )


def _modes(z: Array, mode: NDArray[np.intp]) -> list[dict[str, Any]]:
    """Return a normal law for each mode that draws enough lie in."""
    least = max(_LEAST_SHARE * len(z), _LEAST_DRAWS * z.shape[1])
    found = [part for k in np.unique(mode) if len(part := z[mode == k]) >= least] or [z]
    total = sum(len(part) for part in found)
    laws = []
    for part in found:
        off = part - part.mean(axis=0)
        covariance = off.T @ off / len(part)
        covariance += np.diag(_RIDGE * np.maximum(np.diagonal(covariance), _RIDGE))
        laws.append(
            {
                "weight": len(part) / total,
                "mean": _numbers(part.mean(axis=0)),
                "covariance": [_numbers(row) for row in covariance],
            }
        )
    return laws


def _numbers(values: Array) -> list[float]:
    """Return plain numbers; what is next to nothing is zero."""
    return [0.0 if abs(value) < 1e-40 else value for value in values.tolist()]


def _learnt(
    names: list[str], priors: list[Prior | None], natural: Array
) -> Iterable[dict[str, Any]]:
    """Describe each unknown for a reader."""
    for name, prior, column in zip(names, priors, natural.T, strict=True):
        low, high = np.quantile(column, [0.05, 0.95])
        values = _numbers(np.array([column.mean(), column.std(), low, high]))
        stated = "default" if prior is None else prior.model_dump(mode="json")
        of_draws = dict(zip(("mean", "sd", "q05", "q95"), values, strict=True))
        yield {"unknown": name, "prior": stated, **of_draws}


def _distance(law: Joint, z: Array) -> float:
    """Return the greatest of Kolmogorov's distances between unknowns' draws and their law."""
    n, greatest = len(z), 0.0
    for j, column in enumerate(np.sort(z, axis=0).T):
        share = np.zeros(n)
        for mode in law.modes:
            sd = mode.covariance[j][j] ** 0.5
            share += mode.weight * scipy.special.ndtr((column - mode.mean[j]) / sd)
        steps = np.arange(n + 1) / n
        greatest = max(greatest, *np.abs(share - steps[1:]), *np.abs(share - steps[:-1]))
    return float(greatest)
