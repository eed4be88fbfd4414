"""Every technique that answers at once, of single frames and of many, by its name."""

from collections.abc import Mapping
from types import MappingProxyType

from inference.fits.techniques.registry import FITS
from inference.realtime.registry import TECHNIQUES
from inference.technique import Technique

__all__ = ["ALL_TECHNIQUES", "ELSEWHERE"]

ALL_TECHNIQUES: Mapping[str, Technique] = MappingProxyType({**TECHNIQUES, **FITS})

# techniques that are not answered at once, and why they are left out
ELSEWHERE: Mapping[str, str] = MappingProxyType(
    {
        "posterior": "is sampled, not solved in real time: ask for a posterior",
    }
)
