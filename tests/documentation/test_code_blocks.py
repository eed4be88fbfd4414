"""Names, commands, options, routes and settings that pages show are those that there are."""

import argparse
import ast
import functools
import importlib
import inspect
import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import hybridtof
from service.app import create_app
from service.cli import command_line
from service.service_settings import PREFIX, ServiceSettings
from simulator.errors import HybridTofError
from tests.documentation.pages import PAGES, ROOT, blocks, snippets

SHELL = {"sh", "bash"}
# what the text of a command has in the place of a user's own word
PLACEHOLDER = re.compile(r"[|<>\[\]{}]|\.\.|\b[A-Z]{2,}\b")
# set for others than the service
OTHER_VARIABLES = {"HYBRIDTOF_FLOAT", "HYBRIDTOF_UNIQUE", "HYBRIDTOF_"}
FORMS = {"pulsed", "sine_wave"}
OURS = ("hybridtof", "service", "inference", "simulator")
ids = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def commands() -> dict[str, argparse.ArgumentParser]:
    (actions,) = (
        action
        for action in command_line()._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    return dict(actions.choices)


COMMANDS = commands()


def options(name: str) -> set[str]:
    parser = COMMANDS[name]
    below = [
        sub
        for action in parser._actions
        if isinstance(action, argparse._SubParsersAction)
        for sub in action.choices.values()
    ]
    return {word for one in (parser, *below) for word in one._option_string_actions}


def shell_lines(page: Path) -> Iterator[str]:
    for block in blocks(page):
        if block.language in SHELL or not block.language:
            yield from block.text.replace("\\\n", " ").splitlines()


@ids
def test_python_is_python_and_names_are_public(page: Path) -> None:
    for block in blocks(page):
        if block.language != "python" or page.name == "api.md":
            continue
        tree = ast.parse(block.text, page.name)
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and _is(node.value, "hybridtof"):
                assert node.attr in hybridtof.__all__, ast.unparse(node)
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                _check_call(node, node.func)
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS:
                module = importlib.import_module(node.module or "")
                for name in node.names:
                    assert hasattr(module, name.name), ast.unparse(node)


def _is(node: ast.expr, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _check_call(call: ast.Call, function: ast.Attribute) -> None:
    """Arguments by name are arguments that there are."""
    if not _is(function.value, "hybridtof"):
        return
    known = inspect.signature(getattr(hybridtof, function.attr)).parameters
    for keyword in call.keywords:
        assert keyword.arg is None or keyword.arg in known, ast.unparse(call)


@ids
def test_commands_and_options(page: Path) -> None:
    for line in [*shell_lines(page), *snippets(page)]:
        for found in re.findall(r"(?:^|[|;(] ?|\b[A-Z_]+=\S* )hybridtof ([^|;`]*)", line):
            words = found.split()
            if not words or not re.fullmatch(r"[a-z]+", words[0]):
                continue
            assert words[0] in COMMANDS, line
            for word in re.findall(r"(?<!\S)\[?(--[a-z-]+)", found):
                assert word in options(words[0]) | {"--version"}, line


@ids
def test_command_lines_are_taken(page: Path) -> None:
    """Lines of the shell, without anything to be put in, are what the parser takes."""
    for block in blocks(page):
        if block.language not in SHELL:
            continue
        for line in block.text.replace("\\\n", " ").splitlines():
            found = re.search(r"(?:^|\| |=\S+ )hybridtof ([^|]*)$", line)
            if found is None or PLACEHOLDER.search(found[1].split(" > ")[0]):
                continue
            command_line().parse_args(shlex.split(found[1].split(" > ")[0].split(" < ")[0]))


@functools.cache
def routes() -> tuple[str, ...]:
    paths = create_app(ServiceSettings(workers=1)).openapi()["paths"]
    known = [re.sub(r"\{\w+\}", "{}", path) for path in paths]
    return (*known, "/v1", "/v1/streams/{}/live")  # a WebSocket is in no OpenAPI document


@ids
def test_routes(page: Path) -> None:
    if page.name == "CHANGELOG.md":  # it speaks of what was
        return
    text = page.read_text(encoding="utf-8")
    for path in re.findall(r"(?<![\w.])(/(?:v1|health)(?:/[\w{}]+)*)", text):
        parts = path.split("/")
        assert any(
            len(parts) == len(other.split("/"))
            and all(
                theirs in ("{}", ours) for ours, theirs in zip(parts, other.split("/"), strict=True)
            )
            for other in routes()
        ), path


@ids
def test_settings(page: Path) -> None:
    known = {f"{PREFIX}{name.upper()}" for name in ServiceSettings.model_fields}
    text = page.read_text(encoding="utf-8")
    assert set(re.findall(r"\bHYBRIDTOF_\w*", text)) <= known | OTHER_VARIABLES


@ids
def test_json_is_json(page: Path) -> None:
    """And sensors, scenes and members of scenes among it are taken."""
    for block in blocks(page):
        if block.language != "json" or page.name == "README.md":
            continue
        for text in [block.text] if "\n" in block.text else block.text.splitlines():
            shown = _json(text)
            for form in shown:
                if form.get("kind") in FORMS:
                    hybridtof.parse_sensor(form)
                if "sensor" in form:
                    hybridtof.parse_sensor(form["sensor"])
                if "scene" in form:
                    hybridtof.parse_scene(form["scene"])
                if form.keys() <= {"object", "crosstalk", "background", "range_m"}:
                    hybridtof.parse_scene(form)


def _json(text: str) -> list[dict[str, object]]:
    """One value, or one a line."""
    try:
        values = [json.loads(text)]
    except json.JSONDecodeError:
        values = [json.loads(line) for line in text.splitlines()]
    return [value for value in values if isinstance(value, dict)]


@ids
def test_make_targets_and_modules(page: Path) -> None:
    if page.name == "CHANGELOG.md":
        return
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for line in [*shell_lines(page), *snippets(page)]:
        for target in re.findall(r"^make ([a-z-]+)", line):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
        for module, rest in re.findall(r"python -m (benchmarks[.\w]*\w)([^|;#]*)", line):
            source = _source(module)
            for option in re.findall(r" (--[a-z-]+)", rest):
                assert f'"{option}"' in source, f"{module} {option}"


def _source(module: str) -> str:
    """What a benchmark is made of, with what it takes its options from."""
    place = ROOT / module.replace(".", "/")
    files = [place.with_suffix(".py")] if place.with_suffix(".py").exists() else []
    files += list(place.glob("*.py"))
    assert files, module
    return "".join(file.read_text(encoding="utf-8") for file in files)


@pytest.mark.parametrize(
    ("check", "text"),
    [
        (test_python_is_python_and_names_are_public, "```python\nhybridtof.ask(1)\n```"),
        (test_python_is_python_and_names_are_public, "```python\nhybridtof.infer(wait=1)\n```"),
        (test_python_is_python_and_names_are_public, "```python\nif\n```"),
        (test_commands_and_options, "`hybridtof ask`"),
        (test_commands_and_options, "`hybridtof estimate FRAMES --sceen FILE`"),
        (test_command_lines_are_taken, "```sh\nhybridtof estimate --scene a.json\n```"),
        (test_routes, "`GET /v1/posterior/{id}`"),
        (test_settings, "`HYBRIDTOF_WORKER`"),
        (test_json_is_json, '```json\n{"kind": "pulsed"}\n```'),
        (test_json_is_json, "```json\n{1}\n```"),
        (test_make_targets_and_modules, "`make tea`"),
        (test_make_targets_and_modules, "`python -m benchmarks.realtime --tea`"),
    ],
)
def test_mistakes_are_seen(check: Callable[[Path], None], text: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text + "\n", encoding="utf-8")
    seen = (AssertionError, AttributeError, SyntaxError, SystemExit, ValueError, HybridTofError)
    with pytest.raises(seen):
        check(page)
