"""``hybridtof keys``: who may use the service."""

import argparse
import json
import os
import re
from pathlib import Path

from service.commands.command import Subparsers, add_command, note
from service.commands.output import write_result
from simulator.errors import InvalidInputError

__all__ = ["add_parser"]

_NAME = re.compile(r"[A-Za-z0-9._-]{1,64}")


def add_parser(subparsers: "Subparsers[argparse.ArgumentParser]") -> None:
    """Add the command to the command line."""
    parser = add_command(
        subparsers,
        "keys",
        _run,
        brief="make, list and revoke the API keys of a service",
        description="Keep the API keys of a service: of each the file has a digest, so that a key "
        "is shown once, when it is made. A running service sees a change at once. Posteriors "
        "belong to the key that asked for them.",
        examples="""
            hybridtof keys create laboratory
            hybridtof keys list
            hybridtof keys revoke laboratory
        """,
    )
    parser.add_argument("action", choices=("create", "list", "revoke"), help="what to do")
    parser.add_argument("name", nargs="?", help="of the key, for people; to revoke also its id")
    parser.add_argument(
        "--file",
        type=Path,
        metavar="FILE",
        help="file of keys (default: HYBRIDTOF_API_KEYS, or keys.json in the user's own "
        "folder of settings)",
    )


def _run(args: argparse.Namespace) -> int:
    import platformdirs

    from service.border.keys import new_key, read_keys, write_keys

    named = os.environ.get("HYBRIDTOF_API_KEYS")
    default = platformdirs.user_config_path("hybridtof", appauthor=False) / "keys.json"
    path: Path = args.file or (Path(named) if named else default)
    if (args.name is None) != (args.action == "list"):
        takes = "no name" if args.action == "list" else "the name of a key"
        raise InvalidInputError.at("/name", f"{args.action} takes {takes}")
    keys = read_keys(path) if path.exists() or args.action != "create" else ()
    if args.action == "list":
        shown = [{"id": key.id, "name": key.name, "created": key.created} for key in keys]
        write_result(json.dumps({"file": str(path), "keys": shown}).encode("ascii"))
    elif args.action == "create":
        if not _NAME.fullmatch(args.name):
            raise InvalidInputError.at("/name", "must be 1 to 64 letters, digits, '.', '_' or '-'")
        if any(key.name == args.name for key in keys):
            raise InvalidInputError.at("/name", f"there is a key {args.name!r}: revoke it first")
        key, secret = new_key(args.name)
        write_keys(path, (*keys, key))
        write_result(
            json.dumps({"file": str(path), "id": key.id, "name": key.name, "key": secret}).encode(
                "ascii"
            )
        )
        note(args, f"the key is shown this once; the service reads HYBRIDTOF_API_KEYS={path}")
    else:
        left = tuple(key for key in keys if args.name not in (key.id, key.name))
        if len(left) == len(keys):
            raise InvalidInputError.at("/name", f"there is no key {args.name!r}")
        write_keys(path, left)
        write_result(json.dumps({"file": str(path), "revoked": args.name}).encode("ascii"))
    return 0
