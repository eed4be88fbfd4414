"""Which form of draws a client accepts (RFC 9110, 12.5.1)."""

from collections.abc import Iterable

from service.exports import EXPORTS, export_by
from service.exports.export import Export

__all__ = ["accepted_export", "accepted_type"]


def accepted_export(accept: str) -> Export | None:
    """Choose a form by an ``Accept`` header (RFC 9110, 12.5.1).

    Parameters
    ----------
    accept : str
        The header; empty accepts anything.

    Returns
    -------
    Export or None
        The one of highest quality, the first of equals; None where none is accepted.
    """
    media_type = accepted_type(accept, (form.media_type for form in EXPORTS))
    return None if media_type is None else export_by(media_type)


def accepted_type(accept: str, media_types: Iterable[str]) -> str | None:
    """Choose a media type by an ``Accept`` header; see `accepted_export`."""
    best, found = 0.0, None
    for media_type in media_types:
        quality = _quality(accept or "*/*", media_type)
        if quality > best:
            best, found = quality, media_type
    return found


def _quality(accept: str, media_type: str) -> float:
    """Return the quality that the most specific range gives a media type."""
    kind = media_type.split("/")[0]
    names = {media_type: 3, media_type.replace("/x-", "/"): 3, f"{kind}/*": 2, "*/*": 1}
    best = (0, 0.0)
    for part in accept.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        quality = 1.0
        for parameter in parameters:
            if parameter.startswith("q="):
                try:
                    quality = min(max(float(parameter[2:]), 0.0), 1.0)
                except ValueError:
                    quality = 0.0
        best = max(best, (names.get(name, 0), quality if name in names else 0.0))
    return best[1]
