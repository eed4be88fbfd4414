"""Every technique of many frames by its name in the contract."""

from collections.abc import Mapping
from types import MappingProxyType

from inference.multiframe.joint_fit import (
    ITERATIVE_BACKGROUND_CANCELLING,
    ITERATIVE_DIFFERENTIAL,
    JOINT_FIT,
)
from inference.realtime.technique import Technique

__all__ = ["MULTIFRAME"]

MULTIFRAME: Mapping[str, Technique] = MappingProxyType(
    {
        technique.name: technique
        for technique in (JOINT_FIT, ITERATIVE_DIFFERENTIAL, ITERATIVE_BACKGROUND_CANCELLING)
    }
)
