"""Draws as files: one file a form, each with its `Export`; a new one is a file and a line here."""

from service.exports import ndjson, netcdf
from service.exports.export import Export

__all__ = ["EXPORTS", "export_by"]

EXPORTS: tuple[Export, ...] = (
    netcdf.EXPORT,
    ndjson.EXPORT,
)
"""The first is sent to whoever accepts anything."""


def export_by(media_type: str) -> Export:
    """Return the form of a media type.

    Raises
    ------
    KeyError
        Where there is none.
    """
    return {export.media_type: export for export in EXPORTS}[media_type]
