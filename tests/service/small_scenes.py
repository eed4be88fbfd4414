"""Scene files of the tests of the command line."""

from pathlib import Path

import pytest

from tests.service.conftest import SCENE, SENSOR
from tests.service.said import written

SINE_WAVE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-3, 1e-3]}}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return written(tmp_path / "scene.json", {"sensor": SENSOR, "scene": SCENE})
