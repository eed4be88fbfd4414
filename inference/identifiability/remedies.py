"""What would help: the bounds of the same scene under changed experiments, computed."""

import contextlib
import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.expected_posterior import ExpectedPosterior, expected_posterior
from inference.identifiability.experiment import Experiment, information
from inference.identifiability.information import Information
from inference.identifiability.judged import Judgement, Spread, judged
from inference.identifiability.known_beside import with_rates
from inference.identifiability.over_priors import Elsewhere, elsewhere
from inference.identifiability.status import STATUSES
from simulator.errors import InvalidInputError
from simulator.parameters import OFFSET

__all__ = ["Remedy", "cheap_remedies", "remedies", "span"]

Array = NDArray[np.float64]

_COUNTS = {3: "three", 10: "ten", 30: "thirty"}  # of frames without the object
_TARGETS = 5  # frames of an object at a known distance
_TOLD_M = 1e-3  # to which a ruler or odometry tells a range [m]
# what is done to the scene, the cheapest first: the object taken away, put at a place, at two
# places, moved by something that counts its way, moved farther
_CHEAPEST = ("empty", "distance", "distances", "odometry", "motion")
_LEAST_SPAN = math.log(4.0)
_FRAMES = 40  # of a stroke that is tried, at least
# what a calibration would tell at once
_GROUPS = {
    "crosstalk": "the crosstalk",
    "background.strength": "the background's strength",
    "background.distance_m": "the background's distance",
    "background.shadow": "the shadow's c0 and c1",
    "object.c": "the object",
    "object.c2": "the object's c2",
    "sensor.gain": "the sensor's gain",
    "sensor.phase_offset_rad": "the sensor's phase offset",
    "sensor.timing_offset_s": "the sensor's timing offset",
    "sensor.temperature": "the sensor's temperature coefficients",
}


@dataclasses.dataclass(frozen=True, eq=False)
class Remedy:
    """A changed experiment.

    Attributes
    ----------
    words : str
        The change, as the subject of a sentence: "three frames without the object".
    kind : str
        As of `inference.identifiability.offers.Offer`, or the start of the paths of the unknowns
        that it makes known.
    experiment : Experiment
        With the change.
    frames : int
        Frames that it adds; 0 where it changes those that there are.
    asked : int, optional
        How many frames, the first, have ranges that are asked for; left out: all.
    draws : ndarray, shape (n, d), optional
        Values of the unknowns at which a status has to hold, too: see `over_priors`.
    """

    words: str
    kind: str
    experiment: Experiment
    frames: int = 0
    asked: int | None = None
    draws: Array | None = None

    @functools.cached_property
    def information(self) -> Information:
        """What its readings would tell."""
        # of a copy: what it derives is large, and goes with it
        of = information(dataclasses.replace(self.experiment))
        if self.asked is None:
            return of
        own = of.own_variance.copy()
        own[self.asked :] = np.nan
        return dataclasses.replace(of, own_variance=own)

    @functools.cached_property
    def expected(self) -> ExpectedPosterior:
        """The spread that a posterior of its readings should have."""
        return expected_posterior(dataclasses.replace(self.experiment), self.asked)

    @functools.cached_property
    def _judged(self) -> tuple[Judgement, ...]:
        spread = Spread(self.expected.sd, self.expected.scale_sd)
        return judged(dataclasses.replace(self.experiment), spread, self.expected)

    @functools.cached_property
    def _elsewhere(self) -> Elsewhere | None:
        return None if self.draws is None else elsewhere(self.experiment, self.draws, self.asked)

    @property
    def cost(self) -> tuple[int, int]:
        """What cheaper remedies have less of: trouble, then frames."""
        known = self.kind in _CHEAPEST
        return _CHEAPEST.index(self.kind) if known else len(_CHEAPEST), self.frames

    def bound(self, parameter: str) -> float:
        """Return the bound of an unknown or of "range_m"; inf where the change makes it known."""
        if parameter == "range_m":
            return self.information.scale_sd
        names = self.information.names
        return (
            float(self.information.sd[names.index(parameter)]) if parameter in names else math.inf
        )

    def spread(self, parameter: str) -> float:
        """Return the foreseen spread of an unknown or of "range_m", as `status_of` takes it."""
        if parameter == "range_m":
            return self.expected.scale_sd
        return float(self.expected.sd[self.experiment.parameters.names.index(parameter)])

    def status(self, parameter: str) -> str:
        """Return what an unknown or "range_m" would be then."""
        place = [*self.experiment.parameters.names, "range_m"].index(parameter)
        status = self._judged[place].status
        if self._elsewhere is None:
            return status
        return STATUSES[max(STATUSES.index(status), self._elsewhere.status(place))]


