"""Commands as they are typed, and what they say."""

import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from service.cli import main

SINE_WAVE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-3, 1e-3]}}
CSV = "time_s,w1,w2\n0.0,0.021,1.71\n0.1,0.022,1.63\n0.2,0.023,1.55\n"


def written(path: Path, content: Any) -> Path:
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


class Said:
    """What a command said, and how it ended."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> None:
        try:
            self.code: Any = main([str(argument) for argument in arguments])
        except SystemExit as end:
            self.code = end.code
        self.out, self.err = capsys.readouterr()

    @property
    def frames(self) -> list[dict[str, Any]]:
        frames: list[dict[str, Any]] = json.loads(self.out)["results"][0]["frames"]
        return frames


def given(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
