"""The coordinates that a map is fitted in: those in which a scene's thin sheets are straight."""

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.flux_coordinate import FluxCoordinate, flux_coordinate_of
from inference.posterior.sampling.light_at_rest import LightAtRest, light_at_rest
from inference.posterior.sampling.reparametrisation import Reparametrisation, reparametrisation_of

__all__ = ["Coordinates", "coordinates_of"]

Coordinates = FluxCoordinate | LightAtRest | Reparametrisation


def coordinates_of(density: CollapsedDensity) -> Coordinates | None:
    """Return coordinates that a map is fitted in.

    Parameters
    ----------
    density : CollapsedDensity
        Its unknowns, its frames and the sensor.

    Returns
    -------
    FluxCoordinate, LightAtRest, Reparametrisation or None
        With the flux where c2 and c0 are unknown with independent priors, and there with the whole
        light of an object at one known range before unknown crosstalk; else with the static light
        where crosstalk and a background are confounded; None for z itself.
    """
    before = reparametrisation_of(density)
    flux = flux_coordinate_of(density, before)
    if flux is None:
        return before
    return light_at_rest(density, flux) or flux
