"""A joint fit that never ends, for processes of a service, which are soon there again."""

import contextlib
import os
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from inference import run
from service.answers.answering import answer_parts
from service.answers.in_parts import AnswerPart
from service.messages.answering import message_parts
from service.requests import EstimateRequest

SLOW = "joint_fit"


@contextlib.contextmanager
def _endless(folder: str) -> Iterator[None]:
    """Let the joint fit never end, and note the processes that it is in."""
    solved = run._solved

    def slow(sensor: Any, scene: Any, frames: Any, name: str) -> Any:
        if name == SLOW:
            (Path(folder) / str(os.getpid())).touch()
            while True:
                pass
        return solved(sensor, scene, frames, name)

    with mock.patch.object(run, "_solved", slow):
        yield


def slow_answer(
    folder: str, request: EstimateRequest, *asked: Any
) -> Generator[AnswerPart, None, AnswerPart]:
    with _endless(folder):
        return (yield from answer_parts(request, *asked))


def slow_messages(
    folder: str, request: EstimateRequest, *asked: Any
) -> Generator[bytes, None, bytes]:
    with _endless(folder):
        return (yield from message_parts(request, *asked))
