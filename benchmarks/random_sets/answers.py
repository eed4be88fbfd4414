"""What each way to a range says of a random set, as a row of a table."""

import dataclasses
import functools
import time
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.path_rows import posterior_of
from benchmarks.coverage.paths import PathSet
from benchmarks.random_sets.one_kind import KINDS, kind_of_set
from benchmarks.random_sets.sets import random_set
from benchmarks.random_sets.spoiled import spoiled_set
from benchmarks.random_sets.wide import uneven_set, wide_set
from benchmarks.resumable import Row
from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.fits.techniques.registry import FITS
from inference.posterior.settings import SamplerSettings
from inference.realtime.registry import TECHNIQUES
from inference.tracking.track import track
from simulator.errors import RefusedError
from simulator.scene import parse_scene

__all__ = ["COLUMNS", "SETS", "WAYS", "Held", "answer_row"]

Array = NDArray[np.float64]

COLUMNS = (
    "set",
    "scene",
    "version",
    "answered",
    "asked",
    "held",
    "parameters",
    "parameters_held",
    "worst",
    "of",
    "flags",
    "seconds",
    "reason",
)
_Z = 1.6448536269514722  # of a 90 % interval


@dataclasses.dataclass
class Held:
    """Answers without a flag, and how they stand to the truth.

    Attributes
    ----------
    answered, asked, held : int
        Ranges that were told without a flag, that were asked for, and whose 90 % interval holds.
    parameters, parameters_held : int
        The same of unknowns of the scene that are called identified.
    worst : float
        Largest distance from the truth in standard deviations.
    of : str
        Of what.
    """

    answered: int = 0
    asked: int = 0
    held: int = 0
    parameters: int = 0
    parameters_held: int = 0
    worst: float = 0.0
    of: str = ""

    def ranges(self, name: str, off: Array, asked: int, inside: NDArray[np.bool_]) -> None:
        """Take in ranges: distances from the truth in sd, nan where nothing is told."""
        told = np.isfinite(off)
        self.asked += asked
        self.answered += int(told.sum())
        self.held += int(inside[told].sum())
        if told.any():
            i = int(np.nanargmax(np.abs(off)))
            self._far(abs(float(off[i])), f"{name} frame {i}")

    def parameter(self, name: str, off: float, inside: bool) -> None:
        """Take in an unknown of the scene that is called identified."""
        self.parameters += 1
        self.parameters_held += int(inside)
        self._far(abs(off), name)

    def _far(self, off: float, of: str) -> None:
        if off > self.worst:
            self.worst, self.of = off, of


def _normal(off: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(off) < _Z)


def _take_result(held: Held, data: PathSet, found: TechniqueResult) -> str:
    """Take in a technique's answer; what flags it, if anything does."""
    asked = int(np.isfinite(data.range_m).sum())
    fit = found.fit or {}
    if fit.get("misfit"):
        held.asked += asked
        return f"{found.technique}: misfit"
    off = (found.range_m - data.range_m) / found.sd_m
    off[found.near_fold] = np.nan
    held.ranges(found.technique, off, asked, _normal(off))
    for name, told in (found.parameters or {}).items():
        if name in data.parameters and told["status"] == "identified":
            away = (told["value"] - data.parameters[name]) / told["sd"]
            held.parameter(f"{found.technique} {name}", away, abs(away) < _Z)
    return ""


def _by_techniques(names: Mapping[str, object], data: PathSet, held: Held) -> Row:
    served = estimate(data.sensor, parse_scene(data.scene), data.frames, list(names))
    flags = [_take_result(held, data, found) for found in served.results]
    reasons = {each.name: each.reason for each in served.left_out if each.name in names}
    return {
        "flags": " / ".join(flag for flag in flags if flag),
        "reason": "" if served.results else " / ".join(f"{k}: {v}" for k, v in reasons.items()),
    }


def _at_once(data: PathSet, number: int, seconds: float, held: Held) -> Row:  # noqa: ARG001
    return _by_techniques(TECHNIQUES, data, held)


def _by_fits(data: PathSet, number: int, seconds: float, held: Held) -> Row:  # noqa: ARG001
    return _by_techniques(FITS, data, held)


def _tracked(data: PathSet, number: int, seconds: float, held: Held) -> Row:  # noqa: ARG001
    asked = int(np.isfinite(data.range_m).sum())
    try:
        found = track(data.sensor, parse_scene(data.scene), data.frames)
    except RefusedError as error:
        held.asked += asked
        return {"reason": f"refused: {error}"}
    off = (found.range_m - data.range_m) / found.sd_m
    off[found.misfit] = np.nan
    held.ranges("tracker", off, asked, _normal(off))
    return {"flags": f"misfit in {int(found.misfit.sum())}" if found.misfit.any() else ""}


def _inferred(method: str, data: PathSet, number: int, seconds: float, held: Held) -> Row:
    settings = SamplerSettings.model_validate(
        {"method": method, "seed": number, "max_seconds": seconds}
    )
    asked = int(np.isfinite(data.range_m).sum())
    try:
        found = posterior_of(data, settings)
    except RefusedError as error:
        held.asked += asked
        return {"reason": f"refused: {error}"}
    if not (found.drawn and found.verdict.converged) or found.fit.misfit:
        held.asked += asked
        flag = "misfit" if found.drawn and found.fit.misfit else "not converged"
        return {"flags": flag, "reason": " / ".join(found.verdict.reasons)}
    status = {each.parameter: each.status for each in found.identifiability}
    ranges, truth = found.range_m, data.range_m
    off = (ranges.mean - truth) / ranges.sd
    inside = (ranges.q05 <= truth) & (truth <= ranges.q95)
    for name, told in found.parameters.items():
        if name in data.parameters and status[name] == "identified":
            value = data.parameters[name]
            held.parameter(name, (told.mean - value) / told.sd, told.q05 <= value <= told.q95)
    held.ranges("posterior", off, asked, inside)
    return {"flags": "" if status["range_m"] == "identified" else f"scale {status['range_m']}"}


WAYS: Mapping[str, Callable[[PathSet, int, float, Held], Row]] = {
    "estimate": _at_once,
    "fits": _by_fits,
    "tracker": _tracked,
    "posterior": functools.partial(_inferred, "auto"),
    "walked": functools.partial(_inferred, "emcee"),
}


SETS: Mapping[str, Callable[[int, int], PathSet]] = {
    "random": random_set,
    "wide": wide_set,
    "uneven": uneven_set,
    "spoiled": spoiled_set,
    **{kind: functools.partial(kind_of_set, kind) for kind in KINDS},
}


def answer_row(
    way: str, seed: int, seconds: float, number: int, version: str = "", *, of: str = "random"
) -> Row:
    """Draw a set, ask one way, and hold what it says without a flag to the truth.

    Parameters
    ----------
    way : str
        Of `WAYS`: every technique of single frames; every fit; the tracker; a posterior by `auto`;
        one by `emcee`, as it is where no method is stated.
    seed, number : int
        As for `random_set`.
    seconds : float
        Limit of a posterior [s of processor time].
    version : str
        Of the code, for the table.
    of : str
        Which sets, of `SETS`.
    """
    data = SETS[of](seed, number)
    held = Held()
    start = time.process_time()
    told = WAYS[way](data, number, seconds, held)
    used = time.process_time() - start
    return {
        "scene": data.name,
        "version": version,
        **dataclasses.asdict(held),
        "seconds": used,
        **told,
    }
