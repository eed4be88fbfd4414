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
    """Return the quality that the most specific range gives a media type.

    A range with a ``profile`` is of that profile alone. Other parameters, as ``charset``, are of no
    consequence for what is sent here.
    """
    wanted, profile, _ = _read(media_type)
    kind = wanted.split("/")[0]
    names = {wanted: 3, wanted.replace("/x-", "/"): 3, f"{kind}/*": 2, "*/*": 1}
    best = (0, 0.0)
    for part in accept.split(","):
        name, asked, quality = _read(part)
        if name in names and asked in (None, profile):
            best = max(best, (names[name] + (asked is not None), quality))
    return best[1]


def _read(media_range: str) -> tuple[str, str | None, float]:
    """Return the name, the profile (None without one) and the quality of a media range."""
    name, *parameters = (piece.strip().lower() for piece in media_range.split(";"))
    quality, profile = 1.0, None
    for parameter in parameters:
        word, _, value = parameter.partition("=")
        if word == "profile":
            profile = value.strip('"')
        elif word == "q":
            try:
                quality = min(max(float(value), 0.0), 1.0)
            except ValueError:
                quality = 0.0
    return name, profile, quality
