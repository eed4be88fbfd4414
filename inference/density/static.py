"""The collapsed density of an object that does not move: one range for all frames."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.common_range import integrate_common_range
from simulator.parameters import Terms

__all__ = ["StaticDensity", "with_common_range"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class StaticDensity(CollapsedDensity):
    """log p(z | frames), the one range of all frames integrated out."""

    def _integrate(
        self, terms: Terms, frames: Array, uniforms: Array | None = None
    ) -> tuple[Array, Array]:
        """Return joint log likelihoods, shape (n,), and tops (`integrate_common_range`)."""
        n = terms.object.shape[0]
        out, tops = np.empty(n), np.empty((n, 4))
        arguments = self.arguments(terms)
        present = self.holds
        split: list[Any] = [frames[present], frames[~present]]
        everything: list[Any] = [uniforms, *arguments[:4], *split, *arguments[6:]]
        integrate_common_range(out, tops, *everything)
        return out, tops

    @property
    def holds(self) -> NDArray[np.bool_]:
        """Which frames may hold the object, shape (frames,)."""
        return np.ones(len(self.frames), dtype=bool) if self.present is None else self.present

    def _of_terms(self, terms: Terms) -> Array:
        # equal shares: the frames are not independent given the parameters
        value = self._integrate(terms, self.frames)[0]
        n = len(self.frames)
        return np.repeat(value[:, None] / n, n, axis=1)

    def paired_log_likelihood(self, z: Array, readings: Array) -> Array:
        """Return log p(readings_i | z_i) for readings of shape (n, frames, 2), shape (n,)."""
        out = np.empty(len(z))
        frames = self.frames.copy()
        for i in range(len(z)):
            frames[:, :2] = readings[i]
            out[i] = self._integrate(self.parameters.terms(z[i : i + 1]), frames)[0][0]
        return out

    def best(self, z: Array) -> Array:
        """Find the best common range (`inference.density.profile.best_ranges`)."""
        tops = self._integrate(self.parameters.terms(z), self.frames)[1]
        n = len(self.frames)
        found = np.repeat(tops[:, None, :3], n, axis=1)
        found[:, :, 1] /= n
        found[:, ~self.holds, 0] = found[:, ~self.holds, 2] = np.nan
        return found

    def draw_log_ranges(self, z: Array, rng: np.random.Generator) -> Array:
        """Draw the common range given each z (`inference.posterior.answer.ranges.draw_ranges`)."""
        uniforms = rng.random((len(z), 2))
        tops = self._integrate(self.parameters.terms(z), self.frames, uniforms)[1]
        return np.where(self.holds, tops[:, 3:], np.nan)


def with_common_range(density: CollapsedDensity) -> StaticDensity:
    """Return the density of the same frames with one range for all of them."""
    parts: dict[str, Any] = {
        field.name: getattr(density, field.name) for field in dataclasses.fields(CollapsedDensity)
    }
    return StaticDensity(**parts)
