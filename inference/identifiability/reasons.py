"""Why a parameter is not identified, and what would help: in plain words, from computed bounds."""

import dataclasses
import functools
import math

import numpy as np

from inference.identifiability.experiment import Experiment, information
from inference.identifiability.information import Information
from inference.identifiability.remedies import Remedy, cheap_remedies, remedies, span
from simulator.errors import listed
from simulator.object_model import log_slope
from simulator.parameters import OFFSET
from simulator.sensor_unknowns import PHASE, TIMING

__all__ = ["Diagnosis"]


_ALIKE = 0.98  # correlation of two bounds above which one parameter hides behind the other
_HELP = 2.0  # a change that lowers a bound by less is not worth its words
_POWER_LAW = 0.15  # distance of the exponent from a whole number
_WANTED = 0.1  # relative error that a bound is held against
_NEARLY = 1.5  # times the wanted bound that noise still counts as what limits it at
_MOST = 1e6  # times lower noise that is looked at
_NOISELESS = 100.0  # times lower noise, at which errors of the model are all that is left
_BACKGROUND = ("background.strength", "background.distance_m")
_PRODUCT = ("object.c0", "object.c2")  # all that a flux that falls as r^-4 tells of an object


def _count(number: float) -> str:
    return f"{number:.2g}" if number < 100 else f"{number:.0f}" if number < 1e4 else "over 10000"


def _relative(parameter: str, sd: float) -> str:
    """Say a bound, relative to what it is measured by."""
    unit = "itself"
    if parameter.endswith(".c1"):
        unit = "sqrt(c0)"
    elif parameter.startswith("crosstalk"):
        unit = "the scene's light"
    elif parameter in (OFFSET, PHASE, TIMING):
        unit = "a typical range"
    if sd < 1:
        return f"{100 * sd:.2g} %" + ("" if unit == "itself" else f" of {unit}")
    return f"{_count(sd)} times {unit}"


