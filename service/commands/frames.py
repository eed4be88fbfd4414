"""Frames for a command, with what must be said of them on standard error."""

import argparse
from pathlib import Path

from service.bad_rows import with_saturated_rows
from service.checked_system import checked_frames
from service.commands.command import note
from service.commands.files import naming, read_document, read_table, source
from service.frame_table import FrameTable
from service.plausibility import doubts
from service.system_description import SystemDescription
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["checked", "checked_whole"]

# a file of a thousand bad rows is described by its first
_SAID = 5


def checked(args: argparse.Namespace) -> tuple[Sensor, Scene, Frames, FrameTable]:
    """Read a scene file and frames, and check them against one another.

    Parameters
    ----------
    args : argparse.Namespace
        With ``frames``, ``scene`` and ``quiet``.

    Returns
    -------
    (Sensor, Scene, Frames, FrameTable)
        The frames are those of the good rows; the table says which are bad.

    Raises
    ------
    InvalidInputError, MalformedError, RefusedError, OSError
        Naming the file.
    """
    system = read_document(SystemDescription, args.scene)
    table = read_table(args.frames)
    _say(args, args.frames, table)
    with naming({"/frames": source(args.frames), "": str(args.scene)}):
        sensor, scene, frames = checked_frames(system.sensor, system.scene, table.columns)
    for doubt in doubts(sensor, frames):
        note(args, f"note: {doubt}")
    return sensor, scene, frames, table


def checked_whole(args: argparse.Namespace) -> tuple[Sensor, Scene, Frames]:
    """Do the same as `checked`, with bad rows as frames that are saturated."""
    sensor, scene, frames, table = checked(args)
    sensor, frames = with_saturated_rows(sensor, frames, table.bad)
    return sensor, scene, frames


def _say(args: argparse.Namespace, path: Path, table: FrameTable) -> None:
    name = source(path)
    if table.ignored:
        note(args, f"note: {name}: ignored, since they are no columns: {', '.join(table.ignored)}")
    for row in table.bad[:_SAID]:
        note(args, f"note: {name}: {row}; the frame has no range")
    if len(table.bad) > _SAID:
        note(args, f"note: {name}: {len(table.bad) - _SAID} more rows cannot be read")
