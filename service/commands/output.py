"""Results on standard output."""

import sys

__all__ = ["write_result"]


def write_result(document: bytes) -> None:
    """Write one JSON document and a line end, whole.

    Parameters
    ----------
    document : bytes
        JSON text.

    Raises
    ------
    BrokenPipeError
        Where the reader went away.

    Notes
    -----
    Unbuffered (``PYTHONUNBUFFERED``), ``sys.stdout.write`` makes one system call and drops what
    the pipe did not take; nothing says so.
    """
    rest = memoryview(document + b"\n")
    sys.stdout.flush()
    while rest:
        rest = rest[sys.stdout.buffer.write(rest) :]
    sys.stdout.buffer.flush()