@dataclasses.dataclass(frozen=True, eq=False)
class Diagnosis:
    """Explains an experiment's bounds.

    Attributes
    ----------
    experiment : Experiment
        What is explained.
    still : bool
        Whether the ranges of all frames are one and the same, as far as can be told.
    """

    experiment: Experiment
    still: bool

    @functools.cached_property
    def information(self) -> Information:
        """What the readings alone tell."""
        return information(self.experiment)

    @functools.cached_property
    def _remedies(self) -> list[Remedy]:
        return remedies(self.experiment)

    @functools.cached_property
    def _cheap(self) -> list[Remedy]:
        return cheap_remedies(self.experiment)

    @property
    def actions(self) -> list[Remedy]:
        """What can be done, in place of what could be known: candidates of `offers`."""
        return [r for r in self._remedies if r.kind in ("empty", "motion")] + self._cheap

    @functools.cached_property
    def distinct(self) -> int:
        """Number of distinct ranges."""
        present = np.sort(self.experiment.log_r[np.isfinite(self.experiment.log_r)])
        if present.size == 0:
            return 0
        return 1 if self.still else 1 + int(np.sum(np.diff(present) > 1e-9))

    @functools.cached_property
    def needed(self) -> int:
        """Number of distinct ranges that the unknowns need at least: each tells one number.

        As many are an exactly determined system, which can have several solutions; one more
        leaves something to check the answer by.
        """
        log_r = self.experiment.log_r
        empty, present = log_r[np.isnan(log_r)], log_r[~np.isnan(log_r)]
        d = len(self.experiment.names)
        middle = float(present.mean()) if present.size else 0.0
        wide = max(span(log_r), math.log(4.0))
        many = np.append(np.linspace(middle - wide / 2, middle + wide / 2, 2 * d + 2), empty)
        ranks = [
            information(
                dataclasses.replace(
                    self.experiment, log_r=where, gain=None, common_range=False, rates=None
                )
            ).rank
            for where in (many, empty)
            if where.size
        ]
        return ranks[0] - sum(ranks[1:])

    def bound(self, parameter: str) -> float:
        """Return the Cramer-Rao bound of an unknown, relative, or of the mean of log r."""
        if parameter == "range_m":
            return self.information.scale_sd
        return float(self.information.sd[self.information.names.index(parameter)])

    def explain(self, parameter: str) -> str:
        """Say why the readings do not tell a parameter, and what would.

        Parameters
        ----------
        parameter : str
            An unknown on which the readings depend, or "range_m".
        """
        of_object = parameter == "range_m" or parameter.startswith(("object", "background.shadow"))
        if self.distinct == 0 and of_object:
            return "no frame holds an object"
        sd = self.bound(parameter)
        cause = self._open(parameter) if math.isinf(sd) else self._faint(parameter, sd)
        return "; ".join([cause, *self._help(parameter, sd)])

    def _open(self, parameter: str) -> str:
        """Say why even noise-free readings do not tell a parameter."""
        unknowns = len(self.experiment.names)
        if self.needed > self.distinct > 0 and self.experiment.rates is None:
            if self.distinct == 1:
                return (
                    "the object must move: all frames show it at one range, and "
                    f"{unknowns} unknowns need at least {self.needed} distinct ranges"
                )
            return (
                f"the object is seen at {self.distinct} distinct ranges, and {unknowns} unknowns "
                f"need at least {self.needed}"
            )
        if parameter == "range_m":
            return "the readings stay the same when the ranges and other unknowns change together"
        of = self.information
        weights = np.abs(of.companions(of.names.index(parameter)))
        partners = [
            name
            for name, weight in zip(of.names, weights, strict=True)
            if weight > 0.01 and name != parameter
        ]
        if not partners:
            return "the readings do not depend on it"
        return f"the readings stay the same when it and {listed(partners)} change together"

    def _faint(self, parameter: str, sd: float) -> str:
        """Say what hides a parameter that noise-free readings would tell."""
        text = f"the readings alone tell it to {_relative(parameter, sd)}"
        if sd > 10:
            text = "the readings alone do not even tell its order of magnitude"
        law = self._power_law()
        if law == 4 and parameter.startswith("object.c"):
            if set(_PRODUCT) <= set(self.experiment.names):
                return f"{text}: at these ranges the flux falls as r^-4 and tells c0 c2 alone"
            if parameter == "object.c1":
                return f"{text}: at these ranges the flux falls as r^-4, whatever c1"
        if law == 2 and parameter in ("object.c0", "object.c1"):
            return f"{text}: at these ranges the flux falls as r^-2, whatever c0 and c1"
        hidden = self._hidden(parameter, sd)
        if hidden is not None:
            return text + hidden
        name, value = self._look_alike(parameter)
        if self._is_background(parameter, name if abs(value) > _ALIKE else ""):
            assert self.experiment.background is not None  # noqa: S101  # it is unknown
            away = self.experiment.background.distance
            return f"{text}: crosstalk and a background at {away:.2g} m look alike"
        if abs(value) > _ALIKE:
            size = f"is {value:.4f}" if abs(value) < 0.9999 else "exceeds 0.9999 in size"
            return f"{text}: it hides behind {name} (their correlation {size})"
        return text

    def _hidden(self, parameter: str, sd: float) -> str | None:
        """Say which error of the model hides a parameter, where one does."""
        for error, without in self._exact.items():
            bound = without.bound(parameter)
            if _HELP * bound < sd:
                return (
                    f": the error of the {error} hides it, without which they would tell it to "
                    f"{_relative(parameter, bound)}"
                )
        return None

    @functools.cached_property
    def _exact(self) -> "dict[str, Diagnosis]":
        """The same without one error of the model each, of those that there are."""
        e = self.experiment
        changes: dict[str, dict[str, float | None]] = {
            "object's flux": {"discrepancy": None} if e.discrepancy else {},
            "shadow": {"shadow": 0.0} if e.shadow else {},
            "effective distance": {"range_error": 0.0} if e.range_error else {},
        }
        return {
            error: Diagnosis(dataclasses.replace(e, **change), self.still)  # type: ignore[arg-type]
            for error, change in changes.items()
            if change
        }

    def _is_background(self, parameter: str, like: str) -> bool:
        """Return whether it is crosstalk and background that are taken for one another."""
        kinds = {"crosstalk": "crosstalk", **dict.fromkeys(_BACKGROUND, "background")}
        mine = kinds.get("crosstalk" if parameter.startswith("crosstalk") else parameter)
        other = kinds.get("crosstalk" if like.startswith("crosstalk") else like)
        if mine is None:
            return False
        if other is not None and other != mine:
            return True
        known = [r for r in self._remedies if r.kind not in ("empty", "motion")]
        best = min(known, key=lambda r: r.bound(parameter), default=None)
        return (
            best is not None
            and _HELP * best.bound(parameter) < self.bound(parameter)
            and kinds.get(best.kind) not in (None, mine)
        )

    def _power_law(self) -> int | None:
        """Return the power of r at which the flux falls at all ranges, where it is one power."""
        (c0, c1), log_r = self.experiment.shape, self.experiment.log_r
        ranges = np.exp(log_r[np.isfinite(log_r)])
        power = np.array([-log_slope(r, c0, c1) for r in ranges])
        for whole in (2, 4):
            if power.size and np.abs(power - whole).max() < _POWER_LAW:
                return whole
        return None

    def _look_alike(self, parameter: str) -> tuple[str, float]:
        """Return the unknown that the bound is most correlated with."""
        of = self.information
        if parameter == "range_m":
            present = ~np.isnan(of.own_variance)
            mine = of.response[present].mean(axis=0) @ of.factor
        else:
            mine = of.factor[of.names.index(parameter)]
        best = ("", 0.0)
        for name, row in zip(of.names, of.factor, strict=True):
            size = float(np.linalg.norm(row) * np.linalg.norm(mine))
            if name == parameter or size == 0:
                continue
            value = float(row @ mine) / size
            if abs(value) > abs(best[1]):
                best = (name, value)
        return best

    def _help(self, parameter: str, sd: float) -> list[str]:
        """Name the changes that lower the bound most."""
        useful = [
            (remedy.bound(parameter), remedy)
            for remedy in self._remedies
            if _HELP * remedy.bound(parameter) < sd
        ]
        useful.sort(key=lambda item: item[0])
        chosen = [item for item in useful if item[0] < 1][:2]
        # frames without the object cost nothing: they are named whenever they help
        chosen += [
            item
            for item in useful
            if item[1].kind == "empty" and item[0] < 1 and item not in chosen
        ]
        told = self._cheapest(parameter, sd)
        if told is not None and not any(
            remedy.cost <= told[1].cost and after < _WANTED for after, remedy in chosen
        ):
            chosen.append(told)
        words = []
        for after, remedy in chosen:
            fold = f" {_count(sd / after)} times," if math.isfinite(sd) else ""
            verb = "lower the bound" if math.isfinite(sd) else "bring the bound down"
            words.append(f"{remedy.words} would {verb}{fold} to {_relative(parameter, after)}")
        if not words and math.isfinite(sd) and sd > _WANTED:
            words.append(self._quieter(parameter, sd))
        return words

    def _quieter(self, parameter: str, sd: float) -> str:
        """Say by how much lower noise would tell a parameter, or that none would."""
        times, e = sd / _WANTED, self.experiment
        exact = not (e.discrepancy or e.shadow or e.range_error)
        if exact or self._at_noise(parameter, min(times, _MOST)) < _NEARLY * _WANTED:
            return f"noise {_count(times)} times lower would tell it to 10 %"
        least = self._at_noise(parameter, min(_NOISELESS * times, _MOST))
        return (
            "less noise would not help: with hardly any, the errors that `discrepancy` allows the "
            f"model would leave it open by {_relative(parameter, least)}"
        )

    def _at_noise(self, parameter: str, quieter: float) -> float:
        """Return the bound with so many times less noise."""
        of = information(self.experiment, quieter)
        return of.scale_sd if parameter == "range_m" else float(of.sd[of.names.index(parameter)])

    def _cheapest(self, parameter: str, sd: float) -> tuple[float, Remedy] | None:
        """Return the cheapest knowledge of ranges, or of the empty scene, that is enough."""
        enough = [
            (remedy.bound(parameter), remedy)
            for remedy in self._cheap
            if _HELP * remedy.bound(parameter) < min(sd, _HELP * _WANTED)
        ]
        return min(enough, key=lambda item: (item[1].cost, item[0]), default=None)
