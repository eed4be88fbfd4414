"""Every real-time technique by its name."""

from collections.abc import Mapping
from types import MappingProxyType

from inference.realtime.techniques.background_cancelling import BACKGROUND_CANCELLING
from inference.realtime.techniques.background_cancelling_differential import (
    BACKGROUND_CANCELLING_DIFFERENTIAL,
)
from inference.realtime.techniques.background_intensity import BACKGROUND_INTENSITY
from inference.realtime.techniques.conventional import CONVENTIONAL
from inference.realtime.techniques.differential import DIFFERENTIAL
from inference.realtime.techniques.intensity import INTENSITY
from inference.realtime.techniques.intensity_w1 import INTENSITY_W1
from inference.technique import Technique

__all__ = ["TECHNIQUES"]

TECHNIQUES: Mapping[str, Technique] = MappingProxyType(
    {
        technique.name: technique
        for technique in (
            CONVENTIONAL,
            INTENSITY,
            INTENSITY_W1,
            DIFFERENTIAL,
            BACKGROUND_CANCELLING,
            BACKGROUND_INTENSITY,
            BACKGROUND_CANCELLING_DIFFERENTIAL,
        )
    }
)
