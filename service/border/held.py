"""How many bytes of bodies and answers the service holds, over all requests."""

from service.errors import BusyError

__all__ = ["Held", "Room"]

# a body of no more than so small a share of the room is always taken: connections have an end, too
_SHARES = 512


class Room:
    """Bytes that may be held at a time.

    Parameters
    ----------
    limit : int
        How many.
    """

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self.used = 0


class Held:
    """What one request holds of the room, until its answer was sent.

    Parameters
    ----------
    room : Room
        Shared by all requests.
    """

    def __init__(self, room: Room) -> None:
        self._room = room
        self._bytes = 0

    def take(self, count: int) -> None:
        """Hold some bytes of a body.

        Raises
        ------
        BusyError
            Where there is no room, and it is not small.
        """
        small = self._bytes + count <= self._room.limit // _SHARES
        if not small and self._room.used + count > self._room.limit:
            raise BusyError("too many bytes of other requests are held: send it again later")
        self.answer(count)

    def answer(self, count: int) -> None:
        """Hold some bytes of an answer, which are there already."""
        self._bytes += count
        self._room.used += count

    def sent(self, count: int) -> None:
        """Hold some bytes of an answer no more: the client takes them, and more are to come."""
        self._bytes -= count
        self._room.used -= count

    def release(self) -> None:
        """Hold nothing any more."""
        self._room.used -= self._bytes
        self._bytes = 0
