"""The command ``hybridtof demo``."""

import argparse
import sys
import time
from pathlib import Path

from service.commands.command import Subparsers, add_command, can_draw, note

__all__ = ["add_parser"]

RECORDINGS = Path("../shared/data/tmf8820_plane.json")


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "demo",
        _run,
        brief="start the service, send it readings, show distances with their uncertainty",
        description="Start the service on an unused port, send it recorded photons where they are "
        "at hand and simulated scenes, print the answers and draw them.",
        examples="""
            hybridtof demo
            hybridtof demo --out pictures --recordings plane.json
        """,
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="for demo.png (%(default)s)"
    )
    parser.add_argument(
        "--recordings",
        type=Path,
        default=RECORDINGS,
        metavar="FILE",
        help="histograms of a plane; a simulated scene where it is absent (%(default)s)",
    )


def _run(args: argparse.Namespace) -> int:
    import httpx

    from service.demo.episodes import EPISODES
    from service.demo.running import Client, running_service
    from service.demo.table import table

    begin = time.perf_counter()

    def say(text: str) -> None:
        note(args, f"{time.perf_counter() - begin:5.1f} s  {text}")

    drawing = can_draw(args)
    args.out.mkdir(parents=True, exist_ok=True)
    episodes = []
    with running_service() as address, httpx.Client(base_url=address, timeout=300) as http:
        say(f"the service runs at {address}; the first requests compile machine code")
        for episode in EPISODES:
            episodes.append(episode(Client(http), args.recordings))
            say(f"answered: {episodes[-1].title}")
    sys.stdout.write(table(episodes) + "\n")
    if not drawing:
        return 0
    from service.demo.picture import draw

    path = args.out / "demo.png"
    draw(episodes, path)
    sys.stdout.write(f"picture: {path}\n")
    return 0
