"""The template of a form in which draws are handed out."""

import dataclasses
from collections.abc import Callable

from service.exports.described import DescribedDraws

__all__ = ["Export"]


@dataclasses.dataclass(frozen=True)
class Export:
    """One form of draws.

    Attributes
    ----------
    media_type : str
        As in ``Accept`` and ``Content-Type``.
    suffix : str
        Of file names.
    write : callable
        DescribedDraws -> bytes; it imports by itself what nothing else here needs, so that a
        service that never exports starts without it.
    """

    media_type: str
    suffix: str
    write: Callable[[DescribedDraws], bytes]
