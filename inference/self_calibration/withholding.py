"""What is withheld: ranges of what may be crosstalk, free ways, and what is suddenly sharp."""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.track import Track
from inference.tracking.tracker import Tracker
from simulator.frames import Frames

__all__ = ["faded", "not_free", "withheld"]

_MAY_BE_EMPTY = 0.05  # probability of readings as strange as these without an object
# of an object beside crosstalk that is not known yet (docs/model.md, resting)
_LEAST = 0.2
_FADES_S = 3.0  # time in which a width before a calibration is forgotten to 1 / e


def withheld(model: Tracker, frames: Frames, track: Track) -> Track:
    """Return answers without the ranges of an object that may not be there.

    To the tracker an error of the crosstalk that all frames share is a faint object that rests:
    it learns the object's range, and of the empty scene nothing.

    Parameters
    ----------
    model : Tracker
        Of a scene whose crosstalk is known to some extent.
    frames, track : Frames, Track
        Frames, and what it said of them.

    Returns
    -------
    Track
        Where an empty scene explains the readings, `Status.AMBIGUOUS` in place of one range, and
        an object is as likely there as not, at most.
    """
    one = track.status == Status.UNIQUE
    if frames.known_range_m is not None:
        one &= np.isnan(frames.known_range_m)
    if not one.any() or model.observed.by_rate:
        return track
    empty = surprise_of_empty(model, frames.select(one))
    used = int(np.sum(model.observed.used))
    may = np.zeros(len(track), dtype=bool)
    may[one] = empty <= scipy.special.chdtri(used, _MAY_BE_EMPTY)
    if not may.any():
        return track
    status = np.where(may, np.uint8(Status.AMBIGUOUS), track.status)
    present = np.where(may, np.minimum(track.present, 0.5), track.present)
    return dataclasses.replace(track, status=status.astype(np.uint8), present=present)


def not_free(model: Tracker, frames: Frames, empty: Frames | None, track: Track) -> Track:
    """Return answers in which no scene is free that crosstalk alone explains which is not known.

    Until a scene is calibrated the tracker carries its crosstalk as an error as wide as its prior,
    and learns nothing of it: the light of any object may be crosstalk then.

    Parameters
    ----------
    model : Tracker
        Of a scene that is not calibrated.
    frames, track : Frames, Track
        Frames, and what it said of them.
    empty : Frames or None
        The last that are known to be without the object.

    Returns
    -------
    Track
        With `present` not below a least probability, but of frames that are known to be empty, or
        read what such frames read.
    """
    low = track.present < _LEAST
    if frames.object_present is not None:
        low &= frames.object_present
    if not low.any():
        return track
    if empty is not None and not model.observed.by_rate:
        used = np.asarray(model.observed.used)
        off = (frames.readings - empty.readings.mean(axis=0)) * model.observed.scale
        surprise = np.square(off[:, used]).sum(axis=1) / (1.0 + 1.0 / len(empty))
        low &= surprise > scipy.special.chdtri(int(used.sum()), _MAY_BE_EMPTY)
    return dataclasses.replace(track, present=np.where(low, _LEAST, track.present))


def faded(
    frames: Frames, track: Track, widest: float, widest_at: float
) -> tuple[Track, float, float]:
    """Return answers that are not suddenly sharper than those of the seconds before.

    Before a calibration errors of the scene are as large as its priors, and the tracker follows
    them linearly. Where what they do to a range goes through zero, its standard deviation would be
    that of the noise in a few frames; what is known of the scene has not changed.

    Parameters
    ----------
    frames, track : Frames, Track
        Frames, and what the tracker said of them. Ranges that are told stay as they are.
    widest, widest_at : float
        Largest standard deviation of late, as a share of the range, as of this time [s].

    Returns
    -------
    (Track, float, float)
        With what was added as a part of the scene; and the largest share and its time, as of the
        last frame with one range.
    """
    sd, scene = track.best_sd_m.copy(), track.sd_parts_m.scene.copy()
    times = np.zeros(len(frames)) if frames.time_s is None else frames.time_s
    one = track.status == Status.UNIQUE
    if frames.known_range_m is not None:
        one = one & np.isnan(frames.known_range_m)
    for i in np.flatnonzero(one):
        widest *= math.exp(-(float(times[i]) - widest_at) / _FADES_S)
        widest_at = float(times[i])
        least = widest * track.best_m[i]
        if sd[i] < least:
            scene[i] = math.hypot(scene[i], math.sqrt((least - sd[i]) * (least + sd[i])))
            sd[i] = least
        elif np.isfinite(sd[i]):
            widest = float(sd[i] / track.best_m[i])
    parts = track.sd_parts_m._replace(scene=scene)
    return dataclasses.replace(track, best_sd_m=sd, sd_parts_m=parts), widest, widest_at


def surprise_of_empty(model: Tracker, frames: Frames) -> NDArray[np.float64]:
    """Return how much readings surprise the empty scene: a chi-square, shape (n,)."""
    table, empty = model.model.table, model.model.places.empty
    used = np.asarray(model.observed.used)
    gain = frames.gains
    mean = gain[:, None] * empty[:, 0] + np.array([table.crosstalk1, table.crosstalk2])
    off = np.where(used, frames.readings * model.observed.scale - mean, 0.0)
    root = gain[:, None, None] * (empty[:, 1:] * used[:, None])
    own = np.broadcast_to(np.eye(2), (len(frames), 2, 2))
    lower = np.linalg.qr(np.concatenate([root, own], axis=2).transpose(0, 2, 1), mode="r")
    pull = np.linalg.solve(np.asarray(lower).transpose(0, 2, 1), off[:, :, None])
    return np.asarray(np.square(pull[:, :, 0]).sum(axis=1))