def span(log_r: Array) -> float:
    """Return the span of log r over the frames with an object, 0 without any."""
    present = log_r[np.isfinite(log_r)]
    return float(np.ptp(present)) if present.size else 0.0


def _with_stroke(experiment: Experiment, low: float, high: float) -> tuple[str, Experiment]:
    """Return the experiment with ranges evenly spaced in log r, and what to call them."""
    log_r = experiment.log_r
    empty, present = log_r[np.isnan(log_r)], int(np.isfinite(log_r).sum())
    n = max(present, _FRAMES)
    words = f"from {math.exp(low):.2g} to {math.exp(high):.2g} m"
    if n > present:
        words += f", seen in {n} frames,"
    return words, _with_frames(experiment, np.append(np.linspace(low, high, n), empty))


def _with_frames(experiment: Experiment, log_r: Array) -> Experiment:
    """Return the experiment with other frames, all of the median gain."""
    gain = experiment.gain
    if gain is not None:
        gain = _usual(gain, log_r.size)
    rates = experiment.rates
    if rates is not None:  # ranges of a new stroke are told as well as most of those that were
        usual = np.median(rates[np.isfinite(experiment.log_r)], axis=0)
        rates = np.where(np.isfinite(log_r)[:, None], usual, 0.0)
    return dataclasses.replace(experiment, log_r=log_r, gain=gain, common_range=False, rates=rates)


def _usual(gain: Array, n: int) -> Array:
    """Return the median gain, and temperature, n times."""
    return np.repeat(np.median(gain, axis=0, keepdims=True), n, axis=0)


def _with_more(experiment: Experiment, log_r: Array, rate: float | None = None) -> Experiment:
    """Return the experiment with more frames, of the median gain, their ranges told or not."""
    gain, rates = experiment.gain, experiment.rates
    if gain is not None:
        gain = np.append(gain, _usual(gain, log_r.size), axis=0)
    if rates is not None or rate is not None:
        before = np.zeros((experiment.log_r.size, 2)) if rates is None else rates
        rates = np.append(before, np.tile([rate or 0.0, 0.0], (log_r.size, 1)), axis=0)
    log_r = np.append(experiment.log_r, log_r)
    return dataclasses.replace(experiment, log_r=log_r, gain=gain, rates=rates)


def _room(experiment: Experiment) -> tuple[float, float]:
    """Return the bounds of log r: those of its prior, and before the background."""
    low, high = experiment.range_prior.low, experiment.range_prior.high
    if experiment.background is not None:
        high = min(high, experiment.background.distance)
    present = experiment.log_r[np.isfinite(experiment.log_r)]
    low, high = math.log(max(low, 1e-300)), math.log(max(high, 1e-300))
    return min(low, float(present.min())), max(high, float(present.max()))


def _moved(experiment: Experiment) -> tuple[str, Experiment] | None:
    """Widen the stroke: to twice its span and at least a factor of four."""
    present = experiment.log_r[np.isfinite(experiment.log_r)]
    if present.size == 0:
        return None
    low, high = _room(experiment)
    wide = min(max(2 * float(np.ptp(present)), _LEAST_SPAN), high - low)
    if not math.isfinite(wide) or wide < 1.2 * np.ptp(present) or wide < 1e-3:
        return None
    middle = 0.5 * float(present.min() + present.max())
    middle = min(max(middle, low + wide / 2), high - wide / 2)
    words, changed = _with_stroke(experiment, middle - wide / 2, middle + wide / 2)
    return f"an object that moves {words}", changed


