"""What runs inside the image: its first answers, and what it may and may not do there.

Its text is given to the image's own Python; it imports nothing of this project.
"""

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

SENSOR = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-5, 1e-3]}}
LEAK = [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 2.0}]
W1 = [0.02453, 0.02014, 0.01651, 0.01352, 0.01111, 0.00923, 0.00780, 0.00672]
W2 = [1.9372, 1.4578, 1.1116, 0.8724, 0.7086, 0.5990, 0.5248, 0.4790]
CACHE = Path(os.environ["NUMBA_CACHE_DIR"])
STORE = Path("/var/lib/hybridtof")
COMPILERS = ("cc", "c++", "gcc", "g++", "clang", "ld", "make")


def asked(address: str, path: str, body: object = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    headers = {"Content-Type": "application/json"}
    request = urllib.request.Request(address + path, data, headers)  # noqa: S310  # loopback
    with urllib.request.urlopen(request, timeout=120) as answer:  # noqa: S310
        return json.load(answer)


def processor_s() -> float:
    """Of processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def answer(request: object, route: str) -> tuple[Any, float]:
    """Start the service, ask once, end it; what it took, from its start to its end."""
    before = processor_s()
    command = [shutil.which("hybridtof") or "", "serve", "--port", "0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)  # noqa: S603
    assert process.stderr is not None
    address = ""
    for line in process.stderr:
        if found := re.search(r"running on (http://[\d.:]+)", line):
            address = found[1]
            break
    assert address, "the service does not start"
    ready = asked(address, "/health/ready")
    assert ready == {"status": "ok"}, ready  # nothing is left to warm
    said = asked(address, route, request)
    if "id" in said:
        events = urllib.request.urlopen(f"{address}{route}/{said['id']}/events")  # noqa: S310
        while events.readline():  # until it has ended
            pass
        said = asked(address, f"{route}/{said['id']}")
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    return said, processor_s() - before


def writable(path: Path) -> bool:
    try:
        (path / "probe").write_text("")
    except OSError:
        return False
    (path / "probe").unlink()
    return True


def main() -> None:
    kernels = {path.name for path in CACHE.rglob("*")}
    store_was_empty = not any(STORE.iterdir())
    scene = {"crosstalk": [0.004, 0.4]}
    one = {"sensor": SENSOR, "scene": scene, "frames": {"w1": W1, "w2": W2}}
    estimate, estimate_s = answer(one, "/v1/estimates")
    frames = {
        "w1": [0.00398, 0.004, 0.00402, *W1],
        "w2": [0.3987, 0.4004, 0.4001, *W2],
        "object_present": [False] * 3 + [True] * 8,
    }
    many = {"sensor": SENSOR, "scene": {"crosstalk": LEAK}, "frames": frames}
    fit, fit_s = answer(many | {"techniques": ["joint_fit"]}, "/v1/estimates")
    posterior, posterior_s = answer(many | {"sampler": {"seed": 7}}, "/v1/posteriors")
    said = {
        "python": sys.version.split()[0],
        "user": os.getuid(),
        "root_writable": any(map(writable, (Path("/"), Path("/opt/hybridtof"), CACHE))),
        "store_was_empty": store_was_empty,
        "store_writable": writable(STORE),
        "kernels": len(kernels),
        "kernels_made": len({path.name for path in CACHE.rglob("*")} - kernels),
        "compilers": [name for name in COMPILERS if shutil.which(name)],
        "pip": bool(list(Path("/opt/hybridtof").glob("lib/python*/site-packages/pip"))),
        "range_m": estimate["results"][0]["frames"][0]["range_m"],
        "estimate_s": round(estimate_s, 2),
        "fit": fit["chosen"],
        "fit_s": round(fit_s, 2),
        "converged": posterior["verdict"]["converged"],
        "posterior_s": round(posterior_s, 2),
    }
    json.dump(said, sys.stdout)


main()
