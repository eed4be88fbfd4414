"""Measures of a source tree: what is written how often, and how long its argument lists are.

Run ``python -m benchmarks.measures [PATH] [--against PATH] [--where]``; PATH holds the packages
``simulator``, ``inference`` and ``service``, and is this repository if left out. Two trees are
compared by ``git worktree add /tmp/before COMMIT`` and ``--against /tmp/before``.

Nothing is imported: sources are parsed. The first six rows are counts by markers, stated below and
in the table, which find the places that were there at commit 35737d6 and what took their place;
a place under another name, or in another form, is not seen. Read the list (``--where``) with them.
"""

import argparse
import ast
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = ["MEASURES", "Tree", "main"]

Function = ast.FunctionDef
_MOST_LINES = 300
_MANY_ARGUMENTS = 10
_TEMPLATE = 3
_SLOPE_KERNELS = {"object_slopes", "background_slopes"}
# optics has electronics of its own: photons and charge, not the two readings of a frame
_NOT_READINGS = ("simulator/optics",)


class Tree:
    """The parsed files of some packages below a path."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.files = {
            path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
            for package in ("simulator", "inference", "service")
            for path in sorted((root / package).rglob("*.py"))
        }
        self.modules = {name: ast.parse(text) for name, text in self.files.items()}

    def below(self, *packages: str) -> Iterator[tuple[str, ast.Module]]:
        """Yield the files of some packages with their syntax trees."""
        for name, module in self.modules.items():
            if name.startswith(tuple(f"{package}/" for package in packages)):
                yield name, module

    def functions(self, *packages: str) -> Iterator[tuple[str, Function]]:
        """Yield every function, methods and inner ones too, with its file."""
        for name, module in self.below(*packages):
            for node in ast.walk(module):
                if isinstance(node, ast.FunctionDef):
                    yield name, node


def _word(node: ast.AST) -> str:
    """Return the last name of an expression: b of a.b, a of a[i]."""
    if isinstance(node, ast.Attribute):
        return node.attr
    if isinstance(node, ast.Subscript):
        return _word(node.value)
    return node.id if isinstance(node, ast.Name) else ""


def _words(node: ast.AST) -> set[str]:
    return {_word(part) for part in ast.walk(node)} - {""}


def _products(function: Function) -> Iterator[ast.BinOp]:
    for node in ast.walk(function):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            yield node


def _arguments(function: Function) -> list[str]:
    given = function.args
    return [arg.arg for arg in (*given.posonlyargs, *given.args, *given.kwonlyargs)]


def _calls(function: Function) -> set[str]:
    return {_word(node.func) for node in ast.walk(function) if isinstance(node, ast.Call)}


def covariances(tree: Tree) -> list[str]:
    """Functions that multiply the shot noise by the size of something."""
    found = []
    for name, function in tree.functions("simulator", "inference"):
        if name.startswith(_NOT_READINGS):
            continue
        for product in _products(function):
            factors = [_words(product.left), _words(product.right)]
            noisy = [any(word.startswith("shot") for word in words) for words in factors]
            light = [any(_is_light(word) for word in words) for words in factors]
            if (noisy[0] and light[1]) or (noisy[1] and light[0]):
                found.append(f"{name}: {function.name}")
                break
    return found


def _is_light(word: str) -> bool:
    return bool(re.match(r"abs|m1|m2|mean|raw|frames|signal|light", word))


def whiteners(tree: Tree) -> list[str]:
    """Functions that are named for whitening and take a root, or invert, themselves."""
    return [
        f"{name}: {function.name}"
        for name, function in tree.functions("simulator", "inference")
        if "whiten" in function.name
        and _calls(function) & {"sqrt", "cholesky", "inv", "solve_triangular", "eigh"}
    ]


def jacobians(tree: Tree) -> list[str]:
    """Functions of inference, its techniques' curves apart, that differentiate mean readings.

    They call the slope kernels of the simulator, write 2 r + c1 themselves, or are named for a
    sensitivity.
    """
    found = []
    for name, function in tree.functions("inference"):
        if name.startswith("inference/realtime"):
            continue
        own = any(
            isinstance(node, ast.BinOp)
            and isinstance(node.op, ast.Add)
            and re.match(r"[cd]1", _word(node.right))
            and isinstance(node.left, ast.BinOp)
            and isinstance(node.left.left, ast.Constant)
            and node.left.left.value in (2, 2.0)
            for node in ast.walk(function)
        )
        if _calls(function) & _SLOPE_KERNELS or own or function.name == "sensitivity":
            found.append(f"{name}: {function.name}")
    return found


def row_loops(tree: Tree) -> list[str]:
    """Functions of inference that open rows of crosstalk and of background one by one."""
    return [
        f"{name}: {function.name}"
        for name, function in tree.functions("inference")
        if {"crosstalks", "backgrounds"} <= _words(function) | set(_arguments(function))
        and any(
            isinstance(node, ast.Subscript | ast.Call) and _opens(node)
            for node in ast.walk(function)
        )
    ]


def _opens(node: ast.Subscript | ast.Call) -> bool:
    if isinstance(node, ast.Subscript):
        return _word(node.value) in ("crosstalks", "backgrounds")
    names = {_word(argument) for argument in node.args}
    return bool(names & {"crosstalks", "backgrounds"}) and any(
        isinstance(argument, ast.Name) and len(argument.id) == 1 for argument in node.args
    )


def _files_defining(pattern: str) -> Callable[[Tree], list[str]]:
    def of(tree: Tree) -> list[str]:
        return sorted(
            {name for name, f in tree.functions("inference") if re.search(pattern, f.name)}
        )

    return of


def long_argument_lists(tree: Tree) -> list[str]:
    """Functions of inference with ten arguments or more."""
    return [
        f"{name}: {function.name} ({len(_arguments(function))})"
        for name, function in tree.functions("inference")
        if len(_arguments(function)) >= _MANY_ARGUMENTS
    ]


def bare_indices(tree: Tree) -> list[str]:
    """Lines of inference that take item 2 to 9 of something by a bare number, x[3]."""
    return [
        f"{name}:{i}"
        for name, _ in tree.below("inference")
        for i, line in enumerate(tree.files[name].splitlines(), 1)
        if re.search(r"\[[2-9]\]", line)
    ]


def splats(tree: Tree) -> list[str]:
    """Calls in inference that spread a list[Any] over a function's arguments."""
    found = []
    for name, function in tree.functions("inference"):
        untyped = {
            _word(node.target)
            for node in ast.walk(function)
            if isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation) == "list[Any]"
        }
        found += [
            f"{name}:{node.lineno}"
            for node in ast.walk(function)
            if isinstance(node, ast.Call)
            and any(isinstance(a, ast.Starred) and _word(a.value) in untyped for a in node.args)
        ]
    return found


