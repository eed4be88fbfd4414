"""One line of the report."""

import dataclasses
from typing import Any

from service.report.scores import Scores

__all__ = ["Costs", "Row", "order_of", "row_from"]


# a posterior is lined up by its frames, and with as many by its draws
_DRAWS_BELOW = 10_000


def order_of(frames: int, draws: int) -> float:
    """Return by what a posterior of so many frames and effective draws is lined up."""
    return float(frames * _DRAWS_BELOW + draws)


@dataclasses.dataclass(frozen=True)
class Costs:
    """What a method costs; None where it was not measured or has no meaning.

    Attributes
    ----------
    frame_s : float or None
        Processor time a frame, all frames in one call [s].
    p50_s, p99_s : float or None
        Quantiles of the time of a frame that comes alone; of what needs many frames, of the time a
        frame over the data sets [s].
    run_s : float or None
        Processor time of the call [s].
    peak_bytes : int or None
        Most memory held at once, beyond what was held before.
    draws_per_s : float or None
        Effective draws of the worst parameter a second of processor time, after a passed verdict.
    """

    frame_s: float | None = None
    p50_s: float | None = None
    p99_s: float | None = None
    run_s: float | None = None
    peak_bytes: int | None = None
    draws_per_s: float | None = None


@dataclasses.dataclass(frozen=True)
class Row:
    """One method on one scene with one value of its knob.

    Attributes
    ----------
    scene, method : str
        Which, on what, in plain words.
    family : str
        "single frames", "many frames", "tracker", "posterior".
    told : str
        What it was told that is not so; empty where all is so.
    knob : str
        What distinguishes it from its neighbours, such as "40 frames".
    order : float
        By which rows of one method are lined up.
    frames : int
        Frames with an object.
    scores : Scores or None
        None where it was left out.
    costs : Costs
        What it took.
    likelihood_calls : int or None
        Evaluations of the likelihood of all frames.
    effective_draws : float or None
        Of the worst parameter.
    remark : str
        The verdict, or why it was left out.
    """

    scene: str
    method: str
    family: str
    told: str = ""
    knob: str = ""
    order: float = 0.0
    frames: int = 0
    scores: Scores | None = None
    costs: Costs = Costs()
    likelihood_calls: int | None = None
    effective_draws: float | None = None
    remark: str = ""

    @property
    def frames_a_set(self) -> int:
        """Frames of one set, of a posterior; else 0."""
        return int(self.order) // _DRAWS_BELOW if self.family == "posterior" else 0

    @property
    def draws(self) -> int:
        """Effective draws wanted of a posterior; else 0."""
        return int(self.order) % _DRAWS_BELOW if self.family == "posterior" else 0

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data."""
        found = dataclasses.asdict(self)
        found["scores"] = None if self.scores is None else self.scores._asdict()
        return found


def row_from(data: dict[str, Any]) -> Row:
    """Return a row from what `Row.to_json` made of it."""
    scores = data["scores"]
    return Row(
        **data
        | {
            "scores": None if scores is None else Scores(**scores),
            "costs": Costs(**data["costs"]),
        }
    )
