"""No bad request is answered otherwise than it was: status, problem type and pointers."""

import asyncio
import json

from tests.contract.bad_requests import ANSWERS, answers, requests


def test_answers_are_those_recorded() -> None:
    recorded = json.loads(ANSWERS.read_text(encoding="utf-8"))
    assert len(recorded) >= 100
    assert recorded.keys() == requests().keys()
    assert asyncio.run(answers()) == recorded


def test_each_is_refused() -> None:
    for name, answer in json.loads(ANSWERS.read_text(encoding="utf-8")).items():
        assert 400 <= answer["status"] < 500, name
        assert answer["type"].startswith("urn:hybridtof:problem:"), name
