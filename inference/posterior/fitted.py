"""Optima of the fit over all frames as starting points of a posterior.

The fit (`inference.fits`) knows no priors, but its multistart guesses ranges as well as
unknowns and finds its way where the readings lie a million times above their noise: the screen of
the prior then sees only false valleys, which can lie thousands of nats below the true one.
"""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.fits.likelihood.levenberg_marquardt import levenberg_marquardt
from inference.fits.likelihood.multistart import EASY, find_maxima
from inference.fits.likelihood.problem import fit_problem
from inference.fits.likelihood.profile_slopes import profile_slopes
from inference.fits.likelihood.screen import screen
from inference.frame.blocks import DISPLACEMENT, DISPLACEMENT_RATE
from inference.posterior.job import Job
from inference.posterior.sampling.start import Optimum, climb, refine, roughly
from simulator.compiled import at_once, soon
from simulator.parameters import OFFSET
from simulator.sensor_unknowns import TIMING

__all__ = ["fitted_optima"]

Array = NDArray[np.float64]

_MOST = 3
_DEVIANCE = 100.0  # above the best: what priors could make up for
_FARTHEST = 6.0  # standard deviations of a prior at which a climb starts


def fitted_optima(job: Job, density: CollapsedDensity, *, brief: bool = False) -> list[Optimum]:
    """Find maxima of the collapsed density from the optima of the fit over all frames.

    Parameters
    ----------
    job : Job
        What was read, by what, of what.
    density : CollapsedDensity
        Of the same.
    brief : bool
        Whether one search of the fit is enough, and rough shapes: for what climbs on from there.

    Returns
    -------
    list of Optimum
        Not sorted, some of them perhaps the same; empty where the fit has other unknowns, as for an
        object at rest or ranges whose law is unknown, and of a sensor that fits do not take.
    """
    names = tuple(name for name in density.parameters.names if name != OFFSET)
    sensor = job.sensor
    # a pulse that comes late, even by a known time, has other equations than the fit's
    beyond = sensor.unknown or sensor.temperature is not None or TIMING in sensor.quantities
    if job.scene.motion != "radial" or beyond:
        return []
    problem = fit_problem(job.sensor, job.scene, job.frames.select(job.usable))
    if problem.names != names:
        return []
    # with terms beside the object a start takes hundreds of steps, and with several thousands
    many = len(problem) > EASY
    kernels = screen, levenberg_marquardt, profile_slopes
    with at_once(*kernels) if many else soon(levenberg_marquardt):
        fits = find_maxima(problem, 0) if brief else find_maxima(problem)
    finish = roughly if brief else refine
    found = []
    for fit in fits[:_MOST]:
        if not fit.deviance < fits[0].deviance + _DEVIANCE:
            break
        natural = problem.natural(fit.x)
        if len(names) < len(density.parameters):
            natural = np.append(natural, _offset(density.frames, fit.positions))
        z = density.parameters.standard(natural[None])[0]
        start = np.clip(np.nan_to_num(z), -_FARTHEST, _FARTHEST)
        found.append(finish(density, climb(density, start)[0]))
    return [optimum for optimum in found if optimum is not None]


def _offset(frames: Array, log_r: Array) -> float:
    """Return the offset of displacements at given ranges."""
    moved = (frames[:, DISPLACEMENT_RATE] > 0) & np.isfinite(log_r)
    offsets = (np.exp(log_r) - frames[:, DISPLACEMENT])[moved]
    return float(np.median(offsets)) if offsets.size else 0.0
