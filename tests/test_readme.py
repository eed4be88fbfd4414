"""What the README says is what the code does."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import httpx
import pytest

import hybridtof
from inference.realtime.registry import TECHNIQUES
from service.app import create_app
from service.cli import main
from service.commands import COMMANDS
from service.service_settings import ServiceSettings
from service.technique_table import END, START, technique_table
from simulator.scene_checks import check_scene

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TECHNIQUES_PAGE = (ROOT / "docs" / "techniques.md").read_text(encoding="utf-8")
DOCUMENTS = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "benchmarks" / "README.md",
]


def block(mark: str) -> str:
    """The code block below a mark."""
    found = re.search(rf"<!-- {mark} -->\n```\w*\n(.*?)\n```", README, re.DOTALL)
    assert found is not None
    return found[1]


def rounded(value: Any) -> Any:
    """Numbers to two digits more than an error bar has: what the README prints."""
    if isinstance(value, float):
        return float(f"{value:.2g}")
    if isinstance(value, list):
        return [rounded(item) for item in value]
    if isinstance(value, dict):
        return {name: rounded(item) for name, item in value.items()}
    return value


@pytest.mark.anyio
async def test_curl_example() -> None:
    words = shlex.split(block("executed by tests/test_readme.py"))
    assert words[:3] == ["curl", "-s", "http://127.0.0.1:8000/v1/estimates"]
    assert words[3] == "-H"
    assert words[5] == "-d"
    assert len(words) == 7
    name, _, value = words[4].partition(": ")
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(create_app(ServiceSettings(workers=1))),
        base_url="http://127.0.0.1:8000",
    ) as client:
        response = await client.post(
            words[2].removeprefix("http://127.0.0.1:8000"),
            content=words[6].encode(),
            headers={name: value},
        )
    assert response.status_code == 200
    (result,) = response.json()["results"]
    assert result["technique"] == response.json()["chosen"] == "background_cancelling"
    printed = json.loads(block("compared by tests/test_readme.py"))
    assert len(printed) == len(result["frames"])
    for shown, frame in zip(printed, result["frames"], strict=True):
        assert shown.keys() == frame.keys()
        for key, value in shown.items():
            if key in ("range_m", "roots_m") and value is not None:
                # five digits are printed
                assert frame[key] == pytest.approx(value, rel=1e-4)
            else:
                assert rounded(frame[key]) == rounded(value), key


def test_python_example(capsys: pytest.CaptureFixture[str]) -> None:
    code = block("python: executed by tests/test_readme.py")
    exec(compile(code, "README.md", "exec"), {})  # noqa: S102  # our own text
    printed = capsys.readouterr().out.strip()
    assert f"prints `{printed}`" in README
    assert len(code.splitlines()) <= 10
    # through the front door alone
    assert set(re.findall(r"^(?:import|from) (\w+)", code, re.MULTILINE)) == {"numpy", "hybridtof"}


def test_command_line_example(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The files are those that the text describes: what the Python example holds."""
    code = block("python: executed by tests/test_readme.py").splitlines()
    names: dict[str, Any] = {}
    exec("\n".join(code[:-2]), names)  # noqa: S102  # our own text
    documents = {
        name: names[name].model_dump(mode="json", exclude_unset=True)
        for name in ("sensor", "scene")
    }
    monkeypatch.chdir(tmp_path)
    Path("scene.json").write_text(json.dumps(documents), encoding="utf-8")
    rows = [f"{w1},{w2}" for w1, w2 in zip(names["w1"], names["w2"], strict=True)]
    Path("frames.csv").write_text("\n".join(["w1,w2", *rows]) + "\n", encoding="utf-8")
    program, *words = shlex.split(block("command: executed by tests/test_readme.py"))
    assert program == "hybridtof"
    assert main(words) == 0
    capsys.readouterr()
    shown = block("output: compared by tests/test_readme.py").splitlines()
    found = Path("ranges.csv").read_text(encoding="utf-8").splitlines()
    assert found[0] == shown[0]
    assert len(found) == len(shown) == 4
    for line, cut in zip(found[1:], shown[1:], strict=True):
        for value, short in zip(line.split(","), cut.split(","), strict=True):
            if "." in short:
                assert float(value) == pytest.approx(float(short), abs=0.51e-4)
            else:
                assert value == short


def test_forms_of_sensors_scenes_and_frames() -> None:
    """What docs/scenes.md shows is taken as it stands."""
    text = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
    shown = [json.loads(found) for found in re.findall(r"```json\n(.*?)\n```", text, re.DOTALL)]
    sensors = [hybridtof.parse_sensor(form) for form in shown if "kind" in form]
    assert [sensor.kind for sensor in sensors] == ["pulsed", *["sine_wave"] * 3]
    (columns,) = (form for form in shown if "w1" in form)
    assert len(hybridtof.frames_from_columns(sensors[0], columns)) == 2
    (scene,) = (form for form in shown if "object" in form)
    for sensor in sensors:
        check_scene(sensor, hybridtof.parse_scene(scene))
    assert len(shown) == 6


def test_front_page_is_short() -> None:
    assert len(README.splitlines()) <= 120
    assert README.count("![") <= 2


def test_table_of_techniques() -> None:
    shown = TECHNIQUES_PAGE.split(START)[1].split(END)[0].strip()
    assert shown == technique_table(), "run `make readme`"
    assert all(f"| `{name}` |" in shown for name in TECHNIQUES)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)", path.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (path.parent / target).exists(), target


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_commands_exist(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path.read_text(encoding="utf-8")
    for module in re.findall(r"python -m (benchmarks[.\w]*\w)\b(?!\.<)", text):
        place = ROOT / module.replace(".", "/")
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists(), module
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"`make ([a-z-]+)", text):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    for command in set(re.findall(r"hybridtof ([a-z]+)\b", text)) & {"serve", "report", "demo"}:
        with pytest.raises(SystemExit) as caught:
            main([command, "--help"])
        assert caught.value.code == 0
    capsys.readouterr()
    assert len(COMMANDS) >= 7


def test_picture_is_small() -> None:
    for name in ("demo.png", "report.png"):
        assert (ROOT / "docs" / name).stat().st_size < 250_000
