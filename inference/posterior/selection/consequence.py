"""What leaving an optional term out would do to what is reported.

A superfluous term costs width, and leaving a real one out makes a confident error. Evidence cannot
tell the two apart where a term is of the size of the noise: it leaves out what the data do not
demand, though ranges far away hang on it. So a term goes only where its going changes no answer.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.selection.evidence import Weighed

__all__ = ["Consequence", "Reported", "consequence", "reported"]

Array = NDArray[np.float64]

# of the standard deviation of the model with the term: a 90 % interval that is moved by 0.3 of its
# sd still holds the truth in 88 %, and one that is shrunk by a third in 73 %
MOST_MOVED = 0.3
MOST_SHRUNK = 1.0 / 3.0
_DRAWS = 1000  # a mean is right to 0.03 of a standard deviation, a width to 4 %
_MOST_EVALUATIONS = 60_000  # of a frame, above which fewer draws do
_LEAST_DRAWS = 100


@dataclasses.dataclass(frozen=True, eq=False)
class Reported:
    """What a model says of its unknowns and of all ranges.

    Attributes
    ----------
    names : tuple of str
        Its unknowns, d of them.
    mean, sd : ndarray, shape (d + usable frames,)
        Of the unknowns in SI units, then of the ranges [m]; nan for a frame without object.
    low, high : ndarray, shape (d + usable frames,)
        Ends of the 90 % intervals.
    """

    names: tuple[str, ...]
    mean: Array
    sd: Array
    low: Array
    high: Array

    def of(self, names: tuple[str, ...]) -> Array:
        """Return some of the unknowns and all ranges, as rows of mean, sd, low and high."""
        d = len(self.names)
        frames = np.arange(d, self.mean.size)
        chosen = np.concatenate([[self.names.index(name) for name in names], frames]).astype(int)
        return np.array([self.mean, self.sd, self.low, self.high])[:, chosen]


def reported(
    density: CollapsedDensity, weighed: Weighed, rng: np.random.Generator
) -> Reported | None:
    """Summarise the draws behind a model's evidence.

    Parameters
    ----------
    weighed : Weighed
        Its evidence and draws.

    Returns
    -------
    Reported or None
        None where no parameters explain the frames.
    """
    if not np.isfinite(weighed.evidence.log_evidence) or not len(weighed.z):
        return None
    most = max(_MOST_EVALUATIONS // len(density.frames), _LEAST_DRAWS)
    weights = scipy.special.softmax(weighed.log_weights)
    z = weighed.z[rng.choice(len(weighed.z), size=min(_DRAWS, most), p=weights)]
    values = np.concatenate(
        [density.parameters.natural(z), np.exp(density.draw_log_ranges(z, rng))], axis=1
    )
    low, high = np.quantile(values, [0.05, 0.95], axis=0)
    mean, sd = values.mean(axis=0), values.std(axis=0, ddof=1)
    return Reported(density.parameters.names, mean, sd, low, high)


@dataclasses.dataclass(frozen=True)
class Consequence:
    """What changes where a term is left out.

    Attributes
    ----------
    moved : float
        By how many standard deviations of the model with the term the mean moves that moves most.
    which_moved : str
        Which one that is.
    shrunk : float
        By what share of its width the 90 % interval shrinks that shrinks most.
    which_shrunk : str
        Which one that is.
    """

    moved: float
    which_moved: str
    shrunk: float
    which_shrunk: str

    @property
    def harmless(self) -> bool:
        """Whether the term may be left out."""
        return self.moved <= MOST_MOVED and self.shrunk <= MOST_SHRUNK

    @property
    def words(self) -> str:
        """What changes, in words."""
        return (
            f"without it {self.which_moved} moves by {self.moved:.2g} of its standard deviations "
            f"(at most {MOST_MOVED:g} is allowed), and the interval of {self.which_shrunk} "
            f"shrinks by {max(self.shrunk, 0.0):.0%} (at most {MOST_SHRUNK:.0%})"
        )


def consequence(larger: Reported | None, smaller: Reported | None) -> Consequence | None:
    """Tell what changes between a model with a term and one without it.

    Parameters
    ----------
    larger, smaller : Reported or None
        Of the models.

    Returns
    -------
    Consequence or None
        None where one of them says nothing: the evidence then decides.
    """
    if larger is None or smaller is None:
        return None
    names = tuple(name for name in smaller.names if name in larger.names)
    mean, sd, low, high = larger.of(names)
    other_mean, _, other_low, other_high = smaller.of(names)
    known = np.isfinite(mean) & (sd > 0)
    if not known.any():
        return None
    moved, shrunk = np.zeros(mean.size), np.zeros(mean.size)
    np.divide(np.abs(other_mean - mean), sd, out=moved, where=known)
    np.divide(other_high - other_low, high - low, out=shrunk, where=known)
    shrunk = np.where(known, 1.0 - shrunk, -np.inf)
    labels = (*names, *(f"the range of usable frame {k}" for k in range(mean.size - len(names))))
    first, second = int(np.argmax(moved)), int(np.argmax(shrunk))
    return Consequence(float(moved[first]), labels[first], float(shrunk[second]), labels[second])
