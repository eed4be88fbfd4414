"""What kill -9 does to a service: nothing but cost time.

    python -m benchmarks.kills                     an SQLite file, one service
    python -m benchmarks.kills --postgres          a PostgreSQL of its own, two services
    python -m benchmarks.kills --dask              chunks on a Dask cluster of two workers, with TLS

Jobs are asked for, and services, workers (scheduler, database) are killed at random moments, and
started anew. No accepted job may be lost or doubled, none may fail, and answers (their run
times apart) and draws must be those of an undisturbed run, byte for byte.
"""

import argparse
import contextlib
import json
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.cluster import Cluster
from benchmarks.fleet import SERVE, Fleet, fleet
from benchmarks.postgres import postgres, restart

ENDED = {"done", "cancelled", "failed"}


def survived(
    running: Fleet,
    bodies: Mapping[str, Any],
    kills: Sequence[Callable[[], object]],
    wait: Callable[[Fleet], None],
) -> dict[str, tuple[Any, bytes]]:
    """Ask for jobs, kill, and return each job's answer and draws when all have ended.

    Parameters
    ----------
    running : Fleet
        The services.
    bodies : mapping
        Requests by their idempotency keys.
    kills : sequence of callable
        Each kills something.
    wait : callable
        Is called before each.
    """
    ids = {}
    for key, body in bodies.items():
        response = _create(running, key, body)
        ids[key] = response["id"]
    for kill in kills:
        wait(running)
        kill()
    found = {}
    for key, name in ids.items():
        path = f"/v1/posteriors/{name}"
        while (answer := running.ask("GET", path).json())["status"] not in ENDED:
            time.sleep(0.05)
        assert answer["status"] == "done", answer
        draws = running.ask("GET", path + "/draws", headers={"Accept": "application/x-ndjson"})
        del answer["runtime"], answer["id"]
        found[key] = answer, draws.content
        # the same request is the same job still
        assert _create(running, key, bodies[key])["id"] == name
    listed = running.ask("GET", "/v1/posteriors?limit=200").json()["items"]
    assert sorted(item["id"] for item in listed) == sorted(ids.values())
    return found


def _create(running: Fleet, key: str, body: Any) -> Any:
    response = running.ask("POST", "/v1/posteriors", json=body, headers={"Idempotency-Key": key})
    assert response.status_code == 202, response.text
    return response.json()


def requests(count: int) -> dict[str, Any]:
    """Return small posteriors of real frames, each with a seed of its own."""
    from service.answers.simulations import simulation_of
    from service.requests import SimulationRequest
    from simulator.validated import parse

    sensor = {
        "kind": "pulsed",
        "pulse_width_s": 1e-7,
        "gain": 1.0,
        "noise": {"read": [1e-4, 1e-4]},
    }
    system = {"sensor": sensor, "scene": {"crosstalk": [0.01, 0.02], "discrepancy": 0}}
    known = system | {
        "scene": {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}, "crosstalk": [0.01, 0.02]}
    }
    path = {"kind": "radial", "from_m": 0.2, "to_m": 2.0, "frames": 20, "spacing": "log"}
    bodies = {}
    for seed in range(1, count + 1):
        asked = parse(SimulationRequest, known | {"trajectory": path, "seed": seed})
        sampler = {"seed": seed, "target_ess": 3000, "max_seconds": 86_400.0}
        frames = simulation_of(asked)["frames"]
        bodies[f"job-{seed}"] = system | {"frames": frames, "sampler": sampler}
    return bodies


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--jobs", type=int, default=20)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--postgres", action="store_true")
    where.add_argument("--dask", action="store_true")
    args = parser.parse_args()
    bodies, rng = requests(args.jobs), random.Random(args.seed)
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        settings = {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/jobs.sqlite"}
        if args.postgres:
            found = stack.enter_context(postgres())
            if found is None:
                sys.exit("PostgreSQL is not installed")
            settings = {"HYBRIDTOF_DATABASE": found}
        begin = time.monotonic()
        undisturbed = {"HYBRIDTOF_DATABASE": f"sqlite:///{folder}/undisturbed.sqlite"}
        with fleet(SERVE, undisturbed, 1) as alone:
            expected = survived(alone, bodies, (), lambda _: None)
        between = time.monotonic()
        cluster = None
        if args.dask:
            cluster = stack.enter_context(Cluster.running(folder))
            settings |= cluster.settings
        killed: Counter[str] = Counter()
        with fleet(SERVE, settings, 2 if args.postgres else 1) as running:

            def kill() -> None:
                if args.postgres and rng.random() < 0.1:
                    killed[restart(settings["HYBRIDTOF_DATABASE"])] += 1
                elif cluster is not None and rng.random() < 0.75:
                    killed[cluster.kill(rng)] += 1
                else:
                    killed[running.kill(rng)] += 1

            def pause(_: Fleet) -> None:
                time.sleep(rng.uniform(0.5, 5.0))

            disturbed = survived(running, bodies, [kill] * args.kills, pause)
        same = sum(disturbed[key] == expected[key] for key in expected)
        print(
            json.dumps(
                {
                    "on": "postgresql" if args.postgres else "dask" if args.dask else "sqlite",
                    "jobs": args.jobs,
                    "kills": killed,
                    "identical": same,
                    "undisturbed_s": round(between - begin, 1),
                    "disturbed_s": round(time.monotonic() - between, 1),
                }
            )
        )
        sys.exit(same != len(expected))


if __name__ == "__main__":
    main()
