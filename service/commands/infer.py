"""``hybridtof infer``: the posterior of the frames in a file."""

import argparse
import json
import os
import sys
from collections.abc import Awaitable, Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from inference.posterior.settings import SamplerSettings
    from service.jobs import Jobs
    from service.store.record import JobRecord
    from simulator.frames import Frames
    from simulator.scene import Scene
    from simulator.sensor import Sensor

from service.commands.command import FRAMES_HELP, Subparsers, add_command, note

__all__ = [
    "add_parser",
    "add_posterior_arguments",
    "exit_code_of",
    "posterior_of",
    "settings_of",
]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "infer",
        _run,
        brief="sample the posterior of the ranges and of all unknowns",
        description="Sample the posterior and print it as JSON; progress goes to standard error. "
        "A row of a file that cannot be read counts as a saturated frame: it has no range. A "
        "posterior that has not converged is printed all the same, and the exit code is 3; where "
        "`drawn` is false, nothing was drawn in the time allowed and there are no intervals.",
        examples="""
            hybridtof infer frames.csv --scene scene.json > posterior.json
            hybridtof infer frames.csv --scene scene.json --seed 7 --max-seconds 60 --draws draws.nc
        """,
    )
    add_posterior_arguments(parser)
    parser.add_argument("--draws", type=Path, help="write the draws here, as .nc (NetCDF), .ndjson")


def add_posterior_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what every posterior wants to be told."""
    parser.add_argument("frames", type=Path, help=FRAMES_HELP)
    parser.add_argument(
        "--scene", type=Path, required=True, help="JSON file with members sensor and scene"
    )
    parser.add_argument("--method", choices=("emcee", "importance", "auto"))
    parser.add_argument("--ensembles", type=int)
    parser.add_argument("--target-ess", type=int)
    parser.add_argument(
        "--max-seconds",
        type=float,
        help="processor time to spend, compiling apart: of several processes the sum [s]",
    )
    parser.add_argument("--seed", type=int, help="left out: drawn and printed")


def settings_of(args: argparse.Namespace) -> "SamplerSettings":
    """Return the sampler's settings that the arguments state, checked."""
    from inference.posterior.settings import SamplerSettings
    from service.commands.files import naming
    from simulator.validated import parse

    names = ("method", "ensembles", "target_ess", "max_seconds", "seed")
    sampler = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    with naming({"": "sampler"}):
        return parse(SamplerSettings, sampler)


def _run(args: argparse.Namespace) -> int:
    from service.answers.posteriors import full
    from service.commands.frames import checked_whole
    from service.commands.output import write_result
    from service.plausibility import doubts

    form = None if args.draws is None else _format_of(args.draws)
    settings = settings_of(args)
    system = checked_whole(args)
    make = None if form is None else lambda jobs, record: jobs.ended.draws(record.id, form)
    record, draws = posterior_of(args, system, settings, make)
    if draws is not None:
        args.draws.write_bytes(draws)
    elif form is not None and record.result is not None:
        note(args, f"{args.draws} is not written: nothing was drawn")
    write_result(json.dumps(full(record), allow_nan=False).encode())
    return exit_code_of(args, record, doubts(system[0], system[2]))


def exit_code_of(args: argparse.Namespace, record: "JobRecord", said: Collection[str]) -> int:
    """Return the exit code of a posterior that has ended, having said on standard error why.

    Parameters
    ----------
    said : collection of str
        Doubts that were told before.
    """
    if record.problem is not None:
        for error in record.problem["errors"]:
            at = f"{args.scene}#{error['pointer']}: {error['detail']}"
            sys.stderr.write(f"hybridtof: error: {at}\n")
        if record.problem["errors"]:
            return 2
        sys.stderr.write(f"hybridtof: error: {record.problem['detail']}\n")
        return 3 if record.problem["status"] < 500 else 4
    result: dict[str, Any] = record.result or {}
    verdict: dict[str, Any] = result.get("verdict", {})
    converged = bool(verdict.get("converged"))
    if not converged:
        reasons = "; ".join(verdict.get("reasons", ()))
        sys.stderr.write(f"hybridtof: not converged: {reasons}\n")
    for line in _warnings(result):
        note(args, line)
    for supposed in result.get("assumptions") or ():
        if supposed not in said:
            note(args, f"note: {supposed}")
    return 0 if converged else 3


def _warnings(result: dict[str, Any]) -> list[str]:
    """Return what decides whether ranges of a posterior are to be used, what matters most first."""
    said = []
    fit = result.get("fit") or {}
    if fit.get("misfit"):
        said.append(f"misfit: do not use the ranges as they are: {'; '.join(fit['reasons'])}")
    return said + [
        f"range_m, the scale of all ranges, is {row['status']}: {row['reason']}"
        for row in result.get("identifiability") or ()
        if row["parameter"] == "range_m" and row["status"] != "identified"
    ]


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


def posterior_of(
    args: argparse.Namespace,
    system: "tuple[Sensor, Scene, Frames]",
    settings: "SamplerSettings",
    make: "Callable[[Jobs[Any, Any, Any, Any], JobRecord], Awaitable[bytes]] | None",
) -> tuple["JobRecord", bytes | None]:
    """Run one job of the service, without the service.

    Parameters
    ----------
    args : argparse.Namespace
        With ``frames``, ``scene`` and ``quiet``.
    system, settings
        What is asked, and how it is sampled.
    make : callable, optional
        What is to be made of its draws.

    Returns
    -------
    (JobRecord, bytes or None)
        None where there are no draws, or nothing is to be made of them.
    """
    import asyncio

    from service.commands.files import naming, source

    with naming({"/frames": source(args.frames), "": str(args.scene)}):
        return asyncio.run(_posterior(args, system, settings, make))


async def _posterior(
    args: argparse.Namespace,
    system: "tuple[Sensor, Scene, Frames]",
    settings: "SamplerSettings",
    make: "Callable[[Jobs[Any, Any, Any, Any], JobRecord], Awaitable[bytes]] | None",
) -> tuple["JobRecord", bytes | None]:
    from tempfile import TemporaryDirectory

    from inference.posterior import fold
    from service.jobs import Jobs
    from service.process_pool import ProcessPool
    from service.store.job_store import JobStore
    from service.store.retention import Retention

    with TemporaryDirectory(prefix="hybridtof-") as folder:
        store = JobStore(f"sqlite:///{folder}/jobs.sqlite", Retention(jobs=1))
        jobs = Jobs(fold, store, ProcessPool(os.cpu_count() or 1), running=1)
        await jobs.start()
        try:
            record = await jobs.submit(*system, settings)
            async for now in jobs.follow(record.id, record.revision):
                note(args, _described(now.progress))
                record = now
            if make is None or record.result is None or not record.result["drawn"]:
                return record, None
            return record, await make(jobs, record)
        finally:
            await jobs.close()


def _described(progress: dict[str, Any]) -> str:
    parts = [str(progress["phase"])]
    if progress["steps"]:
        about = "" if progress["target"] is None else f" of about {progress['target']}"
        parts.append(f"{progress['steps']}{about} steps")
    for name, unit in (("ess", ""), ("rhat", ""), ("eta_s", " s")):
        if progress[name] is not None:
            parts.append(f"{name.removesuffix('_s')} {progress[name]:.4g}{unit}")
    return ", ".join(parts)
