"""The measures of a source tree see what is planted, and nothing where nothing is."""

from pathlib import Path

import pytest

from benchmarks.measures import MEASURES, Tree, main

CLEAN = '''
"""Nothing that is counted."""


def area(width: float, height: float) -> float:
    return width * height + shot_count(width)[0]


def shot_count(sizes: list[float]) -> list[float]:
    shot = len(sizes)
    return sizes[1:shot]
'''
PLANTED = {
    "covariance": ("def variance(m, noise):\n    return noise.read + noise.shot * abs(m)\n", 1),
    "whitening": ("def whitener_at(c):\n    return 1 / math.sqrt(c)\n", 1),
    "Jacobian": (
        "def along(r, c1, q):\n    return r * (2.0 * r + c1) / q\n\n\n"
        "def both(r):\n    return object_slopes(r)\n",
        2,
    ),
    "opening rows": (
        "def opened(crosstalks, backgrounds, n):\n"
        "    for i in range(n):\n        use(crosstalks[i], backgrounds[i])\n",
        1,
    ),
    "sequential Monte Carlo": ("def temper_all(z):\n    return z\n", 1),
    "multistart": ("def find_optima(z):\n    return z\n", 1),
    "functions of 10": (
        f"def many({', '.join('abcdefghij')}):\n    pass\n\n\n"
        f"def few({', '.join('abcdefghi')}):\n    pass\n",
        1,
    ),
    "bare index": ("def item(x):\n    return x[3] + x[0] + x[i] + x[12]\n", 1),
    "list[Any]": (
        "def spread(x):\n    rest: list[Any] = [x]\n    typed = [x]\n"
        "    return kernel(*rest) + kernel(*typed)\n",
        1,
    ),
    "files above 300": ("a = 1\n" * 301, 1),
}


def tree(root: Path, *sources: str, folder: str = "inference/part") -> Tree:
    for package in ("simulator", "inference", "service"):
        (root / package).mkdir(exist_ok=True)
    (root / folder).mkdir(parents=True, exist_ok=True)
    for k, source in enumerate(sources):
        (root / folder / f"file{k}.py").write_text(source)
    return Tree(root)


def count(found: Tree, begin: str) -> int:
    title = next(title for title in MEASURES if begin in title)
    return len(MEASURES[title](found))


@pytest.mark.parametrize("begin", PLANTED)
def test_what_is_planted_is_seen(begin: str, tmp_path: Path) -> None:
    source, wanted = PLANTED[begin]
    assert count(tree(tmp_path, CLEAN), begin) == 0
    assert count(tree(tmp_path, CLEAN, source), begin) == wanted


def test_the_same_name_twice_is_seen_and_a_template_is_not(tmp_path: Path) -> None:
    name = "def judge(x):\n    return x\n"
    assert count(tree(tmp_path, name), "public names") == 0
    assert count(tree(tmp_path, name, name), "public names") == 1
    assert count(tree(tmp_path, name, name, name), "public names") == 0


def test_lines_of_inference_alone(tmp_path: Path) -> None:
    (tmp_path / "service").mkdir()
    (tmp_path / "service" / "more.py").write_text("a = 1\n")
    found = tree(tmp_path, "a = 1\nb = 2\n")
    assert len(MEASURES["lines of inference"](found)) == 2


def test_a_table_of_two_trees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("before", "after"):
        (tmp_path / name).mkdir()
    tree(tmp_path / "before", CLEAN, PLANTED["multistart"][0])
    tree(tmp_path / "after", CLEAN)
    main([str(tmp_path / "after"), "--against", str(tmp_path / "before"), "--where"])
    out = capsys.readouterr().out
    (row,) = (line for line in out.splitlines() if line.startswith("multistart"))
    assert row.split()[-2:] == ["1", "0"]
    assert "- inference/part/file1.py" in out