def long_files(tree: Tree) -> list[str]:
    """Files of inference and service above 300 lines."""
    return [
        f"{name} ({len(tree.files[name].splitlines())})"
        for name, _ in tree.below("inference", "service")
        if len(tree.files[name].splitlines()) > _MOST_LINES
    ]


def shared_names(tree: Tree) -> list[str]:
    """Public functions and classes of inference whose name stands in several of its files.

    A name that three files of one folder share is the template of that folder, and no accident;
    nor is one of a file beside which another has the same by arrays.
    """
    places: dict[str, set[str]] = defaultdict(set)
    for name, module in tree.below("inference"):
        if name.endswith("_by_arrays.py"):
            continue
        for node in module.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].add(name)
    return [
        f"{word}: {', '.join(sorted(files))}"
        for word, files in sorted(places.items())
        if len(files) > 1 and not _is_template(files)
    ]


def _is_template(files: set[str]) -> bool:
    folders = [Path(name).parent for name in files]
    return max(folders.count(folder) for folder in folders) >= _TEMPLATE


def lines(tree: Tree) -> list[str]:
    """Lines of inference."""
    return [
        f"{name}:{i}"
        for name, _ in tree.below("inference")
        for i, _ in enumerate(tree.files[name].splitlines(), 1)
    ]


MEASURES: dict[str, Callable[[Tree], list[str]]] = {
    "covariance of two readings (shot noise times light)": covariances,
    "whitening (named so, with a root or an inverse)": whiteners,
    "Jacobian of the readings (slope kernels, or 2 r + c1)": jacobians,
    "opening rows of parameters (crosstalks, backgrounds)": row_loops,
    "sequential Monte Carlo (files that define *temper*)": _files_defining("temper(?!ature)"),
    "multistart (files that define find_optima or find_maxima)": _files_defining(
        "^find_(optima|maxima)$"
    ),
    "functions of 10 or more arguments in inference": long_argument_lists,
    "lines of inference with a bare index 2 to 9": bare_indices,
    "list[Any] spread over arguments": splats,
    "lines of inference": lines,
    "files above 300 lines in inference and service": long_files,
    "public names in several files of inference": shared_names,
}


def main(arguments: list[str]) -> None:
    """Print the table."""
    here = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(prog="benchmarks.measures", description=__doc__)
    parser.add_argument("path", nargs="?", type=Path, default=here)
    parser.add_argument("--against", type=Path, help="a tree to compare with: before")
    parser.add_argument("--where", action="store_true", help="list the places: + here, - before")
    given = parser.parse_args(arguments)
    trees = [Tree(path) for path in (given.against, given.path) if path is not None]
    for title, measure in MEASURES.items():
        found = [measure(tree) for tree in trees]
        print(f"{title:60}" + "".join(f"{len(places):>8}" for places in found))
        if given.where and measure is not lines:
            for mark, places in zip("+-", reversed(found), strict=False):
                for place in places:
                    print(f"    {mark} {place}")


if __name__ == "__main__":
    main(sys.argv[1:])
