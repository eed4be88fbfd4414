"""Where the processor time of a frame of a stream goes, without sockets and without waiting.

    python -m benchmarks.stream_parts [--batches 40] [--size 1000] [--store 5]

One thread answers the batches of `benchmarks.streams`, one after the other: cuts the body into
lines, answers them, writes the state, and has so many changes of streams kept in one transaction of
an SQLite file. What an answer is made of is then done once more by itself. Microseconds of
processor time a frame, medians over the batches.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.streams import lines_of, system
from service.store.stream_record import StreamChange
from service.store.stream_store import StreamStore
from service.store.transactions import Transactions
from service.streams.answered import text_of
from service.streams.cutting import Cutter
from service.streams.forms import JsonLines
from service.streams.kept import Kept
from service.streams.lines import Place, arriving
from service.streams.model import model_of
from service.streams.said import said_of, said_to_bytes
from service.streams.taking import take
from service.streams.together import together

_FIRST = 3  # batches that are not counted: what is made once is made there


class Clock:
    """Processor times of named parts."""

    def __init__(self) -> None:
        self.spent: dict[str, list[float]] = {}

    def of(self, name: str, do: Callable[..., Any], *args: Any) -> Any:
        """Do something, and note what it took."""
        begun = time.thread_time()
        result = do(*args)
        self.spent.setdefault(name, []).append(time.thread_time() - begun)
        return result


def _cut(body: bytes) -> list[bytes | None]:
    cutter = Cutter()
    return cutter.feed(body) + cutter.end()


def parts(batches: int, size: int, at_once: int, folder: str) -> dict[str, float]:
    """Return the processor time of a frame by parts [us]."""
    request = json.dumps(system(0)).encode()
    model, form, clock = model_of(request), JsonLines(), Clock()
    database = Transactions(f"sqlite:///{folder}/parts.sqlite")
    store = StreamStore(database, at_once, 1e6, 1e6, 4096)
    records = [store.add(str(k), "", request, b"") for k in range(at_once)]
    place = Place(model.first)
    every = lines_of(size * (batches + _FIRST))
    for k in range(batches + _FIRST):
        body = b"\n".join(every[k * size : (k + 1) * size])
        lines = arriving(clock.of("cutting into lines", _cut, body), time.perf_counter())
        taken = clock.of("answering them", take, model, place, lines, form, Kept())
        where = max(place.sequence, 0), place.sequence + 1, float("nan")
        read = clock.of("- reading numbers", together, model.base, form, lines, where)
        follow = model.follow
        _, pieces = clock.of("- tracking", follow, place.state, read.frames, read.sequences)
        latencies = np.zeros(size)
        said = said_of(pieces[0].track, read.sequences, read.times, latencies)
        clock.of("- writing text", text_of, said)
        clock.of("- what is kept of it", said_to_bytes, said)
        place = taken.place
        state = clock.of("the state as bytes", model.to_bytes, place.state)
        changes = [
            StreamChange(record.id, k + 1, state, place.sequence, {}, place.last, taken.kept, None)
            for record in records
        ]
        done = clock.of("the store", store.apply, changes)
        assert all(done), done
    database.close()
    shares = {"the store": at_once}
    return {
        name: round(statistics.median(spent[_FIRST:]) / size / shares.get(name, 1) * 1e6, 3)
        for name, spent in clock.spent.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--batches", type=int, default=40)
    parser.add_argument("--size", type=int, default=1000)
    parser.add_argument("--store", type=int, default=5, help="changes in one transaction")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(parts(args.batches, args.size, args.store, folder), indent=2))


if __name__ == "__main__":
    main()
