"""``hybridtof track``: one answer a frame, as soon as the frame is read."""

import argparse
from pathlib import Path

from service.commands.command import FRAMES_HELP, Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "track",
        _run,
        brief="track one object through a stream of frames",
        description="Track one object and print one JSON object a frame, at once: the range, its "
        "hypotheses, and whether an object is there. Frames need time_s. A line that cannot be "
        "read is answered by an error and changes nothing.",
        examples="""
            hybridtof track frames.csv --scene scene.json > tracked.ndjson
            sensor-reader | hybridtof track - --scene scene.json
        """,
    )
    parser.add_argument("frames", type=Path, help=FRAMES_HELP)
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene, and "
        "optionally tracking: settings of the tracker"
    )  # fmt: skip


def _run(args: argparse.Namespace) -> int:
    import time

    from inference.tracking.tracker import tracker
    from service.checked_system import checked_system
    from service.commands.files import naming, open_lines, read_document, reading
    from service.commands.output import write_result
    from service.plausibility import doubts
    from service.requests import TrackedSystem
    from service.streams.forms import Form, form_like
    from service.streams.kept import Kept
    from service.streams.lines import Line, Place
    from service.streams.taking import take

    stated = read_document(TrackedSystem, args.scene)
    with naming({"/settings": f"{args.scene}#/tracking", "": str(args.scene)}):
        sensor, scene = checked_system(stated.sensor, stated.scene)
        model = tracker(sensor, scene, stated.tracking)
    for doubt in doubts(sensor):
        note(args, f"note: {doubt}")
    place, kept = Place(model.first), Kept()
    with reading(args.frames), open_lines(args.frames) as lines:
        form: Form | None = None
        for line in lines:
            if not line.strip():
                continue
            if form is None:
                form, is_frame = form_like(line)
                if not is_frame:
                    continue
            taken = take(model, place, [Line(line, time.perf_counter())], form, kept)
            kept.add(taken)
            place = taken.place
            write_result(taken.answers[0])
    # of a stream in which no line is a frame nothing was answered
    return 0 if place.answered else 2
