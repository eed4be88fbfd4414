"""What compose.yaml says, as far as that can be run without Docker."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from benchmarks.cluster import Cluster
from service.service_settings import ServiceSettings
from tests.service.test_server import environment, server

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: hybridtof[cluster]")
ROOT = Path(__file__).parents[2]


def compose(**variables: str) -> Any:
    """The file with variables put in as Docker does."""
    return _filled(yaml.safe_load((ROOT / "compose.yaml").read_text()), variables)


def _filled(value: Any, variables: dict[str, str]) -> Any:
    if isinstance(value, dict):
        return {name: _filled(one, variables) for name, one in value.items()}
    if isinstance(value, list):
        return [_filled(one, variables) for one in value]
    if isinstance(value, str):
        return re.sub(r"\$\{(\w+):-([^}]*)\}", lambda m: variables.get(m[1]) or m[2], value)
    return value


def cluster_env() -> dict[str, str]:
    lines = (ROOT / "cluster.env").read_text().splitlines()
    return dict(line.split("=", 1) for line in lines if not line.startswith("#"))


def certified(folder: Path) -> dict[str, str]:
    """Make the certificate as the file does, in a folder; Dask's settings in the file."""
    services = compose()["services"]
    part = services["certificate"]
    command = [word.replace("/var/lib/tls", str(folder)) for word in part["command"]]
    subprocess.run((*part["entrypoint"], *command), check=True, capture_output=True)
    return {
        name: value.replace("/var/lib/tls", str(folder))
        for name, value in services["scheduler"]["environment"].items()
    }


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_one_certificate_for_all_parts(tmp_path: Path) -> None:
    """Made once, for whoever talks to the scheduler; the parts are run in test_cluster.py."""
    settings = certified(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert {value for value in settings.values() if value.startswith("/")} == {
        str(tmp_path / name) for name in made
    }
    certified(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == made
    services = compose()["services"]
    for name in ("hybridtof", "scheduler", "worker"):
        assert services["scheduler"]["environment"].items() <= services[name]["environment"].items()
        assert any(volume.startswith("tls:/var/lib/tls") for volume in services[name]["volumes"])


def test_parts_wait_for_what_they_need() -> None:
    """Also where the profile leaves the others out: they are waited for where they are there."""
    services = compose()["services"]
    waits = services["hybridtof"]["depends_on"]
    assert waits.keys() == {"postgres", "scheduler"}
    assert not any(one["required"] for one in waits.values())
    assert "healthcheck" in services["postgres"]
    for name in ("scheduler", "worker"):
        assert "certificate" in services[name]["depends_on"]
    assert services["worker"]["scale"] == 2


def test_profiles() -> None:
    services = compose()["services"]
    assert {name for name, one in services.items() if "profiles" not in one} == {"hybridtof"}
    assert {p for one in services.values() for p in one.get("profiles", ())} == {
        cluster_env()["COMPOSE_PROFILES"]
    }
    assert all("ports" not in one for name, one in services.items() if name != "hybridtof")


def test_no_volume_hides_the_machine_code_of_the_image() -> None:
    cache = re.search(r"NUMBA_CACHE_DIR=(\S+)", (ROOT / "Dockerfile").read_text())
    assert cache is not None
    for one in compose()["services"].values():
        assert all(volume.split(":")[1] != cache[1] for volume in one.get("volumes", ()))


def test_commands_of_the_cluster_are_those_that_are_tested() -> None:
    services = compose(**cluster_env())["services"]
    address = cluster_env()["HYBRIDTOF_EXECUTOR"]
    for name in ("scheduler", "worker"):
        given = [*services[name]["entrypoint"], *services[name]["command"]]
        assert given == ["python", *Cluster.command(name, address)[1:]]


def test_settings() -> None:
    for variables, executor in (({}, "local"), (cluster_env(), "tls://scheduler:8786")):
        given = compose(**variables)["services"]["hybridtof"]["environment"]
        settings = ServiceSettings.from_environment(given)
        assert settings.executor == executor
        assert settings.database is not None
        assert settings.database.startswith("sqlite" if executor == "local" else "postgresql")


@pytest.mark.slow
def test_a_key_then_the_service(tmp_path: Path) -> None:
    """The two commands that the file begins with."""
    given = compose()["services"]["hybridtof"]["environment"]
    here = {
        name: value.replace("/var/lib/hybridtof", str(tmp_path))
        for name, value in given.items()
        if name.startswith("HYBRIDTOF_")
    }
    hybridtof = (sys.executable, "-m", "service.cli")
    made = subprocess.run(
        (*hybridtof, "keys", "create", "me"),
        env=environment(**here),
        check=True,
        capture_output=True,
    )
    command = re.search(r"CMD (\[\"serve\".*\])", (ROOT / "Dockerfile").read_text())
    assert command is not None
    arguments = [word.replace("8000", "0") for word in json.loads(command[1])]
    with server(*hybridtof, *arguments, **here) as (_, address):
        local = address.replace("0.0.0.0", "127.0.0.1")  # noqa: S104
        assert httpx.get(f"{local}/v1/techniques").status_code == 401
        key = json.loads(made.stdout)["key"]
        answer = httpx.get(f"{local}/v1/techniques", headers={"Authorization": f"Bearer {key}"})
        assert answer.status_code == 200