def _at_the_bend(experiment: Experiment) -> tuple[str, Experiment] | None:
    """Move about sqrt(c0), where the flux turns from one power law to another."""
    present = experiment.log_r[np.isfinite(experiment.log_r)]
    if present.size == 0 or not any(name.startswith("object.c") for name in experiment.names):
        return None
    low, high = _room(experiment)
    c0, _ = experiment.shape
    bend = 0.5 * math.log(c0)
    near, far = max(low, bend - math.log(2.0)), min(high, bend + math.log(4.0))
    if far - near < math.log(2.0):
        return None
    words, changed = _with_stroke(experiment, near, far)
    return f"an object that moves about sqrt(c0), {words}", changed


def remedies(experiment: Experiment) -> list[Remedy]:
    """Compute what changes of the experiment would tell.

    Returns
    -------
    list of Remedy
        Three frames without the object, longer and nearer strokes, each group of unknowns known.
    """
    found = _emptied(experiment, 3)
    names = experiment.names
    strokes = (_moved(experiment), _at_the_bend(experiment))
    found += [Remedy(s[0], "motion", s[1]) for s in strokes if s is not None]
    for prefix, words in _GROUPS.items():
        group = tuple(name for name in names if name.startswith(prefix))
        if not group or len(group) == len(names) or (prefix == "object.c" and len(group) == 1):
            continue
        known = dataclasses.replace(experiment, known=(*experiment.known, *group))
        found.append(Remedy(f"knowing {words}", prefix, known))
    return found


def _emptied(experiment: Experiment, *counts: int) -> list[Remedy]:
    """Add frames without the object, where anything else is unknown."""
    if all(name.startswith("object.") for name in experiment.names):
        return []
    tried = {count: _with_more(experiment, np.full(count, np.nan)) for count in counts}
    return [
        Remedy(f"{_COUNTS[count]} frames without the object", "empty", of, count)
        for count, of in tried.items()
    ]


def cheap_remedies(experiment: Experiment) -> list[Remedy]:
    """Compute what little more than the frames that there are would tell.

    Returns
    -------
    list of Remedy
        More frames without the object, the object at one or two distances that a ruler tells to a
        millimetre, odometry that tells the way of the frames that there are to as much.
    """
    found = _emptied(experiment, 10, 30)
    present = experiment.log_r[np.isfinite(experiment.log_r)]
    if present.size == 0 or experiment.common_range:
        return found
    low, high = float(present.min()), float(present.max())
    places = sorted({low, 0.5 * (low + high), high})
    stops: list[tuple[float, ...]] = [(place,) for place in places]
    if high > low:
        stops.append((low, high))
    found += [_told(experiment, distances) for distances in stops]
    if OFFSET not in experiment.parameters.names and high > low:
        # of a stroke that fills the prior of the ranges no offset is left to be told
        with contextlib.suppress(InvalidInputError):
            found.append(_moving(experiment))
    return found


def _told(experiment: Experiment, distances: tuple[float, ...]) -> Remedy:
    """Put the object at distances that are known, in frames of their own."""
    more = np.repeat(distances, _TARGETS)
    told_m = math.hypot(_TOLD_M, experiment.range_error)
    changed = _with_more(experiment, more, 1.0 / told_m)
    where = " and ".join(f"{math.exp(place):.2g}" for place in distances)
    words = f"{_TARGETS} frames with the object at {where} m" + (
        " each" if len(distances) > 1 else ""
    )
    kind = "distance" if len(distances) == 1 else "distances"
    words += f", known to {1e3 * _TOLD_M:g} mm,"
    return Remedy(words, kind, changed, more.size, experiment.log_r.size)  # of others nothing


def _moving(experiment: Experiment) -> Remedy:
    """Let odometry tell the way of the frames that there are."""
    present = np.isfinite(experiment.log_r)
    ranges = np.exp(experiment.log_r[present])
    rates = np.zeros((present.size, 2)) if experiment.rates is None else experiment.rates.copy()
    rates[present, 1] = 1.0 / _TOLD_M
    changed = with_rates(experiment, rates)
    words = (
        f"odometry to {1e3 * _TOLD_M:g} mm over the stroke from {ranges.min():.2g} to "
        f"{ranges.max():.2g} m"
    )
    return Remedy(words, "odometry", changed)
