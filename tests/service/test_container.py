"""What the Dockerfile promises, as far as that can be seen without building it."""

import re
from pathlib import Path
from typing import Any

import pytest

from benchmarks import container

ROOT = Path(__file__).parents[2]
STAGES = dict(
    re.findall(
        r"^FROM \S+ AS (\w+)\n((?:(?!FROM ).*\n?)*)",
        (ROOT / "Dockerfile").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
)
GOOD: dict[str, Any] = {
    "root_writable": False,
    "store_was_empty": True,
    "store_writable": True,
    "kernels_made": 0,
    "compilers": [],
    "pip": False,
    "converged": True,
    "user": 10001,
    "estimate_s": 2.0,
}


def test_stages() -> None:
    assert list(STAGES) == ["base", "build", "test", "runtime"]
    runtime = STAGES["runtime"]
    # nothing is installed there: it comes from the stage that has what installs
    assert not re.search(r"\b(pip|apt-get|venv)\b", runtime.replace("/opt/hybridtof", ""))
    # machine code is made by the user that reads it, for any processor
    assert runtime.index("USER hybridtof") < runtime.index("RUN hybridtof warm")
    assert runtime.index("NUMBA_CPU_NAME=generic") < runtime.index("RUN hybridtof warm")
    assert re.findall(r"^VOLUME (.*)$", runtime, re.MULTILINE) == ["/var/lib/hybridtof"]
    assert "/health/ready" in runtime
    assert "pytest" in STAGES["test"]


def test_settings_of_pip_are_a_secret_of_the_build() -> None:
    """Of every step that installs from an index, and of no other."""
    for text in STAGES.values():
        for step in re.findall(r"^RUN ((?:.*\\\n)*.*)$", text, re.MULTILINE):
            assert ("--require-hashes" in step) == ("--mount=type=secret,id=pip" in step), step


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("root_writable", True),
        ("store_writable", False),
        ("kernels_made", 3),
        ("compilers", ["cc"]),
        ("pip", True),
        ("user", 0),
        ("estimate_s", 3.1),
    ],
)
def test_faults_are_seen(name: str, value: object) -> None:
    assert container.faults(GOOD) == []
    assert len(container.faults(GOOD | {name: value})) == 1


def test_an_engine_that_does_not_work_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Docker without its daemon, for instance."""
    monkeypatch.setattr("shutil.which", lambda name: name)
    monkeypatch.setattr(container, "ASKS", {"docker": ("false",), "buildah": ("true",)})
    assert container.engine() == "buildah"
    monkeypatch.setattr(container, "ASKS", {"docker": ("false",)})
    assert container.engine() is None
