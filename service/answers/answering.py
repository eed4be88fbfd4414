"""Estimates as JSON: what a process makes of a request, technique by technique.

Nothing of the web is imported here: where a process was ended the next one is soon there.
"""

from collections.abc import Generator

from inference.in_turn import estimates_in_turn
from inference.plan import plan
from service.answers.encoding import AnswerShape
from service.answers.in_parts import AnswerPart, encode_in_parts
from service.checked_system import checked_frames
from service.requests import EstimateRequest

__all__ = ["answer_parts"]


def answer_parts(
    request: EstimateRequest, shape: AnswerShape, overdue: str
) -> Generator[AnswerPart, None, AnswerPart]:
    """Estimate and encode, technique by technique.

    Parameters
    ----------
    request : EstimateRequest
        Sensor, scene, frames and techniques.
    shape : str
        Of `service.answers.encoding.encode_estimates`.
    overdue : str
        Why a technique is left out that has not answered when there is no more time.

    Yields
    ------
    AnswerPart
        See `service.answers.in_parts`.

    Returns
    -------
    AnswerPart
        The last.

    Raises
    ------
    InvalidInputError
        With pointers into the request.
    """
    sensor, scene, frames = checked_frames(request.sensor, request.scene, request.frames)
    choice = plan(sensor, scene, frames)
    turns = estimates_in_turn(sensor, scene, frames, choice, request.techniques, overdue)
    return (yield from encode_in_parts(turns, shape))
