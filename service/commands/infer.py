"""``hybridtof infer``: the posterior of the frames in a file."""

import argparse
import asyncio
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inference.posterior.settings import SamplerSettings
    from service.job_store import JobRecord
    from simulator.frames import Frames
    from simulator.scene import Scene
    from simulator.sensor import Sensor

from service.commands.command import FRAMES_HELP, Subparsers, add_command, note

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "infer",
        _run,
        brief="sample the posterior of the ranges and of all unknowns",
        description="Sample the posterior and print it as JSON; progress goes to standard error. "
        "A row of a file that cannot be read counts as a saturated frame: it has no range.",
        examples="""
            hybridtof infer frames.csv --scene scene.json > posterior.json
            hybridtof infer frames.csv --scene scene.json --seed 7 --max-seconds 60 --draws draws.nc
        """,
    )
    parser.add_argument("frames", type=Path, help=FRAMES_HELP)
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument("--method", choices=("emcee", "importance", "auto"))
    parser.add_argument("--ensembles", type=int)
    parser.add_argument("--target-ess", type=int)
    parser.add_argument("--max-seconds", type=float)
    parser.add_argument("--draws", type=Path, help="write the draws here, as .nc (NetCDF), .ndjson")
    parser.add_argument("--seed", type=int, help="left out: drawn and printed")


def _run(args: argparse.Namespace) -> int:
    from inference.posterior.settings import SamplerSettings
    from service.answers.posteriors import full
    from service.commands.files import naming, source
    from service.commands.frames import checked_whole
    from service.commands.output import write_result
    from simulator.validated import parse

    form = None if args.draws is None else _format_of(args.draws)
    names = ("method", "ensembles", "target_ess", "max_seconds", "seed")
    sampler = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    with naming({"": "sampler"}):
        settings = parse(SamplerSettings, sampler)
    system = checked_whole(args)
    with naming({"/frames": source(args.frames), "": str(args.scene)}):
        record, draws = asyncio.run(_infer(args, system, settings, form))
    if draws is not None:
        args.draws.write_bytes(draws)
    write_result(json.dumps(full(record), allow_nan=False).encode())
    if record.problem is None:
        return 0
    sys.stderr.write(f"hybridtof: error: {record.problem['detail']}\n")
    return 3 if record.problem["status"] < 500 else 4


def _format_of(path: Path) -> str:
    """Return the media type of a file, before any time is spent on what goes into it."""
    from service.commands.files import check_folder
    from service.exports import EXPORTS
    from simulator.errors import InvalidInputError, Problem

    check_folder("--draws", path)
    for form in EXPORTS:
        if path.suffix == form.suffix:
            return form.media_type
    known = " or ".join(form.suffix for form in EXPORTS)
    raise InvalidInputError(Problem(f"--draws {path}", f"draws are written as {known}"))


async def _infer(
    args: argparse.Namespace,
    system: "tuple[Sensor, Scene, Frames]",
    settings: "SamplerSettings",
    form: str | None,
) -> tuple["JobRecord", bytes | None]:
    """Run one job of the service, without the service."""
    from inference.posterior import fold
    from service.job_store import MemoryJobStore
    from service.jobs import Jobs
    from service.process_pool import ProcessPool

    jobs = Jobs(fold, MemoryJobStore(1), ProcessPool(os.cpu_count() or 1), running=1)
    await jobs.start()
    try:
        record = await jobs.submit(*system, settings)
        seen = None
        while not await jobs.wait(record.id, timeout_s=0.5):
            progress = (await jobs.get(record.id)).progress
            if progress is not None and progress != seen:
                note(args, _described(progress))
                seen = progress
        record = await jobs.get(record.id)
        if form is None or record.problem is not None:
            return record, None
        return record, await jobs.draws(record.id, form)
    finally:
        await jobs.close()


def _described(progress: dict[str, Any]) -> str:
    parts = [f"{progress['steps']} of about {progress['target']} steps"]
    for name, unit in (("ess", ""), ("rhat", ""), ("eta_s", " s")):
        if progress[name] is not None:
            parts.append(f"{name.removesuffix('_s')} {progress[name]:.4g}{unit}")
    return ", ".join(parts)
