"""By which names the service may be called, and from whose pages.

A page of a stranger can let its own name point at this machine (DNS rebinding), and can send
requests from an operator's browser. The first shows in ``Host``, the second in ``Origin`` and
``Sec-Fetch-Site``, which pages cannot set.
"""

import dataclasses
import functools
import ipaddress
import re
from collections.abc import Iterable

from starlette.datastructures import Headers

from service.errors import ForeignError, MisdirectedError

__all__ = ["Authorities", "is_loopback"]

# a name, or an address in brackets; then perhaps a port (RFC 9110, 7.2)
_AUTHORITY = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9._-]+)(?::[0-9]{0,5})?")
_ORIGIN = re.compile(r"https?://(?P<authority>[^/?#@]+)")
_ANY = "*"


@functools.lru_cache(1000)
def is_loopback(name: str) -> bool:
    """Tell whether a name or an address is this machine's own, without asking anybody.

    Parameters
    ----------
    name : str
        Such as ``localhost``, ``127.0.0.1`` or ``[::1]``.
    """
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name.strip("[]")).is_loopback
    except ValueError:
        return False


def _name(authority: str) -> str | None:
    found = _AUTHORITY.fullmatch(authority.lower())
    return None if found is None else found["name"].rstrip(".")


@dataclasses.dataclass(frozen=True, slots=True)
class Authorities:
    """Names that the service answers to, besides those of loopback.

    Attributes
    ----------
    names : frozenset of str
        Lower case, without a port; ``*`` for any.
    """

    names: frozenset[str]

    @classmethod
    def of(cls, names: Iterable[str]) -> "Authorities":
        """Return them from what an operator wrote, where an IPv6 address may lack its brackets."""
        plain = (name.strip().lower() for name in names)
        return cls(frozenset(f"[{n}]" if n.count(":") > 1 and n[0] != "[" else n for n in plain))

    def check(self, headers: Headers) -> None:
        """Refuse a request to another name, or from a page of another.

        Raises
        ------
        MisdirectedError
            Where ``Host`` is not one of the names.
        ForeignError
            Where a page of another origin asks.
        """
        host = headers.get("host", "")
        name = _name(host)
        known = name is not None and (name in self.names or is_loopback(name))
        if not known and _ANY not in self.names:
            raise MisdirectedError(
                "the request is for a host that this service does not answer to: its names are "
                "those of loopback and HYBRIDTOF_ALLOWED_HOSTS"
            )
        if headers.get("sec-fetch-site") == "cross-site":
            raise ForeignError("a page of another site asks")
        for origin in headers.getlist("origin"):
            found = _ORIGIN.fullmatch(origin.lower())
            if found is None or found["authority"] != host.lower():
                raise ForeignError("a page of another origin asks")
