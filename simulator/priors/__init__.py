"""Priors of the scene language: one class a form, and here the registry of all of them.

A prior is a frozen model with its word in ``prior``, its numbers, and ``distribution()``. A new one
is its class in a file of this folder, and its name in `Prior`.
"""

from typing import Annotated, get_args

import pydantic

from simulator.priors.distribution import LEAST_LOG_MASS, Distribution, RangeForm
from simulator.priors.normal import (
    HalfNormal,
    LogNormal,
    Normal,
    NormalDistribution,
    TruncatedNormal,
)
from simulator.priors.uniform import LogUniform, Uniform, UniformDistribution

__all__ = [
    "LEAST_LOG_MASS",
    "PRIORS",
    "Distribution",
    "HalfNormal",
    "LogNormal",
    "LogUniform",
    "Normal",
    "NormalDistribution",
    "Prior",
    "RangeForm",
    "TruncatedNormal",
    "Uniform",
    "UniformDistribution",
]

Prior = Annotated[
    Uniform | LogUniform | Normal | HalfNormal | LogNormal | TruncatedNormal,
    pydantic.Field(discriminator="prior"),
]

PRIORS: tuple[type, ...] = get_args(get_args(Prior)[0])
