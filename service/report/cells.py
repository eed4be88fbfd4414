"""What there is to measure: one cell for a method, a scene, and a value of the method's knob."""

import dataclasses
from collections.abc import Iterator

from inference.fits.techniques.registry import FITS
from inference.realtime.registry import TECHNIQUES
from service.report.readings import learns_crosstalk
from service.report.scenes import ReportScene

__all__ = ["FULL", "QUICK", "Cell", "Effort", "cells_of"]


@dataclasses.dataclass(frozen=True)
class Effort:
    """How much is measured: of what is cheap much, of what is dear as few sets as tell something.

    Attributes
    ----------
    batch : int
        Frames of techniques of single frames and of the tracker.
    alone : int
        Frames that come one by one, for the quantiles of their time.
    sets : int
        Data sets of a fit over many frames, two at least: of the last the memory is measured.
    steps : tuple of int
        Frames of a sweep whose derivatives are formed; of short ones many are measured.
    frames : tuple of int
        Frames of a fit.
    posterior_sets : tuple of tuple of int
        Frames of a posterior, and its data sets: first where it does best.
    draws : tuple of int
        Effective draws wanted of a posterior of 40 frames, on the scenes of the quick report.
    hypotheses : tuple of int
        That a tracker keeps.
    tracks : int
        Tracks of a tracker that learns crosstalk: the frames of one err together.
    """

    batch: int
    alone: int
    sets: int
    steps: tuple[int, ...]
    frames: tuple[int, ...]
    posterior_sets: tuple[tuple[int, int], ...]
    draws: tuple[int, ...]
    hypotheses: tuple[int, ...]
    tracks: int = 6


QUICK = Effort(2000, 60, 6, (40, 400), (10, 40), ((40, 2), (10, 1)), (), (1, 12))
FULL = Effort(
    20_000,
    300,
    20,
    (20, 100, 500, 2500),
    (6, 12, 40, 160),
    ((40, 2), (8, 1), (100, 1)),
    (6400,),
    (1, 2, 4, 12),
)

_DRAWS = 400
_FRAMES = 40
# frames in all of short sweeps, and the most sweeps
_SWEPT, _SWEEPS = 1000, 25


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
        Effective draws, hypotheses, or frames that come one by one.
    sets : int
        Data sets.
    seconds : float
        What it takes, about: of use only as a share of all.
    """

    scene: ReportScene
    family: str
    name: str
    frames: int
    value: int
    sets: int
    seconds: float

    @property
    def key(self) -> str:
        """What it is called in the file of what is done."""
        return "|".join(
            [
                self.scene.name,
                self.family,
                self.name,
                *map(str, (self.frames, self.value, self.sets)),
            ]
        )


def cells_of(scene: ReportScene, effort: Effort) -> Iterator[Cell]:
    """Return what there is to measure of a scene, what takes least first.

    Yields
    ------
    Cell
    """
    for name, technique in TECHNIQUES.items():
        for frames in effort.steps if technique.differential else (effort.batch,):
            sweeps = min(max(_SWEPT // frames, 1), _SWEEPS)
            seconds = 0.1 + 5e-4 * effort.alone
            yield Cell(scene, "single", name, frames, effort.alone, sweeps, seconds)
    tracks = effort.tracks if learns_crosstalk(scene) else 1
    for value in effort.hypotheses:
        seconds = 0.1 + 2e-5 * effort.batch * (1 + tracks / 4)
        yield Cell(scene, "tracker", "", effort.batch, value, tracks, seconds)
    wall = scene.free.background
    # these leave a posterior no shape that draws can be weighted to
    shadow = None if wall is None or wall.shadow == "object" else wall.shadow
    hard = shadow is not None and not isinstance(shadow.c0, float | int)
    exact = scene.free.discrepancy == 0
    for name in FITS:
        for frames in effort.frames:
            seconds = effort.sets * (0.01 + 2e-4 * frames) * (0.1 if exact else 1.0)
            yield Cell(scene, "fit", name, frames, 1, effort.sets, seconds)

    def sampled(family: str, frames: int, draws: int, sets: int) -> Cell:
        each = (1.0 + frames / 20 + draws / 1600) * (3 if hard and family == "emcee" else 1)
        seconds = sets * each * (0.5 if family == "importance" else 1.0)
        return Cell(scene, family, "", frames, draws, sets, seconds)

    for frames, sets in effort.posterior_sets:
        for family in ("importance", "emcee"):
            yield sampled(family, frames, _DRAWS, sets)
    for draws in effort.draws if scene.quick else ():
        yield sampled("emcee", _FRAMES, draws, 1)
