"""The image: its tests inside it, and what its first answers take on an empty volume.

    python -m benchmarks.container [--marks "not slow"] [--base BASE] [--engine NAME] [--only PART]
        [-- options of build]

Builds by docker, podman or buildah, whichever is there and works. The stage `test` runs the suite.
Of the image itself `benchmarks.container_probe` runs in it: with a root file system that cannot be
written, an empty volume for the store, as the user of the image. Processor time is that of the
service from its start to its end, with one answer. Where registries are out of reach, BASE is an
image that is there already; settings of pip are a secret of the build, which no layer keeps:

    make container-test CONTAINER='--base my/python -- --secret id=pip,src=/etc/pip.conf'

Buildah has no engine beside it that could seal the root: that is done here, by `unshare` and
`chroot`, and takes root.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

__all__ = ["main"]

ROOT = Path(__file__).parents[1]
PROBE = Path(__file__).with_name("container_probe.py")
IMAGE = "hybridtof"
MOST_S = 3.0  # of processor time, for the first answer
# whether it can build, and not only be called: docker may lack its daemon
ASKS = {"docker": ("docker", "info"), "podman": ("podman", "info"), "buildah": ("buildah", "info")}

# the image's root in $1, its user in $2: sealed, with a volume and a /tmp in memory
SEALED = """set -e
mount --bind "$1" "$1"
mount -t tmpfs -o mode=1777 tmpfs "$1/tmp"
mount -t tmpfs -o mode=700,uid="$2",gid="$2" tmpfs "$1/var/lib/hybridtof"
mount -t proc proc "$1/proc"
mount --rbind /dev "$1/dev"
mount -o remount,bind,ro "$1"
root=$1 user=$2
shift 2
cd /
exec chroot --userspec="$user:$user" "$root" env -i "$@"
"""


def engine() -> str | None:
    """The first of the engines that works, if any."""
    for name, ask in ASKS.items():
        if shutil.which(name) is not None:
            asked = subprocess.run(ask, capture_output=True, check=False)  # noqa: S603
            if asked.returncode == 0:
                return name
    return None


def build(name: str, options: list[str], *more: str) -> None:
    command = [name, "build", *options, *more, "."]
    if name == "buildah":
        command[2:2] = ["--layers", "--format", "docker"]
    subprocess.run(command, cwd=ROOT, check=True)  # noqa: S603


def output(*command: str) -> str:
    return subprocess.run(  # noqa: S603
        command, check=True, stdout=subprocess.PIPE, text=True
    ).stdout.strip()


def first_answers(name: str) -> dict[str, Any]:
    """What the probe says from inside the image."""
    probe = PROBE.read_text(encoding="utf-8")
    if name != "buildah":
        sealed = ["--read-only", "--tmpfs", "/tmp", "--cap-drop", "ALL", "--network", "none"]  # noqa: S108
        said = output(name, "run", "--rm", *sealed, "--entrypoint", "python", IMAGE, "-c", probe)
    else:
        container = output("buildah", "from", IMAGE)
        try:
            settings = json.loads(output("buildah", "inspect", container))["OCIv1"]["config"]
            root = output("buildah", "mount", container)
            user = output("chroot", root, "id", "-u", settings["User"])
            # a shell's own text, with the words after it
            words = ["unshare", "--mount", "sh", "-c", SEALED, "sh", root, user]
            said = output(*words, *settings["Env"], "python", "-c", probe)
        finally:
            output("buildah", "rm", container)
    answer: dict[str, Any] = json.loads(said)
    return answer


def faults(said: dict[str, Any]) -> list[str]:
    """What of the answers is not as it has to be."""
    wanted = {
        "root_writable": False,
        "store_was_empty": True,
        "store_writable": True,
        "kernels_made": 0,
        "compilers": [],
        "pip": False,
        "converged": True,
    }
    found = [f"{name} is {said[name]}" for name, value in wanted.items() if said[name] != value]
    if said["user"] == 0:
        found.append("it runs as root")
    if said["estimate_s"] > MOST_S:
        found.append(f"the first answer took {said['estimate_s']} s of processor time")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description="Test the image in the image.")
    parser.add_argument("--marks", default="", help='of pytest -m, as "not slow"; left out: all')
    parser.add_argument("--base", help="image to build on, instead of that of the Dockerfile")
    parser.add_argument("--engine", choices=ASKS, help="left out: the first that works")
    parser.add_argument("--only", choices=("test", "answers"), help="one part alone")
    parser.add_argument("build", nargs="*", help="options of the build, after --")
    args = parser.parse_args()
    name = args.engine or engine()
    if name is None:
        print("no docker, podman or buildah that works: apt-get install buildah")
        return 3
    options = [*args.build, *(["--build-arg", f"BASE={args.base}"] if args.base else [])]
    if name == "buildah":
        # without an engine: no name spaces are needed to build in a changed root
        os.environ.setdefault("BUILDAH_ISOLATION", "chroot")
        options += ["--network", "host"]
    if args.only != "answers":
        build(name, options, "--target", "test", "--build-arg", f"MARKS={args.marks}")
        print(f"the suite passes inside the image ({args.marks or 'all of it'}), built by {name}")
    if args.only == "test":
        return 0
    build(name, options, "--target", "runtime", "--tag", IMAGE)
    said = first_answers(name)
    print(json.dumps(said, indent=1))
    wrong = faults(said)
    print("\n".join(wrong) or f"the image's first answer: {said['estimate_s']} s of processor time")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
