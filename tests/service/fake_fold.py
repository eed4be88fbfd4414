"""A posterior that is a running sum: quick, pure, importable in a worker, the same every time."""

import dataclasses
import io
import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inference.posterior.progress import Phase, Progress
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError

if TYPE_CHECKING:  # a worker imports this, and is to be there soon
    from simulator.frames import Frames
    from simulator.scene import Scene
    from simulator.sensor import Sensor

FORMAT = "sums"
CHUNKS = 6
STEPS = 10


@dataclasses.dataclass(frozen=True)
class Job:
    settings: SamplerSettings
    # directives of a test: {"sleep": seconds a piece, "burn": seconds
    # of processor time a piece, "hold": path of a mark without which no chunk
    # but the first is computed, "die": path of a mark, "signal": which, "fail": message,
    # "outlive": path of a mark that a piece leaves if it is still computed when its parent has been
    # gone for long}
    orders: dict[str, Any]

    def to_bytes(self) -> bytes:
        return repr((self.settings.model_dump(), self.orders)).encode()

    @staticmethod
    def from_bytes(raw: bytes) -> "Job":
        import ast

        settings, orders = ast.literal_eval(raw.decode())
        return Job(SamplerSettings(**settings), orders)


@dataclasses.dataclass(frozen=True)
class Checkpoint:
    chunk: int
    sums: tuple[float, ...]
    method: str = "emcee"

    def to_bytes(self) -> bytes:
        out = io.BytesIO()
        np.savez(out, chunk=self.chunk, sums=np.asarray(self.sums))
        return out.getvalue()

    def addition(self, _: "Checkpoint") -> bytes | None:
        """What comes behind an earlier one: a piece a chunk, written anew after every third."""
        return None if self.chunk % 3 == 0 else self.to_bytes()

    @staticmethod
    def from_bytes(*pieces: bytes) -> "Checkpoint":
        read = []
        for raw in pieces:
            with np.load(io.BytesIO(raw)) as stored:
                read.append(Checkpoint(int(stored["chunk"]), tuple(stored["sums"].tolist())))
        # no piece is lost, doubled or out of order
        assert [at.chunk for at in read] == list(range(read[0].chunk, read[-1].chunk + 1))
        assert read[0].chunk % 3 == 0
        return read[-1]


@dataclasses.dataclass(frozen=True)
class Task:
    seed: int
    chunk: int
    ensemble: int
    sum: float
    orders: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Posterior:
    body: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        return self.body


_ORDERS: dict[str, Any] = {}


def order(**orders: Any) -> None:
    """Say how the next jobs behave; an empty call takes it back."""
    _ORDERS.clear()
    _ORDERS.update(orders)


def prepare(_: "Sensor", scene: "Scene", __: "Frames", settings: SamplerSettings) -> Job:
    if scene.model_error.integrated:
        raise RefusedError("a discrepancy is not known here; leave it out")
    seed = 1 if settings.seed is None else settings.seed
    from inference.posterior.answer.posterior import RANGE_COLUMNS

    orders = _ORDERS | {"columns": tuple(RANGE_COLUMNS)}
    return Job(settings.model_copy(update={"seed": seed}), orders)


def start(job: Job) -> Checkpoint:
    return Checkpoint(0, (0.0,) * job.settings.ensembles)


def tasks(job: Job, checkpoint: Checkpoint, cpu_s: float) -> tuple[Task, ...]:
    if checkpoint.chunk == CHUNKS or cpu_s >= job.settings.max_seconds:
        return ()
    assert job.settings.seed is not None
    return tuple(
        Task(job.settings.seed, checkpoint.chunk, ensemble, total, job.orders)
        for ensemble, total in enumerate(checkpoint.sums)
    )


def burn(seconds: float) -> None:
    """Take processor time."""
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def run(task: Task) -> float:
    time.sleep(task.orders.get("sleep", 0.0))
    burn(task.orders.get("burn", 0.0))
    if "hold" in task.orders and task.chunk > 0:
        while not Path(task.orders["hold"]).exists():
            burn(0.001)  # who only waits is taken for stopped, and killed
            time.sleep(0.005)
    if "outlive" in task.orders:
        outlive(Path(task.orders["outlive"]))
    if "fail" in task.orders:
        raise ValueError(task.orders["fail"])
    if "die" in task.orders and task.chunk == 2 and task.ensemble == 1:
        mark = Path(task.orders["die"])
        deaths = len(mark.read_text()) if mark.exists() else 0
        if deaths < task.orders["deaths"]:
            mark.write_text("x" * (deaths + 1))
            os.kill(os.getpid(), task.orders.get("signal", signal.SIGKILL))
    rng = np.random.default_rng([task.seed, task.chunk, task.ensemble])
    return task.sum + float(rng.standard_normal())


def outlive(mark: Path) -> None:
    """Wait until the parent has gone, go on for seconds of processor time, and leave a mark."""
    parent = os.getppid()
    mark.with_suffix(".begun").touch()
    while os.getppid() == parent:
        time.sleep(0.005)
    for _ in range(10**8):
        pass
    mark.write_text("outlived")


def merge(job: Job, checkpoint: Checkpoint, pieces: Sequence[float]) -> Checkpoint:
    assert len(pieces) == job.settings.ensembles
    return Checkpoint(checkpoint.chunk + 1, tuple(pieces))


def progress(_: Job, checkpoint: Checkpoint) -> Progress:
    done = checkpoint.chunk
    rhat = 1.0 + 1.0 / done if done else None
    phase: Phase = "summarising" if done == CHUNKS else "sampling"
    return Progress(phase, done * STEPS, CHUNKS * STEPS, 10.0 * done, rhat, done == CHUNKS)


def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    finished = checkpoint.chunk == CHUNKS
    reason = "too few steps" if cpu_s < job.settings.max_seconds else "out of time"
    summary: dict[str, Any] = {
        "mean": checkpoint.sums[0],
        "sd": 1.0,
        "sd_parts": {"noise": 1.0, "scene": 0.0, "model": 0.0},
        "q05": 0.0,
        "q50": 0.0,
        "q95": 0.0,
    }
    summary |= {"ess_bulk": 1.0, "ess_tail": 1.0, "rhat": 1.0, "mcse_mean": 1.0, "modes": []}
    return Posterior(
        {
            "method": job.settings.method,
            "seed": job.settings.seed,
            "drawn": True,
            "verdict": {
                "converged": finished,
                "reasons": [] if finished else [reason],
            },
            "parameters": {"object.c0": summary},
            "modes": [],
            "range_m": {key: [] for key in (*job.orders["columns"], "near_fold", "modes")}
            | {"sd_parts": {"noise": [], "scene": [], "model": []}},
            "identifiability": [],
            "fit": {
                "p_value": 0.5,
                "misfit": False,
                "reasons": [],
                "chi_square": 1.0,
                "degrees_of_freedom": 1.0,
                "checks": [],
                "outliers": [],
            },
            "left_out": [],
            "runtime": {"wall_s": wall_s, "cpu_s": cpu_s, "likelihood_calls": 1, "k_hat": None},
        }
    )


def draw(_: Job, checkpoint: Checkpoint) -> tuple[Any, Any]:
    from tests.service import drawn

    return drawn.job(), drawn.draws(checkpoint.chunk)
