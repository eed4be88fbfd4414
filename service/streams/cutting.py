"""Bytes as they arrive, cut into lines, however long somebody makes one."""

__all__ = ["LONGEST", "Cutter"]

LONGEST = 2**14
"""Bytes of a line; a frame has a hundred or two."""


class Cutter:
    """Cuts bytes into lines, and holds no more than one line of them."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> list[bytes | None]:
        """Return the lines that have come to their end, without the empty ones.

        Parameters
        ----------
        data : bytes
            What has arrived.

        Returns
        -------
        list of bytes or None
            None stands for a line longer than `LONGEST`, of which nothing is kept.
        """
        found: list[bytes | None] = []
        if b"\n" in data:
            first, _, data = data.partition(b"\n")
            found += self._ended(first)
            *lines, data = data.split(b"\n")
            if any(map(bytes.isspace, lines)) or not all(lines):
                lines = [line for line in lines if line.strip()]
            if max(map(len, lines), default=0) > LONGEST:
                found += [line if len(line) <= LONGEST else None for line in lines]
            else:
                found += lines
        if not self._skipping:
            self._rest += data
            if len(self._rest) > LONGEST:
                found.append(None)
                self._rest.clear()
                self._skipping = True
        return found

    def end(self) -> list[bytes | None]:
        """Return the line that ends where everything does."""
        return self._ended(b"")

    def _ended(self, last: bytes) -> list[bytes | None]:
        """Return the line that was begun before, with its last bytes."""
        skipped, self._skipping = self._skipping, False
        line = bytes(self._rest + last)
        self._rest.clear()
        if skipped or not line.strip():
            return []
        return [line if len(line) <= LONGEST else None]
