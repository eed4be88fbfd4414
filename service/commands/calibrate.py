"""``hybridtof calibrate``: a scene file of what the frames in a file tell."""

import argparse
import json
from datetime import UTC, datetime
from pathlib import Path

from service.commands.command import Subparsers, add_command, note
from service.commands.infer import (
    add_posterior_arguments,
    exit_code_of,
    posterior_of,
    settings_of,
)

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "calibrate",
        _run,
        brief="learn a scene from frames, for all frames to come",
        description="Sample the posterior as `infer` does, and write what it knows as a scene "
        "file, which every other command and every request takes. Frames without the object, and "
        "of one over a wide stroke, are what it takes. The file is written as a whole or not at "
        "all. A posterior that has not converged is written too, and the exit code is 3; it is "
        "refused wherever a scene is used, and so is one whose model does not fit, until "
        "`scene.calibration.accept` has the word that the refusal names.",
        examples="""
            hybridtof calibrate frames.csv --scene scene.json --output calibrated.json
            hybridtof estimate more.csv --scene calibrated.json
        """,
    )
    add_posterior_arguments(parser)
    parser.add_argument(
        "--output", type=Path, required=True, help="write the calibrated scene file here (.json)"
    )
    parser.add_argument(
        "--other-objects",
        action="store_true",
        help="for other objects to come: keep nothing of this one, nor of its shadow",
    )


def _run(args: argparse.Namespace) -> int:
    from inference.posterior.calibrated import refuse_known_object
    from service.commands.files import check_folder
    from service.commands.frames import checked_whole
    from service.plausibility import doubts
    from service.whole_files import write_whole
    from simulator.parameters import parameters_of

    check_folder("--output", args.output)
    system = checked_whole(args)
    if args.other_objects:  # before minutes of sampling
        refuse_known_object(parameters_of(system[0], system[1]).names)
    settings = settings_of(args)
    date = datetime.now(UTC).isoformat(timespec="seconds")
    record, document = posterior_of(
        args,
        system,
        settings,
        lambda jobs, done: jobs.ended.scene(done.id, date, other_objects=args.other_objects),
    )
    if document is not None:
        write_whole(args.output, document + b"\n", private=False)
        for line in _learnt(document):
            note(args, line)
    elif record.result is not None:
        note(args, f"{args.output} is not written: nothing was drawn")
    return exit_code_of(args, record, doubts(system[0], system[2]))


def _learnt(document: bytes) -> list[str]:
    """Return the verdict, and for every unknown what was stated of it and what is known now."""
    calibration = json.loads(document)["scene"]["calibration"]
    lines = []
    for now in calibration.get("unknowns", ()):
        prior = now.get("prior") or "default"
        stated = {} if isinstance(prior, str) else dict(prior)
        name = stated.pop("prior", "default")
        before = " ".join([name, *(f"{key} {value:.4g}" for key, value in stated.items())])
        after = f"{now['mean']:.4g} +- {now['sd']:.2g} (90 %: {now['q05']:.4g} to {now['q95']:.4g})"
        lines.append(f"{now['unknown']}: {before} -> {after}")
    verdict = "converged" if calibration["converged"] else "not converged"
    return [f"verdict: {verdict}, {'misfit' if calibration['misfit'] else 'no misfit'}", *lines]
