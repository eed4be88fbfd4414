"""Nuisance parameters: a centre of what is not the range, and independent directions around it."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.posterior import Posterior
from inference.tracking.remedies import remedy
from simulator.errors import InvalidInputError, RefusedError, listed
from simulator.parameters import Parameters, Terms
from simulator.scene import Scene
from simulator.sensor_unknowns import GAIN

__all__ = ["Nuisance", "nuisance_of"]

Array = NDArray[np.float64]

_FEWEST_DRAWS = 20  # a direction


@dataclasses.dataclass(frozen=True, eq=False)
class Nuisance:
    """What is known of the unknowns: a normal in the coordinates in which their prior is normal."""

    centre: Terms  # physical values at its mean
    # one standard deviation away on either side along each principal direction. The readings'
    # change with a direction is taken as a secant between the two, which feels the curvature
    plus: tuple[Terms, ...]
    minus: tuple[Terms, ...]
    # unknowns of object and gain whose priors are all that is known: the last directions are theirs
    carried: tuple[str, ...] = ()


def nuisance_of(
    scene: Scene,
    parameters: Parameters,
    posterior: Posterior | Array | None,
    learnt: tuple[str, ...],
) -> Nuisance:
    """Summarise what is known of the unknowns.

    Parameters
    ----------
    scene : Scene
        The scene.
    parameters : Parameters
        The scene's unknowns.
    posterior : Posterior or ndarray, shape (draws, d), optional
        Draws in SI units in the order of ``parameters.names``, or a posterior of this scene. Left
        out, the scene's joint law is what is known, and the priors of object and gain.
    learnt : tuple of str
        Unknowns that need no posterior.

    Raises
    ------
    InvalidInputError
        Where the draws are not finite, too few, or of another scene.
    RefusedError
        Where there is no posterior, and others than the object and the gain are unknown.
    """
    names = parameters.names
    told = () if parameters.law is None else parameters.law.names
    free = [name for name in names if name not in (*learnt, *told) and "range_m." not in name]
    origin = np.zeros(len(names))
    if posterior is None:
        others = [n for n in free if not n.startswith("object.") and n != GAIN]
        if others:
            raise RefusedError(
                f"{listed(others)} unknown: a tracker takes priors of the object, the gain and the "
                f"crosstalk, and needs numbers or a posterior of all else; {remedy(scene, others)}"
            )
        steps = np.eye(len(names))[[names.index(name) for name in (*told, *free)]]
        near = parameters.natural(np.concatenate([origin[None], steps, -steps]))
        if not np.isfinite(near).all():
            raise RefusedError(
                "the scene's joint law reaches beyond what can be computed with; calibrate with "
                "frames that tell more of its unknowns"
            )
        return _around(parameters, origin, steps, tuple(free))
    draws = _draws(parameters, posterior)
    with np.errstate(all="ignore"):
        z = parameters.standard(draws)
    if not np.isfinite(z).all():
        raise InvalidInputError.at("/posterior", "holds draws outside the scene's priors")
    centre = z.mean(axis=0)
    _, sizes, directions = np.linalg.svd(z - centre, full_matrices=False)
    roots = directions * (sizes / np.sqrt(len(z) - 1.0))[:, None]
    roots = roots[sizes > 1e-12 * sizes.max(initial=0.0)]
    return _around(parameters, centre, roots)


def _around(
    parameters: Parameters, centre: Array, roots: Array, carried: tuple[str, ...] = ()
) -> Nuisance:
    return Nuisance(
        parameters.terms(centre[None]),
        tuple(parameters.terms((centre + root)[None]) for root in roots),
        tuple(parameters.terms((centre - root)[None]) for root in roots),
        carried,
    )


def _draws(parameters: Parameters, posterior: Posterior | Array) -> Array:
    """Check draws and bring them into shape (n, d)."""
    names = parameters.names
    if isinstance(posterior, Posterior):
        if posterior.draws.names != names:
            raise InvalidInputError.at(
                "/posterior",
                f"is of {', '.join(posterior.draws.names)}, the scene's unknowns are "
                f"{', '.join(names) or 'none'}",
            )
        draws = posterior.draws.parameters.reshape(-1, len(names))
    else:
        draws = np.asarray(posterior, dtype=np.float64)
    if draws.ndim != 2 or draws.shape[1] != len(names):
        raise InvalidInputError.at(
            "/posterior", f"must have a column for each of {', '.join(names) or 'no unknowns'}"
        )
    if len(draws) < _FEWEST_DRAWS * max(len(names), 1):
        wanted = _FEWEST_DRAWS * max(len(names), 1)
        raise InvalidInputError.at("/posterior", f"holds {len(draws)} draws, needs {wanted}")
    if not np.isfinite(draws).all():
        raise InvalidInputError.at("/posterior", "holds draws that are not finite")
    return draws
