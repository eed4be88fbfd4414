"""What routes of things that are kept have in common: JSON, pages, events that were seen."""

import re
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import Header, Query
from fastapi.responses import Response

from service.errors import MalformedError
from service.json_text import encode

__all__ = ["Cursor", "LastEventId", "answered", "event_of", "place_of"]

# by which OpenAPI says what is refused here, with words of its own
_CURSOR = "^[0-9]{1,18}$"

Cursor = Annotated[str | None, Query(json_schema_extra={"pattern": _CURSOR})]
LastEventId = Annotated[str | None, Header(description="of the last event seen")]


def answered(body: Any, status: int = 200, headers: Mapping[str, str] | None = None) -> Response:
    """Return an answer in JSON."""
    return Response(encode(body), status, headers, "application/json")


def place_of(cursor: str | None) -> int | None:
    """Return behind which entry a page begins; None for the first.

    Raises
    ------
    MalformedError
        Where the cursor is none.
    """
    if cursor is None:
        return None
    if not re.fullmatch(_CURSOR, cursor):
        raise MalformedError("the cursor is not one that this service gave")
    return int(cursor)


def event_of(last_event_id: str | None) -> int:
    """Return the number of the last event that was seen; 0 where none was."""
    known = last_event_id or ""
    return int(known) if re.fullmatch(r"[0-9]{1,9}", known) else 0
