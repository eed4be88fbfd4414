"""``hybridtof infer``: the posterior of the frames in a file."""

import argparse
import asyncio
import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from service.job_store import JobRecord
    from service.schemas import PosteriorRequest

__all__ = ["add_parser"]


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = subparsers.add_parser(
        "infer",
        help="sample the posterior of the ranges and of all unknowns",
        description="Sample the posterior and print it as JSON; progress goes to standard error.",
    )
    parser.add_argument("frames", type=Path, help="frames as .csv, .ndjson or .json")
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument("--method", choices=("emcee", "importance", "auto"))
    parser.add_argument("--ensembles", type=int)
    parser.add_argument("--target-ess", type=int)
    parser.add_argument("--max-seconds", type=float)
    parser.add_argument("--draws", type=Path, help="write the draws here, as .nc or .ndjson")
    parser.add_argument("--seed", type=int, help="left out: drawn and printed")
    parser.set_defaults(run=_run)


def _run(args: argparse.Namespace) -> int:
    from service.commands.files import naming, read_columns, read_document
    from service.commands.output import write_result
    from service.posterior_json import full
    from service.schemas import PosteriorRequest, SystemDescription
    from simulator.validated import parse

    form = None if args.draws is None else _format_of(args.draws)
    system = read_document(SystemDescription, args.scene)
    columns = read_columns(args.frames)
    names = ("method", "ensembles", "target_ess", "max_seconds", "seed")
    sampler = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    sources = {"/frames": str(args.frames), "/sampler": "sampler", "": str(args.scene)}
    with naming(sources):
        request = parse(
            PosteriorRequest,
            {
                "sensor": system.sensor,
                "scene": system.scene,
                "frames": columns,
                "sampler": sampler,
            },
        )
        record, draws = asyncio.run(_infer(request, form))
    if draws is not None:
        args.draws.write_bytes(draws)
    write_result(json.dumps(full(record), allow_nan=False).encode())
    if record.problem is None:
        return 0
    sys.stderr.write(f"hybridtof: error: {record.problem['detail']}\n")
    return 3 if record.problem["status"] < 500 else 4


def _format_of(path: Path) -> str:
    """Return the media type of a file, before any time is spent on what goes into it."""
    from service.draws_formats import FORMATS
    from simulator.errors import InvalidInputError, Problem

    if not path.parent.is_dir():
        raise InvalidInputError(Problem(f"--draws {path}", "there is no such folder"))
    for form in FORMATS:
        if path.suffix == form.suffix:
            return form.media_type
    known = " or ".join(form.suffix for form in FORMATS)
    raise InvalidInputError(Problem(f"--draws {path}", f"draws are written as {known}"))


async def _infer(request: "PosteriorRequest", form: str | None) -> tuple["JobRecord", bytes | None]:
    """Run one job of the service, without the service."""
    from inference.posterior import fold
    from service.checks import system_with_frames
    from service.job_store import MemoryJobStore
    from service.jobs import Jobs
    from service.process_pool import ProcessPool

    jobs = Jobs(fold, MemoryJobStore(1), ProcessPool(os.cpu_count() or 1), running=1)
    await jobs.start()
    try:
        checked = system_with_frames(request.sensor, request.scene, request.frames)
        record = await jobs.submit(*checked, request.sampler)
        seen = None
        while not await jobs.wait(record.id, timeout_s=0.5):
            progress = (await jobs.get(record.id)).progress
            if progress is not None and progress != seen:
                _show(progress)
                seen = progress
        record = await jobs.get(record.id)
        if form is None or record.problem is not None:
            return record, None
        return record, await jobs.draws(record.id, form)
    finally:
        await jobs.close()


def _show(progress: dict[str, Any]) -> None:
    parts = [f"{progress['steps']} of about {progress['target']} steps"]
    for name, unit in (("ess", ""), ("rhat", ""), ("eta_s", " s")):
        if progress[name] is not None:
            parts.append(f"{name.removesuffix('_s')} {progress[name]:.4g}{unit}")
    sys.stderr.write("hybridtof: " + ", ".join(parts) + "\n")
