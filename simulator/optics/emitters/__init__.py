"""Light sources: radiant intensity against the angle from the aim, normalised to the power.

2 pi int I_e(alpha) sin(alpha) d alpha = Phi0 over the front hemisphere (2.11); no cosine of the
emitter is part of the kernel, it lives in I_e (docs/model.md, conventions).

A pattern is a file: its model, and its kernel. `intensity` holds the registry.
"""

from simulator.optics.emitters.cosine_power import CosinePower, lambertian
from simulator.optics.emitters.emitter import Emitter
from simulator.optics.emitters.intensity import PATTERNS, Pattern, intensity, radiant_intensity
from simulator.optics.emitters.linear import Linear
from simulator.optics.emitters.narrow import Narrow
from simulator.optics.emitters.raised_cosine import RaisedCosine
from simulator.optics.emitters.table import Table
from simulator.optics.emitters.uniform import Uniform

__all__ = [
    "PATTERNS",
    "CosinePower",
    "Emitter",
    "Linear",
    "Narrow",
    "Pattern",
    "RaisedCosine",
    "Table",
    "Uniform",
    "intensity",
    "lambertian",
    "radiant_intensity",
]
