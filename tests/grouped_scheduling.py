"""How tests are handed to processes: group by group, in the order in which they are collected."""

from xdist.scheduler import LoadScopeScheduling

from tests.groups import group_of

__all__ = ["GroupedScheduling"]


class GroupedScheduling(LoadScopeScheduling):  # type: ignore[misc]
    """Hands out whole groups.

    The marks of `--dist loadgroup` have no effect under pytest 9.2: the id of a test no longer
    takes what pytest-xdist 3.8 appends to it, and tests are handed out one by one.
    """

    def _split_scope(self, nodeid: str) -> str:
        return group_of(nodeid)
