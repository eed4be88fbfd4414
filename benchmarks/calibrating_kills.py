"""Streams that calibrate themselves over HTTP, under kill -9.

    python -m benchmarks.calibrating_kills --kills 50

The service, its pool with it, is killed at random during 4 streams that calibrate. No line may be
lost and none applied twice. When a calibration is taken depends on when its posterior has ended:
answers must be those of a replay in one go, in which the posteriors are computed anew and taken
where the killed service took them, byte for byte but for ``latency_s``.
"""

import argparse
import json
import random
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

from benchmarks.streams import plain, survived
from inference.self_calibration.plan import plan_of
from service.streams.calibrated_here import concluding_as_before
from service.streams.followers import Calibrating
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Line, Place
from service.streams.taking import take
from tests.self_calibration.test_following import DRIFTING, course

_BATCH = 20  # lines


def kills(count: int, seed: int, pace_s: float, folder: str) -> dict[str, Any]:
    """Kill the service during 4 streams that calibrate themselves, and compare with replays."""
    own = 7
    rows, body = calibrating(own)
    lines = [rows] * 4
    database = f"sqlite:///{folder}/calibrating.sqlite"
    rng = random.Random(seed)
    found, killed = survived(database, lines, _BATCH, count, rng, body=body, pace_s=pace_s)
    events = [[line["calibration"] for line in one if "calibration" in line] for one in found]
    same = sum(one == replayed(rows, own, told) for one, told in zip(found, events, strict=True))
    kinds = sorted(event["kind"] for told in events for event in told)
    taken = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}
    lines_sent = sum(map(len, lines))
    return {"streams": 4, "lines": lines_sent, "kills": killed, "events": taken, "identical": same}


def calibrating(seed: int) -> tuple[list[bytes], dict[str, Any]]:
    """Return lines of an object that is found in front of unknown crosstalk, and their stream."""
    columns = course().to_columns(DRIFTING.sensor)
    rows = (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))
    told = [json.dumps({"sequence": n, **row}).encode() for n, row in enumerate(rows, start=1)]
    plan = DRIFTING
    system_of = {
        "sensor": plan.sensor.model_dump(mode="json", exclude_none=True),
        "scene": plan.stated.model_dump(mode="json", exclude_none=True),
        "tracking": plan.settings.model_dump(mode="json", exclude_none=True),
    }
    return told, system_of | {"calibrate": True, "seed": seed}


def replayed(
    rows: Sequence[bytes], seed: int, events: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the answers of one undisturbed batch, with calibrations where they were taken."""
    plan = plan_of(DRIFTING.sensor, DRIFTING.stated, DRIFTING.settings, seed)
    concluded = {event["number"]: event for event in events if event["kind"] != "doubted"}
    follower = Calibrating.of(plan, concluding_as_before(plan, concluded))
    arrived = [Line(raw, 0.0) for raw in rows]
    taken = take(follower, Place(follower.first), arrived, JsonLines(), Kept())
    return [plain(line) for line in taken.answers]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--pace", type=float, default=4.0, help="seconds between batches, in which posteriors end"
    )
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = kills(args.kills, args.seed, args.pace, folder)
    print(json.dumps(result))
    # without a calibration that was taken it has shown nothing
    sys.exit(result["identical"] != 4 or "taken" not in result["events"])


if __name__ == "__main__":
    main()
