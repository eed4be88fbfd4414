"""The list of faults, and what holds of it as long as it lives."""

import dataclasses
import hashlib
import tomllib
from pathlib import Path

__all__ = ["KINDS", "LIST", "Fault", "planted", "read_faults", "wrong_with"]

LIST = Path(__file__).with_name("faults.toml")
KINDS = frozenset(
    {
        "dropped term",
        "off by one",
        "sign",
        "swapped axis",
        "threshold",
        "wrong branch",
        "wrong factor",
    }
)


@dataclasses.dataclass(frozen=True, slots=True)
class Fault:
    """A fault to plant.

    Attributes
    ----------
    name : str
        What is wrong, in a few words with hyphens.
    kind : str
        One of `KINDS`.
    file : str
        Where it is planted, from the root of the tree.
    old, new : str
        Text that stands there exactly once, and what stands in its place.
    tests : (str, ...)
        Files or tests that should notice, from the root of the tree.
    """

    name: str
    kind: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    @property
    def layer(self) -> str:
        """Package that the fault is planted in."""
        return self.file.partition("/")[0]

    @property
    def digest(self) -> str:
        """Digest of all that a result depends on, but for the sources around the fault."""
        return hashlib.sha256(repr(dataclasses.astuple(self)).encode()).hexdigest()[:16]


def read_faults(path: Path = LIST) -> tuple[Fault, ...]:
    """Read a list of faults.

    Raises
    ------
    ValueError
        Where two have one name, or an entry has other members than a fault.
    """
    entries = tomllib.loads(path.read_text(encoding="utf-8"))["fault"]
    try:
        faults = tuple(Fault(**entry | {"tests": tuple(entry["tests"])}) for entry in entries)
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path}: an entry is no fault: {error}") from None
    names = [fault.name for fault in faults]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"{path}: named twice: {', '.join(twice)}")
    return faults


def wrong_with(fault: Fault, root: Path) -> str | None:
    """Return why a fault cannot be planted in a tree, or be noticed there; None where it can."""
    file = root / fault.file
    if fault.kind not in KINDS:
        return f"{fault.name}: {fault.kind!r} is no kind of faults"
    if not file.is_file():
        return f"{fault.name}: there is no {fault.file}"
    if fault.old == fault.new:
        return f"{fault.name}: changes nothing"
    count = file.read_text(encoding="utf-8").count(fault.old)
    if count != 1:
        return (
            f"{fault.name}: its old text stands {count} times in {fault.file}, not once: "
            "put what stands there now into benchmarks/mutations/faults.toml"
        )
    missing = [test for test in fault.tests if not (root / test.partition("::")[0]).exists()]
    if missing or not fault.tests:
        return f"{fault.name}: there are no tests {', '.join(missing) or 'named'}"
    return None


def planted(fault: Fault, root: Path) -> str:
    """Return the source of a fault's file with the fault in it.

    Raises
    ------
    ValueError
        Where it cannot be planted.
    """
    if (reason := wrong_with(fault, root)) is not None:
        raise ValueError(reason)
    return (root / fault.file).read_text(encoding="utf-8").replace(fault.old, fault.new)
