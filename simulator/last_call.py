"""What was found last: whoever asks for the prior of a vector asks for its terms next."""

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["LastCall"]

Found = TypeVar("Found")

_LARGEST = 1 << 16  # bytes: of more, comparing and keeping would cost what is saved


class LastCall(Generic[Found]):
    """The argument and the value of a pure function's last call.

    Not part of what is copied or stored; of threads that share it each gets what is right.
    """

    def __init__(self) -> None:
        self._last: tuple[tuple[int, ...], bytes, Found] | None = None

    def __reduce__(self) -> tuple[type["LastCall[Found]"], tuple[()]]:
        return type(self), ()

    def of(self, function: Callable[[NDArray[np.float64]], Found], x: NDArray[np.float64]) -> Found:
        """Return the function's value, which is found anew unless it was just asked for.

        Parameters
        ----------
        function : callable
            Always the same, of the array alone; nobody writes to what it returns.
        x : ndarray
            Its argument.
        """
        if x.nbytes > _LARGEST:
            return function(x)
        key, last = x.tobytes(), self._last  # one look: another thread may put its own there
        if last is not None and last[0] == x.shape and last[1] == key:
            return last[2]
        found = function(x)
        self._last = x.shape, key, found
        return found
