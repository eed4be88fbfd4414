"""API keys: 256 random bits each, of which a file keeps the SHA-256 alone.

A digest without salt or stretching is enough for what nobody can guess; it is compared in constant
time with every key that there is, so that time tells nothing.
"""

import base64
import binascii
import dataclasses
import hashlib
import hmac
import json
import logging
import os
import secrets
import stat
from datetime import UTC, datetime
from pathlib import Path

from service.errors import UnauthorizedError
from service.service_settings import PREFIX
from service.whole_files import write_whole
from simulator.errors import InvalidInputError

__all__ = ["POINTER", "Key", "KeyRing", "new_key", "read_keys", "write_keys"]

POINTER = f"/{PREFIX}API_KEYS"
_BITS = 256
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_log = logging.getLogger("hybridtof")


@dataclasses.dataclass(frozen=True, slots=True)
class Key:
    """What is kept of a key.

    Attributes
    ----------
    id : str
        Names the owner of jobs; another key of the same name is another owner.
    name : str
        For people.
    sha256 : str
        Digest of the key, in hexadecimal digits.
    created : str
        When, in UTC.
    """

    id: str
    name: str
    sha256: str
    created: str


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()


def new_key(name: str) -> tuple[Key, str]:
    """Make a key.

    Parameters
    ----------
    name : str
        For people.

    Returns
    -------
    tuple
        What is kept, and the key itself, which is not.
    """
    secret = "ht_" + secrets.token_urlsafe(_BITS // 8)
    created = datetime.now(UTC).isoformat(timespec="seconds")
    return Key(secrets.token_hex(8), name, _digest(secret), created), secret


def read_keys(path: Path) -> tuple[Key, ...]:
    """Read a file of keys that nobody else may read.

    Parameters
    ----------
    path : Path
        As `write_keys` left it.

    Raises
    ------
    InvalidInputError
        Where it cannot be read, is no file of keys, or can be read by others.
    """
    try:
        with path.open("rb") as file:
            mode, content = os.fstat(file.fileno()).st_mode, file.read()
    except OSError as error:
        raise InvalidInputError.at(POINTER, f"{path}: {error.strerror}") from None
    if mode & _OTHERS:
        raise InvalidInputError.at(POINTER, f"others can read or write {path}: chmod 600 {path}")
    try:
        return tuple(Key(**entry) for entry in json.loads(content)["keys"])
    except (ValueError, TypeError, KeyError):
        raise InvalidInputError.at(POINTER, f"{path} is no file of keys") from None


def write_keys(path: Path, keys: tuple[Key, ...]) -> None:
    """Write a file of keys, readable by its owner alone, as a whole or not at all.

    Raises
    ------
    InvalidInputError
        Where it cannot be written.
    """
    text = json.dumps({"keys": [dataclasses.asdict(key) for key in keys]}, indent=1) + "\n"
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_whole(path, text.encode(), private=True)
    except OSError as error:
        raise InvalidInputError.at(POINTER, f"{path} cannot be written: {error.strerror}") from None


def _secret(authorization: str) -> str | None:
    """Return the key of an ``Authorization`` header; as a password too, which URLs can carry."""
    scheme, _, rest = authorization.strip().partition(" ")
    rest = rest.strip()
    if scheme.lower() == "bearer":
        return rest
    if scheme.lower() == "basic":
        try:
            return base64.b64decode(rest, validate=True).decode().partition(":")[2]
        except (binascii.Error, UnicodeDecodeError):
            return None
    return None


class KeyRing:
    """The keys of a file, read again when it has changed: who is revoked is out at once.

    Raises
    ------
    InvalidInputError
        Where it has no keys, or is refused by `read_keys`.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen = self._state()
        self._keys = read_keys(path)
        if not self._keys:
            raise InvalidInputError.at(
                POINTER, f"{path} has no keys: make one with hybridtof keys create NAME"
            )

    def _state(self) -> tuple[int, ...] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino, found.st_mode

    def owner(self, authorization: str | None) -> str:
        """Return the id of the key that a request has.

        Parameters
        ----------
        authorization : str or None
            The header.

        Raises
        ------
        UnauthorizedError
            Where there is none, or none that is known.
        """
        state = self._state()
        if state != self._seen:
            self._seen = state
            try:
                self._keys = read_keys(self._path)
            except InvalidInputError as error:
                self._keys = ()
                _log.error("nobody is let in: %s", error)
        if authorization is None:
            raise UnauthorizedError("a key is needed: Authorization: Bearer KEY")
        digest = _digest(_secret(authorization) or "")
        # to the end, whichever fits
        found = [key.id for key in self._keys if hmac.compare_digest(key.sha256, digest)]
        if not found:
            raise UnauthorizedError("the key is not known, or was revoked")
        return found[0]
