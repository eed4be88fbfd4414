"""What every technique of the registry promises, as checks that raise where it is not kept.

A check takes a technique and a kind of sensor, finds the scenes of the menu that the technique
serves by its own word (needs, immunities, obstacle), and looks at its answers. Seeds are fixed;
the false-alarm rates are those of a new seed.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from inference.estimates import Status, TechniqueResult
from inference.known import known_of
from inference.plan import obstacle
from inference.realtime.registry import TECHNIQUES
from inference.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.sensor import Sensor
from tests.contract.scenes import MENU, TERMS, Setting, frames_of, light_of, sensor_of, span
from tests.thorough import THOROUGH

__all__ = [
    "answers_are_right",
    "errors_are_right",
    "fields_are_those_of_the_contract",
    "frames_that_cannot_be_used_are_said_to_be",
    "immunities_are_those_declared",
    "model_errors_are_right",
    "model_errors_of_many_frames_are_right",
    "needs_are_those_declared",
    "of_single_frames",
    "settings_of",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_RIGHT = 5.0  # standard deviations: 6e-7 of a frame
_OFF = 20.0
_QUIET = 1e-3  # of the noise
_SINGLE, _MANY = 200, 12  # frames of a set
_TRIALS, _SETS = 4000, 40  # frames, and sets of frames, whose scatter is compared with their sd
# scenes of a fit over many frames in which this is done: a set is a whole fit
_MONTE_CARLO = 2 if THOROUGH else 1
_ERRORS = (1e-4, 1e-5)  # of flux and effective distance [m]: small enough to be linear
_ERRING = 12  # sets of frames whose model errs
_MISFITS = 3  # of 40 sets of a fit that is right
_ALARM = 1e-6  # of one comparison of scatter and sd
_OUTSIDE = float(stats.chi2.sf(4.0, 1))  # what noise of two sds leaves outside of bounds


def of_single_frames(technique: Technique) -> bool:
    """Whether each frame is answered on its own."""
    return technique.name in TECHNIQUES


def settings_of(technique: Technique, kind: str) -> list[Setting]:
    """Return the scenes of the menu that a technique serves by its own word."""
    sensor = sensor_of(kind)
    frames = frames_of(sensor, MENU[0], span(_MANY), np.random.default_rng(0))

    def serves(setting: Setting) -> bool:
        scene = setting.scene
        return obstacle(technique, sensor, scene, known_of(scene), frames) is None

    return [setting for setting in MENU if serves(setting)]


def _solve(
    technique: Technique, sensor: Sensor, setting: Setting, frames: Frames
) -> TechniqueResult:
    scene = setting.scene
    return technique.solve(Task(sensor, scene, frames, known_of(scene)))


def _frames(
    technique: Technique, sensor: Sensor, setting: Setting, seed: int
) -> tuple[Array, Frames]:
    ranges = span(_SINGLE if of_single_frames(technique) else _MANY)
    return ranges, frames_of(sensor, setting, ranges, np.random.default_rng(seed))


def _misses(result: TechniqueResult, truth: Array) -> Array:
    """Return how many sds the nearest root lies off; inf without one, nan beside a fold."""
    if result.range_bounds_m is not None:
        low, high = result.range_bounds_m.T
        inside = (low <= truth) & (truth <= high)
        return np.where(inside, 0.0, np.inf)
    distance = np.abs(result.roots_m - truth[:, None])
    nearest = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=1)
    rows = np.arange(truth.size)
    off, sd = distance[rows, nearest], result.roots_sd_m[rows, nearest]
    misses = np.where(np.isnan(sd) & result.near_fold, np.nan, off / sd)
    return np.where(result.root_count == 0, np.inf, misses)


def answers_are_right(technique: Technique, kind: str) -> None:
    """Check that every scene that is served gives a root within 5 sd of the truth.

    False alarm: 6e-7 a frame, so 1.2e-4 a scene of 200 frames. Of the frames at most a fifth may
    lie beside a fold, where no sd holds.
    """
    settings = settings_of(technique, kind)
    assert settings, f"{technique.name} serves no scene of the menu: add one that it is made for"
    sensor = sensor_of(kind)
    for setting in settings:
        truth, frames = _frames(technique, sensor, setting, 1)
        result = _solve(technique, sensor, setting, frames)
        if result.range_bounds_m is not None:
            # bounds hold most of the noise, not all: here they are tested where there is none
            silent = sensor_of(kind, _QUIET)
            truth, frames = _frames(technique, silent, setting, 1)
            result = _solve(technique, silent, setting, frames)
        fields_are_those_of_the_contract(technique, result, truth.size)
        misses = _misses(result, truth)
        beside = np.isnan(misses)
        assert np.mean(beside) <= 0.2, (technique.name, setting.name)
        worst = float(np.max(misses[~beside]))
        assert worst < _RIGHT, f"{technique.name}, {setting.name}: a root is {worst:.3g} sd off"


def errors_are_right(technique: Technique, kind: str) -> None:
    """Check standard deviations against the scatter of simulated readings.

    Of single frames: of 4000 each is within one sd of the truth with probability 0.683, and the
    count lies in the binomial band of a false-alarm rate of 1e-6; outside bounds lie no more than
    noise of two standard deviations puts there. Of many frames, in the first
    scene (two in `make thorough`): the mean square of the misses in sds, over 40 sets, in the band
    of a chi-square with 40 degrees of freedom (as if the frames of a set erred together, which is
    the widest case). Sets that a fit calls a misfit have no ranges; at a rate of 1e-3 four of 40
    are a false alarm of 1e-7.
    """
    sensor = sensor_of(kind)
    settings = settings_of(technique, kind)
    for setting in settings if of_single_frames(technique) else settings[:_MONTE_CARLO]:
        if of_single_frames(technique):
            truth = np.tile(span(8), _TRIALS // 8)
            frames = frames_of(sensor, setting, truth, np.random.default_rng(2))
            result = _solve(technique, sensor, setting, frames)
            if result.range_bounds_m is not None:
                told = np.isfinite(result.range_bounds_m).all(axis=1)
                outside = np.count_nonzero(_misses(result, truth)[told])
                assert outside <= stats.binom.isf(_ALARM, told.sum(), _OUTSIDE), setting.name
                continue
            misses = _misses(result, truth)
            misses = misses[~np.isnan(misses)]
            assert misses.size > 0.7 * _TRIALS
            share, low, high = float(np.mean(misses < 1.0)), *_binomial_band(misses.size)
            assert low < share < high, (technique.name, setting.name, low, share, high)
        else:
            sums = []
            for seed in range(_SETS):
                truth, frames = _frames(technique, sensor, setting, 100 + seed)
                result = _solve(technique, sensor, setting, frames)
                assert result.fit is not None
                if not result.fit["misfit"]:
                    sums.append(float(np.nanmean(_misses(result, truth) ** 2)))
            assert len(sums) >= _SETS - _MISFITS, (technique.name, setting.name)
            low = float(special.chdtri(len(sums), 1 - _ALARM / 2)) / len(sums)
            high = float(special.chdtri(len(sums), _ALARM / 2)) / len(sums)
            square = float(np.mean(sums))
            assert low < square < high, (technique.name, setting.name, low, square, high)


def model_errors_are_right(technique: Technique, kind: str) -> None:
    """Check the model's part of standard deviations against random smooth errors of the model.

    Readings nearly without noise: of 2000 frames, each with errors of its own, each is within one
    sd with probability 0.683 (which the errors' own kurtosis shifts by 0.02 at most), as in
    `errors_are_right`; the squares of the parts sum to the whole's.
    """
    sensor = sensor_of(kind, _QUIET)
    for setting in settings_of(technique, kind):
        erring = dataclasses.replace(setting, errors=_ERRORS)
        truth = np.tile(span(8), _TRIALS // 16)
        frames = frames_of(sensor, erring, truth, np.random.default_rng(6))
        result = _solve(technique, sensor, erring, frames)
        if result.range_bounds_m is not None:
            continue
        assert result.sd_parts_m is not None
        filled = np.isfinite(result.roots_sd_m)
        squares = sum(part[filled] ** 2 for part in result.sd_parts_m)
        np.testing.assert_allclose(squares, result.roots_sd_m[filled] ** 2, rtol=1e-12)
        misses = _misses(result, truth)
        misses = misses[~np.isnan(misses)]
        assert misses.size > 0.35 * _TRIALS
        share, low, high = float(np.mean(misses < 1.0)), *_binomial_band(misses.size)
        assert low < share < high, (technique.name, setting.name, low, share, high)


def model_errors_of_many_frames_are_right(technique: Technique, kind: str) -> None:
    """Check the model's part against random smooth errors that the frames of a set share.

    Readings nearly without noise, in the first scene, 12 sets: the mean square of the misses in the
    band of a chi-square with 12 degrees of freedom, as in `errors_are_right`; no set reads as a
    misfit, and the squares of the parts sum to the whole's.
    """
    sensor, ranges = sensor_of(kind, _QUIET), span(_MANY)
    erring = dataclasses.replace(settings_of(technique, kind)[0], errors=_ERRORS)
    sums = []
    for seed in range(_ERRING):
        rng = np.random.default_rng(200 + seed)
        frames = frames_of(sensor, erring, ranges, rng, one_error=True)
        result = _solve(technique, sensor, erring, frames)
        assert result.fit is not None
        assert result.sd_parts_m is not None
        assert not result.fit["misfit"], (technique.name, result.fit["p_value"])
        filled = np.isfinite(result.roots_sd_m)
        squares = sum(part[filled] ** 2 for part in result.sd_parts_m)
        np.testing.assert_allclose(squares, result.roots_sd_m[filled] ** 2, rtol=1e-9)
        sums.append(float(np.nanmean(_misses(result, ranges) ** 2)))
    low = float(special.chdtri(_ERRING, 1 - _ALARM / 2)) / _ERRING
    high = float(special.chdtri(_ERRING, _ALARM / 2)) / _ERRING
    assert low < float(np.mean(sums)) < high, (technique.name, low, np.mean(sums), high)


def needs_are_those_declared(technique: Technique, kind: str) -> None:
    """Check each number of a scene: what a technique does not declare, it answers right without.

    Every scene that is served is tried with one of its known numbers unknown, a normal law of its
    logarithm: it is refused, or the answer is as right as in `answers_are_right`.
    """
    sensor = sensor_of(kind)
    for setting in settings_of(technique, kind):
        truth, frames = _frames(technique, sensor, setting, 5)
        for path in known_of(setting.scene).numbers:
            less = setting.without(path)
            known = known_of(less.scene)
            assert path not in known.numbers
            if obstacle(technique, sensor, less.scene, known, frames) is not None:
                continue
            result = _solve(technique, sensor, less, frames)
            if result.range_bounds_m is None:
                worst = float(np.nanmax(_misses(result, truth)))
                assert worst < _RIGHT, f"{technique.name}, {less.name}: {worst:.3g} sd off"


def _binomial_band(n: int) -> tuple[float, float]:
    """Return where the share of n misses below one sd lies but for the false-alarm rate."""
    share = math.erf(math.sqrt(0.5))
    reach = float(-special.ndtri(_ALARM / 2)) * math.sqrt(share * (1 - share) / n)
    return share - reach, share + reach


def immunities_are_those_declared(technique: Technique, kind: str) -> None:
    """Check each term: declared, it may be there; not declared, it spoils the answer.

    Declared: a scene that is served has the term in its readings without knowing it, so that
    `answers_are_right` has shown it to hold there. Not declared: where readings contain the term
    and the statement leaves it out, most frames have no root within 20 sd, or the fit says that it
    does not explain them, or refuses.
    """
    settings = settings_of(technique, kind)
    # a term that noise hides would spoil nothing
    sensor = sensor_of(kind, _QUIET)
    for term in TERMS:
        shown = [setting for setting in settings if term in setting.unknown]
        if term == "discrepancy" and term in technique.immune_to:
            # an error of which the scene says that there is none
            for setting in settings:
                spoiled = setting.with_term(term)
                truth, frames = _frames(technique, sensor, spoiled, 3)
                misses = _misses(_solve(technique, sensor, spoiled, frames), truth)
                assert np.nanmax(misses) < _RIGHT, f"{technique.name}: {spoiled.name}"
            continue
        if term in technique.immune_to:
            assert shown, f"{technique.name} declares {term} and serves no scene that has it"
            continue
        assert not shown, f"{technique.name} serves unknown {term} and does not declare it"
        judged = 0
        without = [setting for setting in settings if not setting.contains(term)]
        # fits that explain nothing search long: two scenes of them are enough
        for setting in without if of_single_frames(technique) else without[:2]:
            spoiled = setting.with_term(term)
            truth, frames = _frames(technique, sensor, spoiled, 3)
            try:
                result = _solve(technique, sensor, spoiled, frames)
            except RefusedError:
                judged += 1
                continue
            if result.range_bounds_m is not None:
                continue  # wide enough to hold the truth by chance
            judged += 1
            if result.fit is not None and result.fit["misfit"]:
                continue
            misses = _misses(result, truth)
            kept = float(np.mean(~(misses > _OFF)))
            assert kept < 0.5, (
                f"{technique.name}, {spoiled.name}: {kept:.0%} are right all the same"
            )
        assert judged, f"{technique.name}: no scene without {term} to add it to"


def fields_are_those_of_the_contract(technique: Technique, result: TechniqueResult, n: int) -> None:
    """Check names, shapes, statuses and the order of roots."""
    assert result.technique == technique.name
    assert len(result) == n
    for column in (result.root_count, result.near_fold, result.reason):
        assert column.shape == (n,)
    count = result.root_count
    assert result.roots_m.shape == result.roots_sd_m.shape == (n, max(result.roots_m.shape[1], 1))
    # roots fill the columns from the left, ascending and positive; the rest is nan
    filled = np.arange(result.roots_m.shape[1]) < count[:, None]
    assert (np.isfinite(result.roots_m) == filled).all()
    assert (result.roots_m[filled] > 0.0).all()
    steps = np.diff(result.roots_m, axis=1)
    assert (steps[filled[:, 1:]] >= 0.0).all()
    sds = result.roots_sd_m[filled]
    assert (sds[~np.isnan(sds)] > 0.0).all()
    assert not np.isinf(result.roots_sd_m).any()
    assert np.isnan(result.roots_sd_m[~filled]).all()
    bounded: Flags = np.zeros(n, dtype=np.bool_)
    if result.range_bounds_m is not None:
        assert result.range_bounds_m.shape == (n, 2)
        bounded = np.asarray(np.isfinite(result.range_bounds_m).all(axis=1))
    expected = np.where(
        count == 1, Status.UNIQUE, np.where((count > 1) | bounded, Status.AMBIGUOUS, Status.NONE)
    )
    free = result.status != Status.SATURATED
    np.testing.assert_array_equal(result.status[free], expected[free])
    # whatever is not one range says why
    assert result.reasons[0] == ""
    assert (result.reason < len(result.reasons)).all()
    assert (result.reason[result.status != Status.UNIQUE] > 0).all()
    assert np.isfinite(result.range_m[result.status == Status.UNIQUE]).all()
    if technique.differential and of_single_frames(technique):
        assert result.power_law is not None
        assert result.zeta is not None


def frames_that_cannot_be_used_are_said_to_be(technique: Technique, kind: str) -> None:
    """Check the statuses of a reading at full scale and of an empty scene among good frames."""
    for setting in settings_of(technique, kind)[:1]:
        ranges = span(_MANY)
        sensor = sensor_of(kind, full_scale=2.0 * light_of(sensor_of(kind), float(ranges[0])))
        frames = frames_of(sensor, setting, ranges, np.random.default_rng(4))
        present = np.ones(_MANY, dtype=np.bool_)
        present[-1] = False
        readings = frames.readings.copy()
        assert sensor.full_scale is not None
        readings[0] = sensor.full_scale
        odd = Frames(
            readings,
            time_s=frames.time_s,
            derivatives=frames.derivatives,
            object_present=present,
        )
        result = _solve(technique, sensor, setting, odd)
        fields_are_those_of_the_contract(technique, result, _MANY)
        assert result.status[0] == Status.SATURATED
        assert result.status[-1] == Status.NONE
        assert "no object" in result.reasons[int(result.reason[-1])]
