"""The exceptions of the project.

::

    HybridTofError
    ├── InvalidInputError   (also ValueError)  input that breaks a rule; names every offending field
    └── RefusedError        valid input for which there is no answer, with the reason and the remedy
"""

from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["HybridTofError", "InvalidInputError", "Problem", "RefusedError", "escape", "listed"]


@dataclass(frozen=True, slots=True)
class Problem:
    """One broken rule.

    Attributes
    ----------
    pointer : str
        JSON pointer (RFC 6901) of the offending field; "" is the whole document.
    message : str
        What is wrong, for a person.
    """

    pointer: str
    message: str


def escape(name: str) -> str:
    """Escape a member's name for a JSON pointer (RFC 6901)."""
    return name.replace("~", "~0").replace("/", "~1")


def listed(names: Sequence[str]) -> str:
    """Return "a", "a and b" or "a, b and c"."""
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


class HybridTofError(Exception):
    """Base of every exception that the project raises on purpose."""


class InvalidInputError(HybridTofError, ValueError):
    """Input that breaks a rule.

    Parameters
    ----------
    *problems : Problem
        At least one; all that were found.
    """

    def __init__(self, *problems: Problem) -> None:
        self.problems = problems
        super().__init__("; ".join(f"{p.pointer or '/'}: {p.message}" for p in problems))

    def __reduce__(self) -> tuple[type["InvalidInputError"], tuple[Problem, ...]]:
        return type(self), self.problems  # so that it survives the way between processes

    @classmethod
    def at(cls, pointer: str, message: str) -> "InvalidInputError":
        """Build the error of a single field."""
        return cls(Problem(pointer, message))

    def below(self, prefix: str) -> "InvalidInputError":
        """Return the same error with every pointer below ``prefix``."""
        return InvalidInputError(*(Problem(prefix + p.pointer, p.message) for p in self.problems))


class RefusedError(HybridTofError):
    """Valid input for which an honest answer does not exist.

    Parameters
    ----------
    message : str
        The reason, and the remedy.
    *problems : Problem
        The fields that are the reason, where it is single ones.
    """

    def __init__(self, message: str = "", *problems: Problem) -> None:
        self.problems = problems
        super().__init__(message)

    def __reduce__(self) -> tuple[type["RefusedError"], tuple[str | Problem, ...]]:
        return type(self), (str(self), *self.problems)
