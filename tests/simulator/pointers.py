"""JSON pointers (RFC 6901) held against the document that they speak of."""

from typing import Any

__all__ = ["leads_somewhere"]


def leads_somewhere(pointer: str, document: Any) -> bool:
    """Whether a pointer leads to a value, or names a member that an existing container lacks."""
    if pointer == "":
        return True
    if not pointer.startswith("/"):
        return False
    *way, last = (part.replace("~1", "/").replace("~0", "~") for part in pointer[1:].split("/"))
    here = document
    for part in way:
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif isinstance(here, list) and part.isdigit() and int(part) < len(here):
            here = here[int(part)]
        else:
            return False
    # a list lacks its next entries, an object any member
    return isinstance(here, dict) or (isinstance(here, list) and last.isdigit())
