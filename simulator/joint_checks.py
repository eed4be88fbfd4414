"""Whether a joint law names unknowns of its scene, and comes from its sensor."""

from simulator.errors import Problem
from simulator.joint import Calibration
from simulator.priors import Prior
from simulator.scene import Quantity, Scene
from simulator.sensor import Sensor

__all__ = ["check_calibration", "check_joint", "priors_of"]

# what may be stated better after a calibration, and changes no unknown
_OF_NOISE = {"noise", "full_scale"}
_WORDS = {
    "not_converged": "the posterior behind this calibration has not converged",
    "misfit": "the model of this calibration does not fit its readings",
}


def priors_of(sensor: Sensor, scene: Scene) -> dict[str, Prior | None]:
    """Return the prior of all that is unknown by its scene path, the law of the ranges apart.

    Returns
    -------
    dict
        None stands for a default.
    """
    quantities: dict[str, Quantity | None] = {
        f"object.{name}": getattr(scene.object, name) for name in ("c0", "c1", "c2")
    }
    if scene.crosstalk_values is not None:
        for column, value in zip(sensor.columns, scene.crosstalk_values, strict=True):
            quantities[f"crosstalk.{column}"] = value
    if scene.background is not None:
        quantities["background.strength"] = scene.background.strength
        quantities["background.distance_m"] = scene.background.distance_m
        if not scene.shadow_is_object and scene.shadow is not None:
            quantities["background.shadow.c0"], quantities["background.shadow.c1"] = scene.shadow
    quantities |= sensor.quantities
    return {path: value for path, value in quantities.items() if not isinstance(value, float | int)}


def check_joint(sensor: Sensor, scene: Scene) -> list[Problem]:
    """Check that all that a scene's joint law names is unknown, and certain to be there."""
    if scene.joint is None:
        return []
    problems, unknown = [], priors_of(sensor, scene)
    for i, name in enumerate(scene.joint.unknowns):
        if name not in unknown:
            of = ", ".join(unknown) or "none"
            message = f"{name!r} is no unknown of this scene, whose unknowns are: {of}"
            problems.append(Problem(f"/joint/unknowns/{i}", message))
        elif name.partition(".")[0] in scene.optional_terms:
            message = "belongs to an optional term, of which a joint law cannot speak"
            problems.append(Problem(f"/joint/unknowns/{i}", message))
    return problems


def check_calibration(sensor: Sensor, scene: Scene) -> list[Problem]:
    """Check that a scene was calibrated with this sensor, and that its verdicts are accepted."""
    of = scene.calibration
    if of is None:
        return []
    problems = []
    here, there = sensor.model_dump(exclude=_OF_NOISE), of.sensor.model_dump(exclude=_OF_NOISE)
    other = [name for name in here if here[name] != there.get(name)]
    if other:
        said = ", ".join(f"{name} {there.get(name)!r} instead of {here[name]!r}" for name in other)
        message = (
            f"the scene was calibrated with another sensor: {said}; calibrate it with this one"
        )
        problems.append(Problem("/calibration/sensor", message))
    failed = {"not_converged": not of.converged, "misfit": of.misfit}
    for word, bad in failed.items():
        if bad and word not in of.accept:
            message = f"{_WORDS[word]}: calibrate anew, or add {word!r} here to take it"
            problems.append(Problem("/calibration/accept", message))
    return problems + _check_priors(sensor, scene, of)


def _check_priors(sensor: Sensor, scene: Scene, of: Calibration) -> list[Problem]:
    """Check that the law's coordinates are what they were: in others it has other values."""
    problems, stated = [], priors_of(sensor, scene)
    named = () if scene.joint is None else scene.joint.unknowns
    for i, row in enumerate(of.unknowns):
        if row.unknown not in named or row.unknown not in stated or row.prior is None:
            continue
        here = stated[row.unknown] or "default"
        if here != row.prior:
            message = (
                f"the joint law of {row.unknown} is in coordinates of the prior of its "
                f"calibration, {_words(row.prior)}, and the scene has {_words(here)}: put that "
                "back, or calibrate anew"
            )
            problems.append(Problem(f"/calibration/unknowns/{i}/prior", message))
    return problems


def _words(prior: Prior | str) -> str:
    return f"the {prior}" if isinstance(prior, str) else prior.model_dump_json()
