"""What there is to measure: one cell for a method, a scene, and a value of the method's knob."""

import dataclasses
from collections.abc import Iterator

from inference.fits.techniques.registry import FITS
from inference.realtime.registry import TECHNIQUES
from service.report.scenes import ReportScene

__all__ = ["FULL", "QUICK", "Cell", "Effort", "cells_of"]


@dataclasses.dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes
    ----------
    batch : int
        Frames of techniques of single frames and of the tracker.
    alone : int
        Frames that come one by one, for the quantiles of their time.
    sets : int
        Data sets of a fit over many frames.
    steps : tuple of int
        Frames of a sweep whose derivatives are formed.
    frames : tuple of int
        Frames of a fit.
    posterior_frames : tuple of int
        Frames of a posterior.
    draws : tuple of int
        Effective draws wanted of a posterior of 40 frames.
    hypotheses : tuple of int
        That a tracker keeps.
    """

    batch: int
    alone: int
    sets: int
    steps: tuple[int, ...]
    frames: tuple[int, ...]
    posterior_frames: tuple[int, ...]
    draws: tuple[int, ...]
    hypotheses: tuple[int, ...]


QUICK = Effort(2000, 60, 2, (40, 400), (10, 40), (10, 40), (), (1, 12))
FULL = Effort(
    20_000,
    300,
    8,
    (20, 100, 500, 2500),
    (6, 12, 40, 160),
    (6, 12, 40, 160),
    (100, 1600, 6400),
    (1, 2, 4, 12),
)

_DRAWS = 400
_FRAMES = 40


@dataclasses.dataclass(frozen=True)
class Cell:
    """One thing to measure.

    Attributes
    ----------
    scene : ReportScene
        On what.
    family, name : str
        "single", "fit", "tracker", "emcee" or "importance"; of the first two which technique.
    frames : int
        With an object.
    value : int
        Effective draws, hypotheses, or data sets.
    seconds : float
        What it takes, about: of use only as a share of all.
    """

    scene: ReportScene
    family: str
    name: str
    frames: int
    value: int
    seconds: float

    @property
    def key(self) -> str:
        """What it is called in the file of what is done."""
        return "|".join(
            [self.scene.name, self.family, self.name, str(self.frames), str(self.value)]
        )


def cells_of(scene: ReportScene, effort: Effort) -> Iterator[Cell]:
    """Return what there is to measure of a scene, what takes least first.

    Parameters
    ----------
    scene : ReportScene
        The scene.
    effort : Effort
        How much to measure.

    Yields
    ------
    Cell
    """
    for name, technique in TECHNIQUES.items():
        for frames in effort.steps if technique.differential else (effort.batch,):
            yield Cell(scene, "single", name, frames, effort.alone, 0.3)
    for value in effort.hypotheses:
        yield Cell(scene, "tracker", "", effort.batch, value, 0.5)
    unknowns = 3 + 2 * ("unknown" in scene.name.lower())
    for name in FITS:
        for frames in effort.frames:
            yield Cell(scene, "fit", name, frames, effort.sets, 0.1 * effort.sets)
    for frames in effort.posterior_frames:
        yield Cell(scene, "importance", "", frames, _DRAWS, 1.0 + frames / 40)
        yield Cell(scene, "emcee", "", frames, _DRAWS, unknowns * (0.3 + frames / 40))
    for draws in effort.draws:
        yield Cell(scene, "emcee", "", _FRAMES, draws, unknowns * (0.3 + draws / 800))
