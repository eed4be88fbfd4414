"""Sensors' registers as frames: one file a sensor; a new one is a file and a line here."""

from service.adapters import afbr_s50, isl29501, opt3101, tmf882x
from service.adapters.adapter import Adapter

__all__ = ["ADAPTERS"]

ADAPTERS: tuple[Adapter, ...] = (
    isl29501.ADAPTER,
    opt3101.ADAPTER,
    afbr_s50.ADAPTER,
    tmf882x.ADAPTER,
)
