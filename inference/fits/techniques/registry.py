"""Every technique of many frames by its name."""

from collections.abc import Mapping
from types import MappingProxyType

from inference.fits.techniques.crosstalk_fit import CROSSTALK_FIT
from inference.fits.techniques.joint_fit import (
    ITERATIVE_BACKGROUND_CANCELLING,
    ITERATIVE_DIFFERENTIAL,
    JOINT_FIT,
)
from inference.fits.techniques.object_fit import OBJECT_FIT
from inference.fits.techniques.shadow_fit import SHADOW_FIT
from inference.technique import Technique

__all__ = ["FITS"]

FITS: Mapping[str, Technique] = MappingProxyType(
    {
        technique.name: technique
        for technique in (
            OBJECT_FIT,
            CROSSTALK_FIT,
            SHADOW_FIT,
            JOINT_FIT,
            ITERATIVE_DIFFERENTIAL,
            ITERATIVE_BACKGROUND_CANCELLING,
        )
    }
)
