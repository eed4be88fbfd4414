"""Every recipe as it stands on its page, run against a running service."""

import contextlib
import json
import os
import queue
import re
import shlex
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from paho.mqtt import client as mqtt
from paho.mqtt.enums import CallbackAPIVersion

from benchmarks.ports import own_port
from service.cli import main
from service.demo.running import running_service

PAGE = (Path(__file__).parents[1] / "docs" / "recipes.md").read_text(encoding="utf-8")
MARK = "executed by tests/test_recipes.py"
SYSTEM: dict[str, Any] = {
    "sensor": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-5, 1e-3]}},
    "scene": {"crosstalk": [0.004, 0.02]},
}
FRAMES = [{"w1": 0.0242, "w2": 0.4230}, {"w1": 0.0162, "w2": 0.1711}, {"w1": 0.0, "w2": 0.0}]
RANGES = [0.7513, 1.2103, None]
WAIT_S = 60.0  # for what comes in milliseconds on an idle machine


def block(mark: str) -> str:
    found = re.search(rf"<!-- {mark} -->\n```\w*\n(.*?)\n```", PAGE, re.DOTALL)
    assert found is not None, mark
    return found[1] + "\n"


@pytest.fixture
def system(tmp_path: Path) -> Path:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SYSTEM))
    return path


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with running_service() as address:
        yield address


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler: install cc")
@pytest.mark.parametrize("flags", [[], ["-DHYBRIDTOF_FLOAT"]], ids=["double", "float"])
def test_c(flags: list[str], tmp_path: Path, system: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(system.parent)
    program, *words = shlex.split(block(f"command: {MARK}"))
    assert program == "hybridtof"
    assert main(words) == 0
    (tmp_path / "main.c").write_text(block("c: compiled and run by tests/test_recipes.py"))
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["cc", *strict, *flags, "main.c", "-o", "main", "-lm"], check=True)
    said = subprocess.run(["./main"], check=True, capture_output=True, text=True).stdout
    assert f"`{said.strip()}`" in PAGE


def lines_through(name: str, address: str, system: Path, folder: Path) -> list[str]:
    """What a recipe prints of frames of a steady object, one of which is none."""
    program = folder / "lines.py"
    program.write_text(block(f"{name}: {MARK}"))
    # a tracker needs an object: c0 c2 / (r^2 (r^2 + c1 r + c0)) at 0.75 m, and the crosstalk
    known = SYSTEM["scene"] | {"object": {"c0": 0.08, "c1": 0.05, "c2": 0.1}}
    system.write_text(json.dumps(SYSTEM | {"scene": known}))
    w2 = 0.08 * 0.1 / (0.75**2 * (0.75**2 + 0.05 * 0.75 + 0.08))
    steady = {"w1": 0.004 + w2 * 0.75 / 14.98962, "w2": 0.02 + w2}
    frames = [{"time_s": 0.1 * n, **steady} for n in range(12)]
    lines = [json.dumps(frame) for frame in frames]
    lines.insert(6, '{"time_s": 0.55, "w1": "x", "w2": 1}')
    run = subprocess.run(
        [sys.executable, str(program), str(system), address],
        input="".join(line + "\n" for line in lines), capture_output=True, text=True, check=True,
    )  # fmt: skip
    return run.stdout.splitlines()


def test_ndjson(address: str, system: Path, tmp_path: Path) -> None:
    answers = [json.loads(line) for line in lines_through("ndjson", address, system, tmp_path)]
    assert [answer["sequence"] for answer in answers] == list(range(1, 14))
    assert answers[6]["error"]["pointer"] == "/w1"
    assert answers[-1]["status"] == "unique"
    assert answers[-1]["range_m"] == pytest.approx(0.75, abs=3 * answers[-1]["sd_m"])


def test_websocket(address: str, system: Path, tmp_path: Path) -> None:
    said = lines_through("websocket", address, system, tmp_path)
    assert len(said) == 13
    assert said[6].endswith("/w1")
    assert re.fullmatch(r"0\.7[45]\d m, sd 0\.0\d\d m", said[-1])


@contextlib.contextmanager
def broker(folder: Path) -> Iterator[int]:
    """The broker of Debian on a port that nobody has."""
    command = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin")
    if command is None:
        pytest.skip("no MQTT broker: apt-get install mosquitto")
    port = own_port()
    settings = folder / "mosquitto.conf"
    settings.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    process = subprocess.Popen([command, "-c", str(settings)], stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + WAIT_S
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            except OSError:
                assert process.poll() is None
                assert time.monotonic() < end
                time.sleep(0.02)
        yield port
    finally:
        process.terminate()
        process.wait(timeout=WAIT_S)


def test_mqtt(address: str, system: Path, tmp_path: Path) -> None:
    code = block(f"mqtt: {MARK}")
    assert len([line for line in code.splitlines() if line.strip()]) <= 36
    program = tmp_path / "bridge.py"
    program.write_text(code)
    heard: queue.Queue[tuple[str, Any]] = queue.Queue()

    def until(topic: str) -> Any:
        while True:
            where, payload = heard.get(timeout=WAIT_S)
            if where == topic:
                return payload

    with broker(tmp_path) as port:
        listener = mqtt.Client(CallbackAPIVersion.VERSION2)
        listener.on_message = lambda _client, _data, message: heard.put(
            (message.topic, message.payload.decode())
        )
        listener.on_connect = lambda client, *_: client.subscribe("#")
        listener.connect("127.0.0.1", port)
        listener.loop_start()
        environment = os.environ | {"MQTT_PORT": str(port), "SERVICE": address}
        bridge = subprocess.Popen([sys.executable, str(program), str(system)], env=environment)
        try:
            sensor = json.loads(until("homeassistant/sensor/hybridtof_shelf/config"))
            # https://www.home-assistant.io/integrations/sensor.mqtt/
            assert sensor["device_class"] == "distance"
            assert sensor["unit_of_measurement"] == "m"
            assert sensor["device"]["identifiers"]
            assert until(sensor["availability_topic"]) == "online"
            for frame, range_m in zip(FRAMES, RANGES, strict=True):
                listener.publish("shelf/frame", json.dumps(frame))
                state = json.loads(until(sensor["state_topic"]))
                if range_m is None:
                    assert state["range_m"] is None
                    assert state["reason"]
                else:
                    assert state["range_m"] == pytest.approx(range_m, abs=1e-4)
            for junk in ("{", "[1]", '{"w1": 1}', '{"w1": "x", "w2": 1}'):
                listener.publish("shelf/frame", junk)
                assert json.loads(until(sensor["state_topic"]))["range_m"] is None
            bridge.kill()
            assert until(sensor["availability_topic"]) == "offline"
        finally:
            bridge.kill()
            bridge.wait(timeout=WAIT_S)
            listener.loop_stop()
            listener.disconnect()
