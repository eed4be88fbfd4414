"""scipy, imported when something of it is first used: few frames need nothing of it."""

from typing import TYPE_CHECKING, Any

__all__ = ["scipy"]


class _Later:
    """Stands for a package until something of it is asked for."""

    def __getattr__(self, name: str) -> Any:
        import scipy

        found = getattr(scipy, name)
        setattr(self, name, found)
        return found


if TYPE_CHECKING:
    import scipy
else:
    scipy = _Later()
