"""``hybridtof track``: one answer a frame, as soon as the frame is read."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from inference.tracking.settings import TrackingSettings
    from service.streams.followers import Follower
    from simulator.scene import Scene
    from simulator.sensor import Sensor

from service.commands.command import FRAMES_HELP, Subparsers, add_command, note

__all__ = ["add_parser"]

LAG = 300

# of few answers: they are not read for it otherwise
_SUPPOSES = b'"assumptions":['


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
            hybridtof track frames.ndjson --scene priors.json --calibrate --seed 7
        """,
    )
    parser.add_argument("frames", type=Path, help=FRAMES_HELP)
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene, and "
        "optionally tracking: settings of the tracker"
    )  # fmt: skip
    parser.add_argument(
        "--calibrate", action="store_true", help="learn the scene from the frames themselves, and "
        "anew where it has changed; frames wait while a posterior is computed"
    )  # fmt: skip
    parser.add_argument("--seed", type=int, help="of the calibrations (default: 0)")
    parser.add_argument(
        "--lag", type=int, help="how many numbers after the frame that a calibration was asked at "
        f"it applies (default: {LAG})"
    )  # fmt: skip
    parser.add_argument(
        "--replay", type=Path, help="answers of a stream, or what GET said of it: calibrations "
        "apply where they did there"
    )  # fmt: skip


def _follower(
    args: argparse.Namespace, sensor: "Sensor", scene: "Scene", settings: "TrackingSettings"
) -> "Follower":
    """Return what follows the stream."""
    from inference.self_calibration.plan import plan_of
    from inference.tracking.tracker import tracker
    from service.commands.files import reading
    from service.streams.calibrated_here import (
        concluding_as_before,
        concluding_at_once,
        events_in,
    )
    from service.streams.followers import Calibrating, Plain
    from simulator.errors import InvalidInputError

    if not args.calibrate:
        for name in ("seed", "lag", "replay"):
            if getattr(args, name) is not None:
                raise InvalidInputError.at(f"--{name}", "is of calibrations: needs --calibrate")
        return Plain(tracker(sensor, scene, settings))
    lag = LAG if args.lag is None else args.lag
    if lag < 1:
        raise InvalidInputError.at("--lag", "must be 1 or more")
    if not 0 <= (args.seed or 0) < 2**53:
        raise InvalidInputError.at("--seed", "must be an integer from 0 to 2^53 - 1")
    plan = plan_of(sensor, scene, settings, args.seed or 0)
    if args.replay is None:
        return Calibrating.of(plan, concluding_at_once(plan, lag))
    with reading(args.replay):
        events = events_in(args.replay)
    return Calibrating.of(plan, concluding_as_before(plan, events))


def _run(args: argparse.Namespace) -> int:
    import json
    import time

    from service.checked_system import checked_system
    from service.commands.files import naming, open_lines, read_document, reading
    from service.commands.output import write_result
    from service.frame_files import no_frame
    from service.plausibility import doubts
    from service.requests import TrackedSystem
    from service.streams.forms import Form, form_like
    from service.streams.kept import Kept
    from service.streams.lines import Line, Place
    from service.streams.taking import take

    stated = read_document(TrackedSystem, args.scene)
    names = {"/settings": f"{args.scene}#/tracking", "/calibrate": "--calibrate"}
    own = {name: name for name in ("--seed", "--lag", "--replay")}
    with naming(names | own | {"": str(args.scene)}):
        sensor, scene = checked_system(stated.sensor, stated.scene)
        follower = _follower(args, sensor, scene, stated.tracking)
    for doubt in doubts(sensor):
        note(args, f"note: {doubt}")
    place, kept, taken_in, repeated = Place(follower.first), Kept(), 0, 0
    with reading(args.frames), open_lines(args.frames) as lines:
        form: Form | None = None
        for line in lines:
            if not line.strip():
                continue
            if form is None:
                form, is_frame = form_like(line)
                if not is_frame:
                    continue
            taken = take(follower, place, [Line(line, time.perf_counter())], form, kept)
            kept.add(taken)
            place = taken.place
            taken_in, repeated = taken_in + 1, repeated + taken.repeated
            write_result(taken.answers[0])
            if _SUPPOSES in taken.answers[0]:
                for supposed in json.loads(taken.answers[0]).get("assumptions", ()):
                    note(args, f"note: {supposed}")
        if not taken_in:
            raise no_frame(args.frames.suffix, header=form is not None)
    if repeated:
        note(args, f"note: lines whose sequence was answered before: {repeated}")
    if place.errors:
        note(args, f"note: lines that are no frames: {place.errors}; their answers have an `error`")
    if place.misfit:
        note(args, "note: misfit at the end: the readings are not as sensor and scene say")
    # of a stream in which no line is a frame nothing was answered
    return 0 if place.answered else 2
