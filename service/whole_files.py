"""Files that are written as a whole or not at all."""

import os
import tempfile
from pathlib import Path

__all__ = ["write_whole"]


def write_whole(path: Path, data: bytes, *, private: bool) -> None:
    """Write a file in place of what was there once all of it is there.

    Parameters
    ----------
    data : bytes
        What it is to hold.
    private : bool
        Whether its owner alone may read it; else whoever may read a new file.

    Raises
    ------
    OSError
        Where it cannot be written; what was there is then as it was.
    """
    # made with mode 0600
    descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=path.name)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
            if not private:
                os.fchmod(descriptor, 0o666 & ~_umask())
        Path(name).replace(path)
    finally:
        Path(name).unlink(missing_ok=True)  # on a full disk a part of it


def _umask() -> int:
    """Return the permissions that new files do not get; there is no way but to set it and back."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
