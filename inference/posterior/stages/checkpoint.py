"""Where a job stands, for a store."""

import dataclasses
from typing import Any

from numpy.typing import NDArray

from inference.density.representatives import Representatives
from inference.posterior.archive import (
    pack,
    pack_addition,
    pack_parts,
    unpack,
    unpack_parts,
)
from inference.posterior.selection.selection import Selection
from inference.posterior.stages.stage import Drawing, Settled, Stage, Weighted
from inference.posterior.stages.standing import stands

__all__ = ["Checkpoint"]


@dataclasses.dataclass(frozen=True, eq=False)
class Checkpoint:
    """Where a job stands.

    Attributes
    ----------
    stage : Stage
        What is being done, and what it has come to.
    calls : int
        Density evaluations so far.
    selection : Selection or None
        Which optional terms of the scene stay; None where it has none, or nothing is decided.
    representatives : Representatives or None
        Frames that are sampled in the name of all; None where all are.
    integrated : bool
        Whether errors of the flux are integrated out in full though the scene does not ask for
        that: which optimum is the best depends on them, or linear response to them bends.
    exact : Drawing or None
        What the exact model came to, or would begin with, while errors are integrated out because
        linear response around it bends: the answer until there is a better one.
    linear : bool
        Whether linear response was looked at, and stands.
    """

    stage: Stage
    calls: int
    selection: Selection | None = None
    representatives: Representatives | None = None
    integrated: bool = False
    exact: Drawing | None = None
    linear: bool = False

    @property
    def answering(self) -> "Checkpoint":
        """The checkpoint that an answer is made of."""
        if self.exact is None or (not self.exact.verdict.converged and stands(self.stage)):
            return self
        return dataclasses.replace(self, stage=self.exact, exact=None, integrated=False)

    @property
    def method(self) -> str:
        """Whether draws are weighted ("importance") or walked ("emcee")."""
        return "importance" if isinstance(self.stage, Weighted | Settled) else "emcee"

    def to_bytes(self) -> bytes:
        """Return the checkpoint for a store."""
        return pack(*self._packed())

    def addition(self, before: "Checkpoint") -> bytes | None:
        """Return what a store that holds an earlier checkpoint needs besides.

        Parameters
        ----------
        before : Checkpoint
            What it holds.

        Returns
        -------
        bytes or None
            To be read behind what it holds; None where nothing of that is of use any more.
        """
        return pack_addition(*self._packed(), before._packed()[1])

    def _packed(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        arrays: dict[str, NDArray[Any]] = {}
        meta = {
            field.name: pack_parts(getattr(self, field.name), field.name, arrays)
            for field in dataclasses.fields(self)
        }
        return meta, arrays

    @classmethod
    def from_bytes(cls, *pieces: bytes) -> "Checkpoint":
        """Read what `to_bytes` wrote, and what `addition` wrote after it, in this order."""
        meta, arrays = unpack(*pieces)
        return cls(**{name: unpack_parts(item, arrays) for name, item in meta.items()})
