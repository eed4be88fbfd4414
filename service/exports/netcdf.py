"""Draws as NetCDF 4 in the groups that ArviZ reads (its InferenceData schema).

One chain an ensemble: its walkers propose from one another, so that they are no chains of their
own. The draws of a chain are lined up walker by walker, each step by step; coordinates ``walker``
and ``step`` tell which is which. Ranges, replicated readings and log likelihoods of frames belong
to some of the draws: their ``draw`` coordinate names them.
"""

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.exports.described import DescribedDraws, unit_of
from service.exports.export import Export

__all__ = ["EXPORT", "to_netcdf"]


def to_netcdf(described: DescribedDraws) -> bytes:
    """Write draws as NetCDF.

    Returns
    -------
    bytes
        A file with the groups ``posterior``, ``sample_stats`` (``lp``, ``accepted``, ``mode``),
        ``posterior_predictive`` (replicated readings, and ``range_m`` at which they were made),
        ``log_likelihood``, ``observed_data`` and ``constant_data``.
    """
    # imported where it is needed: a service that never exports starts without HDF5
    import h5netcdf

    draws = described.draws
    _, walkers, steps = draws.log_density.shape
    walker, step = (index.ravel() for index in np.mgrid[:walkers, :steps])
    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        file.attrs.update(described.attributes)
        posterior = _group(file, "posterior", described)
        _coordinates(posterior, draws.log_density.shape[0], walker, draws.step[step])
        for j, name in enumerate(draws.names):
            values = draws.parameters[..., j]
            _per_draw(posterior, name, values, units=unit_of(name), long_name=name)
        stats = _group(file, "sample_stats", described)
        _coordinates(stats, draws.log_density.shape[0], walker, draws.step[step])
        _per_draw(
            stats,
            "lp",
            draws.log_density,
            units="1",
            long_name="log posterior density of the prior's normal coordinates, ranges integrated "
            "out",
        )
        _per_draw(stats, "accepted", draws.accepted.astype(np.int8), long_name="walker moved")
        _per_draw(
            stats, "mode", draws.mode.astype(np.int32), long_name="index of the optimum it is near"
        )
        thinned = np.zeros((walkers, steps), dtype=bool)
        thinned[:, draws.thinned] = True
        subset = np.flatnonzero(thinned.ravel())
        for name in ("posterior_predictive", "log_likelihood"):
            group = _group(file, name, described)
            _coordinates(
                group,
                draws.log_density.shape[0],
                walker[subset],
                draws.step[step[subset]],
                subset,
            )
            _frames(group, described)
            if name == "log_likelihood":
                values = draws.log_likelihood[..., described.frames]
                _per_draw(group, "readings", values, units="1", long_name="both readings together")
                continue
            for k, column in enumerate(described.columns):
                values = draws.readings[..., described.frames, k]
                _per_draw(group, column, values, units="reading", long_name="replicated reading")
            _per_draw(
                group,
                "range_m",
                draws.range_m[..., described.frames],
                units="m",
                long_name="range of the object given the parameters and the readings",
            )
        observed = _group(file, "observed_data", described)
        _frames(observed, described)
        for k, column in enumerate(described.columns):
            _variable(observed, column, ("frame",), described.readings[:, k], units="reading")
        if described.columns_of_frames:
            constant = _group(file, "constant_data", described)
            _frames(constant, described)
            for name, column_values in described.columns_of_frames.items():
                numbers = np.asarray(column_values)
                numbers = numbers.astype(np.int8) if numbers.dtype == bool else numbers
                _variable(constant, name, ("frame",), numbers)
    return buffer.getvalue()


def _group(file: Any, name: str, described: DescribedDraws) -> Any:
    group = file.create_group(name)
    group.attrs.update(described.attributes)
    return group


def _variable(
    group: Any, name: str, dimensions: tuple[str, ...], values: NDArray[Any], **attributes: str
) -> None:
    variable = group.create_variable(name, dimensions, values.dtype, data=values)
    variable.attrs.update(attributes)


def _coordinates(
    group: Any,
    ensembles: int,
    walker: NDArray[np.intp],
    step: NDArray[np.intp],
    draw: NDArray[np.intp] | None = None,
) -> None:
    number = np.arange(walker.size) if draw is None else draw
    group.dimensions.update({"chain": ensembles, "draw": walker.size})
    _variable(group, "chain", ("chain",), np.arange(ensembles), long_name="ensemble")
    _variable(group, "draw", ("draw",), number, long_name="walker * steps + step")
    _variable(group, "walker", ("draw",), walker)
    _variable(group, "step", ("draw",), step, long_name="step, the burn-in counted")


def _frames(group: Any, described: DescribedDraws) -> None:
    group.dimensions["frame"] = described.frames.size
    _variable(group, "frame", ("frame",), described.frames, long_name="index of the frame, from 0")


def _per_draw(group: Any, name: str, values: NDArray[Any], **attributes: str) -> None:
    """Write values of shape (ensembles, walkers, steps, ...)."""
    ensembles, walkers, steps, *more = values.shape
    flat = values.reshape(ensembles, walkers * steps, *more)
    dimensions = ("chain", "draw", "frame")[: flat.ndim]
    # makes coordinates, not data, of walker and step (CF conventions, 5)
    _variable(group, name, dimensions, flat, coordinates="walker step", **attributes)


EXPORT = Export("application/x-netcdf", ".nc", to_netcdf)
