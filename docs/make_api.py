"""``docs/api.md``, made from the docstrings of the public names.

python docs/make_api.py > docs/api.md
"""

import dataclasses
import inspect
import re
import sys
import textwrap
import typing
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pydantic

import hybridtof

GROUPS = {
    "What is given": (
        "parse_sensor",
        "parse_scene",
        "frames_from_columns",
        "read_frames",
        "Frames",
    ),
    "Simulation": ("simulate", "RadialTrajectory", "SampledTrajectory"),
    "Ranges at once": ("estimate", "all_roots", "plan", "Status"),
    "Posteriors": ("infer", "SamplerSettings", "calibrated_scene", "fold"),
    "What could be told": ("identifiability",),
    "Streams": (
        "track",
        "tracker",
        "step",
        "TrackingSettings",
        "state_to_bytes",
        "state_from_bytes",
    ),
    "Errors": ("HybridTofError", "InvalidInputError", "RefusedError"),
    "Version": ("__version__",),
}
# of these the types of what they return are described with all that they hold
ANSWERS = ("simulate", "plan", "estimate", "infer", "track")
# and of these the type itself
OUTERMOST = ("identifiability", "tracker", "step")

HEAD = """# The public names

Made from the docstrings by `make api`; do not edit. `import hybridtof` has these names and no
others; what the functions return is described [below](#what-comes-back). Arrays are numpy arrays,
shapes stand beside them, units are SI. The forms of sensors, scenes and frames are in
[scenes](scenes.md), the equations in [model](model.md), the words in the [glossary](glossary.md).
"""


def main() -> None:
    """Write the page to standard output."""
    sys.stdout.write(page())


def page() -> str:
    """Return the page in Markdown."""
    parts = [HEAD]
    for title, names in GROUPS.items():
        parts.append(f"## {title}\n")
        parts += [_entry(name, getattr(hybridtof, name)) for name in names]
    parts.append("## What comes back\n")
    parts += [_entry(answer.__name__, answer) for answer in answers()]
    return "\n".join(parts).rstrip() + "\n"


def answers() -> list[type]:
    """Return the types of what the public functions return, those that are no public names."""
    found: dict[type, None] = {}
    for name in ANSWERS:
        for kind in _types(_hints(getattr(hybridtof, name))["return"]):
            _follow(kind, found)
    for name in OUTERMOST:
        for kind in _types(_hints(getattr(hybridtof, name))["return"]):
            found.setdefault(kind)
    public = {id(getattr(hybridtof, name)) for name in hybridtof.__all__}
    return [kind for kind in found if id(kind) not in public]


def _hints(thing: Any) -> dict[str, Any]:
    return typing.get_type_hints(thing)


def _types(annotation: Any) -> Iterator[type]:
    """Walk through the classes of ours in an annotation."""
    if isinstance(annotation, type) and not typing.get_args(annotation):
        if annotation.__module__.partition(".")[0] in ("simulator", "inference"):
            yield annotation
        return
    for argument in typing.get_args(annotation):
        yield from _types(argument)


def _follow(kind: type, found: dict[type, None]) -> None:
    if kind in found:
        return
    found[kind] = None
    if dataclasses.is_dataclass(kind):
        hints = _hints(kind)
        for field in dataclasses.fields(kind):
            for inner in _types(hints[field.name]):
                _follow(inner, found)


def _entry(name: str, thing: Any) -> str:
    if name == "__version__":
        return f"### `{name}`\n\nThe version of the installed distribution.\n"
    if isinstance(thing, ModuleType):
        return _namespace(name, thing)
    lines = [f"### `{name}`\n", f"```python\n{_signature(name, thing)}\n```\n"]
    lines.append(_markdown(inspect.getdoc(thing) or ""))
    if inspect.isclass(thing):
        lines += _members(thing)
    return "\n".join(lines)


def _namespace(name: str, module: ModuleType) -> str:
    """Describe a module that is a public name: its own words, then its functions."""
    lines = [f"### `{name}`\n", _markdown(inspect.getdoc(module) or "")]
    functions = [part for part in module.__all__ if inspect.isfunction(getattr(module, part))]
    for part in functions:
        function = getattr(module, part)
        lines.append(f"#### `{name}.{part}`\n")
        lines.append(f"```python\n{name}.{_signature(part, function)}\n```\n")
        lines.append(_markdown(inspect.getdoc(function) or ""))
    return "\n".join(lines)


