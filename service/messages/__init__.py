"""Ranges as messages of other systems: one file a message; a new one is a file and a line here."""

from service.messages import distance_sensor, ros_range
from service.messages.message import Message

__all__ = ["MESSAGES"]

MESSAGES: tuple[Message, ...] = (
    ros_range.MESSAGE,
    distance_sensor.MESSAGE,
)
