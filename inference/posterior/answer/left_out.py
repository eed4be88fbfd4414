"""Which terms are in no model of a scene, and why."""

from inference.frame.taken_for_crosstalk import TAKEN_FOR_CROSSTALK, taken_for_crosstalk
from inference.posterior.answer.posterior import LeftOutTerm
from inference.posterior.job import Job
from inference.posterior.selection.selection import Selection

__all__ = ["left_out"]


def left_out(job: Job, selection: Selection | None) -> tuple[LeftOutTerm, ...]:
    """Say which terms are in no model of a job, and why.

    Parameters
    ----------
    selection : Selection or None
        Of its optional terms.
    """
    scene = job.scene
    absent = {
        "crosstalk": scene.crosstalk,
        "background": scene.background,
    }
    none = dict.fromkeys(absent, "the scene states none")
    if taken_for_crosstalk(scene, job.frames):
        none["background"] += f"; {TAKEN_FOR_CROSSTALK}"
    rows = [LeftOutTerm(term, none[term]) for term, value in absent.items() if value is None]
    error = scene.model_error
    if error.flux == error.range_m == error.shadow == 0:
        rows.append(LeftOutTerm("discrepancy", "the scene states none"))
    if job.sensor.temperature is None and job.frames.temperature_k is not None:
        reason = "temperature_k is given and not used: the sensor states no coefficients"
        rows.append(LeftOutTerm("temperature", reason))
    if selection is not None:
        rows += [
            LeftOutTerm(decision.term, decision.reason)
            for decision in selection.decisions
            if not decision.kept
        ]
    return tuple(rows)