def _signature(name: str, thing: Any) -> str:
    if inspect.isclass(thing) and issubclass(thing, Exception):
        return f"class {name}({', '.join(base.__name__ for base in thing.__bases__)})"
    if inspect.isclass(thing) and issubclass(thing, pydantic.BaseModel):
        fields = [
            key if field.is_required() else f"{key}={field.default!r}"
            for key, field in thing.model_fields.items()
        ]
        return _wrapped(f"class {name}(", fields)
    if inspect.isclass(thing) and not dataclasses.is_dataclass(thing):
        return f"class {name}({', '.join(base.__name__ for base in thing.__bases__)})"
    arguments = [
        str(parameter.replace(annotation=inspect.Parameter.empty))
        for parameter in inspect.signature(thing).parameters.values()
    ]
    return _wrapped(f"class {name}(" if inspect.isclass(thing) else f"{name}(", arguments)


def _wrapped(start: str, arguments: list[str]) -> str:
    line = f"{start}{', '.join(arguments)})"
    if len(line) <= 100:
        return line
    return start + "\n" + "".join(f"    {argument},\n" for argument in arguments) + ")"


def _members(kind: type) -> list[str]:
    """Describe public properties and methods that the class itself defines."""
    lines = []
    for key, member in vars(kind).items():
        if key.startswith("_") or hasattr(
            getattr(kind, "__dataclass_fields__", {}).get(key), "name"
        ):
            continue
        if issubclass(kind, pydantic.BaseModel) and key in ("model_config",):
            continue
        call = "" if isinstance(member, property) else "()"
        function = member.fget if isinstance(member, property) else member
        function = getattr(function, "__func__", function)
        if not inspect.isfunction(function) or not function.__doc__:
            continue
        summary = " ".join((inspect.getdoc(function) or "").split("\n\n")[0].split())
        lines.append(f"- `.{key}{call}`: {_inline(summary)}")
    return [*lines, ""] if lines else []


def _markdown(docstring: str) -> str:
    """Turn a numpydoc docstring into Markdown."""
    lines = docstring.splitlines()
    out: list[str] = []
    section = ""
    index = 0
    while index < len(lines):
        line = lines[index]
        under = lines[index + 1] if index + 1 < len(lines) else ""
        if line and re.fullmatch(r"-{3,}", under) and len(under) == len(line):
            section = line
            out += [f"**{line}**", ""]
            index += 2
            continue
        if line.rstrip() == "::":
            block, index = _indented(lines, index + 1)
            out += ["```", *textwrap.dedent("\n".join(block)).strip("\n").splitlines(), "```", ""]
            continue
        if section in ("Parameters", "Attributes", "Returns", "Raises", "Yields") and line.strip():
            block, index = _indented(lines, index + 1)
            words = " ".join(" ".join(block).split())
            out.append(_item(line, words, section))
            if index >= len(lines) or not lines[index].strip():
                out.append("")
            continue
        if not line.strip():
            if out and out[-1] != "":
                out.append("")
        else:
            out.append(_inline(line))
        index += 1
    return "\n".join(out).rstrip() + "\n"


def _indented(lines: list[str], index: int) -> tuple[list[str], int]:
    block = []
    while index < len(lines) and (not lines[index].strip() or lines[index].startswith("    ")):
        if not lines[index].strip() and not any(
            later.startswith("    ") for later in lines[index + 1 : index + 2]
        ):
            break
        block.append(lines[index])
        index += 1
    return block, index


def _item(head: str, words: str, section: str) -> str:
    name, colon, kind = head.partition(" : ")
    if section in ("Raises", "Returns", "Yields") and not colon:
        return f"- `{head}`" + (f": {_inline(words)}" if words else "")
    text = f"- `{name}`" + (f" : {_inline(kind)}" if colon else "")
    return text + (f". {_inline(words)}" if words else "")


def _inline(text: str) -> str:
    """Keep code as code: double backticks become single ones."""
    return re.sub(r"``([^`]+)``", r"`\1`", text)


if __name__ == "__main__":
    main()
