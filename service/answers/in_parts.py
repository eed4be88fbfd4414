"""The answer of estimates in parts: what there is of it is whole at any time.

Each part has the results that are new, and what stands around all that there are by then; a result
is encoded, and sent from process to process, once.
"""

from collections.abc import Generator, Sequence
from typing import NamedTuple

from inference.estimates import Estimates
from service.answers.encoding import AnswerShape, encode_around, encode_result

__all__ = ["AnswerPart", "encode_in_parts", "joined"]


class AnswerPart(NamedTuple):
    """What an answer is by now, beside the parts before.

    Attributes
    ----------
    results : dict
        JSON text of each technique that is new.
    names : tuple of str
        Techniques that have a result by now, in order.
    before, after : bytes
        JSON text around them.
    """

    results: dict[str, bytes]
    names: tuple[str, ...]
    before: bytes
    after: bytes


def encode_in_parts(
    turns: Generator[Estimates, None, Estimates], shape: AnswerShape
) -> Generator[AnswerPart, None, AnswerPart]:
    """Encode what is answered, technique by technique.

    Parameters
    ----------
    turns : generator
        Of `inference.in_turn.estimates_in_turn`.
    shape : str
        Of `service.answers.encoding.encode_estimates`.

    Yields
    ------
    AnswerPart
        For each of the estimates.

    Returns
    -------
    AnswerPart
        The last.
    """
    told: set[str] = set()
    while True:
        try:
            so_far = next(turns)
        except StopIteration as end:
            return _part(end.value, told, shape)
        part = _part(so_far, told, shape)
        told.update(part.results)
        yield part


def _part(estimates: Estimates, told: set[str], shape: AnswerShape) -> AnswerPart:
    results = {
        result.technique: b"".join(encode_result(result, shape))
        for result in estimates.results
        if result.technique not in told
    }
    names = tuple(result.technique for result in estimates.results)
    return AnswerPart(results, names, *encode_around(estimates))


def joined(parts: Sequence[AnswerPart]) -> bytes:
    """Return the body of ``POST /v1/estimates`` as the last of some parts leaves it.

    Parameters
    ----------
    parts : sequence of AnswerPart
        From the first on, at least one.

    Returns
    -------
    bytes
        As of `service.answers.encoding.encode_estimates`.
    """
    texts: dict[str, bytes] = {}
    for part in parts:
        texts |= part.results
    last = parts[-1]
    return b"".join((last.before, b",".join(texts[name] for name in last.names), last.after))
