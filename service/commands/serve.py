"""``hybridtof serve``: the service over HTTP."""

import argparse
import gc
import os
from functools import partial

from service.commands.command import Subparsers, add_command
from simulator.errors import InvalidInputError

__all__ = ["add_parser"]


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "serve",
        _run,
        brief="serve over HTTP until SIGTERM",
        description="Serve over HTTP. Posteriors are kept in an SQLite file in the user's state "
        "folder, or where HYBRIDTOF_DATABASE says (sqlite:////srv/jobs.sqlite). "
        "Beyond loopback it needs HYBRIDTOF_API_KEYS, a file that hybridtof keys makes, and "
        "HYBRIDTOF_ALLOWED_HOSTS, its names there. Other environment variables are optional: "
        "HYBRIDTOF_EXECUTOR, HYBRIDTOF_WORKERS, HYBRIDTOF_THREADS, HYBRIDTOF_MAX_BODY_BYTES, "
        "HYBRIDTOF_MAX_JOBS, HYBRIDTOF_MAX_DRAWS_BYTES, HYBRIDTOF_KEEP_DAYS, "
        "HYBRIDTOF_WARM, HYBRIDTOF_SHUTDOWN_S.",
        examples="""
            hybridtof serve
            hybridtof serve --port 8080
            HYBRIDTOF_API_KEYS=keys.json hybridtof serve --host 0.0.0.0
        """,
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (%(default)s)")
    parser.add_argument(
        "--port", type=_port, default=8000, help="port, 0 for any free one (%(default)s)"
    )


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) < 2**16):
        raise argparse.ArgumentTypeError("must be a number from 0 to 65535")
    return int(text)


def _run(args: argparse.Namespace) -> int:
    from service.app import create_app
    from service.border.authorities import is_loopback
    from service.border.keys import POINTER
    from service.commands.warm import warm
    from service.logs import log_config
    from service.server import server_of
    from service.service_settings import ServiceSettings
    from service.warm.warming import Warming

    settings = ServiceSettings.from_environment(os.environ)
    if settings.api_keys is None and not is_loopback(args.host):
        raise InvalidInputError.at(
            POINTER,
            f"is needed to listen on {args.host}, where others can ask: hybridtof keys create NAME",
        )
    server = server_of(
        create_app(settings, warming=Warming(partial(warm, args)) if settings.warm else None),
        settings,
        host=args.host,
        port=args.port,
        log_config=log_config("warning" if args.quiet else "info"),
    )
    # what is there stays: it is not to be searched for garbage while somebody waits, and a batch
    # of frames makes more lists than Python takes for a sign of garbage
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)
    try:
        server.run()
    except SystemExit:
        # uvicorn has said why, such as a port that is taken
        return 4
    return 0 if server.started else 4
