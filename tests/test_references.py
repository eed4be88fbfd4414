"""Every reference in code and documents leads to something in the documents of this repository.

An equation's number, a table, an appendix or a section is an anchor of docs/model.md: (4.13) is
``eq-4-13`` there. ``docs/NAME.md, what`` names the page and the anchor itself.
"""

import functools
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PACKAGES = ("hybridtof", "simulator", "inference", "service", "benchmarks", "tests", "docs")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
PAGES = sorted([*ROOT.glob("*.md"), *DOCS.glob("*.md"), *(ROOT / "benchmarks").rglob("*.md")])

NUMBER = r"(?<![\d.])[2-5]\.(?:[1-9]\d?)(?!\d|\.\d)"
NUMBERS = rf"{NUMBER}(?:(?:, | and |, and | to |-){NUMBER})*"
# (4.13), (2.6-2.10), (4.19 with ...), equations 2.50, 2.57; a length in brackets is no equation
EQUATION = re.compile(
    rf"(?:\(|\bequations? |\beqs?\. )({NUMBERS})(?=[,;)]| with| as | in the| for |\.\s|$)"
)
SECTION = re.compile(r"\((5\.2\.[23])\b")
EQUATIONS = "equations="  # of a technique: what follows is all numbers of equations
TABLE = re.compile(r"\bTables? (\d\.\d)(?: and (\d\.\d))?")
APPENDIX = re.compile(r"\b(?:App\.|[Aa]ppendix) ([AB])(?:, (\d+)(?:-(\d+))?)?")
PAGE = re.compile(
    r"\bdocs/([a-z_]+)\.md(?:, ((?:[A-Z] )?[\w.'-]+(?:(?:, | and | to )[2-5]\.\d+)*))?"
)


@functools.cache
def anchors(page: Path) -> set[str]:
    """Explicit anchors of a page, and those that headings make."""
    text = page.read_text(encoding="utf-8")
    found = set(re.findall(r'<a id="([^"]+)">', text))
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        words = re.sub(r"[^\w\- ]", "", re.sub(r"<[^>]+>", "", heading).lower())
        found.add(words.strip().replace(" ", "-"))
    return found


MODEL = anchors(DOCS / "model.md")


@functools.cache
def texts(path: Path) -> tuple[tuple[int, str], ...]:
    return tuple(_texts(path))


def _texts(path: Path) -> Iterator[tuple[int, str]]:
    """Comments (those of neighbouring lines joined) and strings of words, in one line each."""
    with tokenize.open(path) as file:
        tokens = list(tokenize.generate_tokens(file.readline))
    first, last, block = 0, -1, ""
    before = ("", "")
    for token in tokens:
        if token.type == tokenize.COMMENT:
            if token.start[0] != last + 1:
                if block:
                    yield first, block
                first, block = token.start[0], ""
            last = token.start[0]
            block += " " + token.string.lstrip("# ")
        elif token.type == tokenize.STRING:
            named = "".join(before) == EQUATIONS
            if named or " " in token.string:
                mark = EQUATIONS if named else ""
                yield token.start[0], mark + " ".join(token.string.split())
        before = (before[1], token.string)
    if block:
        yield first, block


def numbers(text: str) -> list[str]:
    return re.findall(NUMBER, text)


def references(text: str) -> Iterator[tuple[str, str]]:
    """Each reference of a text, and the anchor in the model's page that it means."""
    if text.startswith(EQUATIONS):
        yield from (
            (number, f"eq-{number.replace('.', '-')}") for number in numbers(TABLE.sub("", text))
        )
    for found in EQUATION.finditer(text):
        yield from ((number, f"eq-{number.replace('.', '-')}") for number in numbers(found[1]))
    for found in SECTION.finditer(text):
        yield found[1], f"section-{found[1].replace('.', '-')}"
    for found in TABLE.finditer(text):
        for number in filter(None, found.groups()):
            yield f"Table {number}", f"table-{number.replace('.', '-')}"
    for found in APPENDIX.finditer(text):
        letter, first, last = found.groups()
        name = f"appendix-{letter.lower()}"
        yield found[0], name
        yield from ((found[0], f"{name}-{number}") for number in (first, last) if number)


def page_references(text: str) -> Iterator[tuple[str, str, str]]:
    """Each page that is named, with the anchor meant ("" is the page itself)."""
    for found in PAGE.finditer(text):
        page, what = found[1], found[2] or ""
        if numbers(what):
            yield from ((found[0], page, f"eq-{n.replace('.', '-')}") for n in numbers(what))
        else:
            yield found[0], page, what.rstrip(".")


@pytest.mark.parametrize("package", PACKAGES)
def test_references_of_the_code(package: str) -> None:
    lost = []
    for path in SOURCES:
        if path.relative_to(ROOT).parts[0] != package or path == Path(__file__):
            continue
        place = path.relative_to(ROOT)
        for line, text in texts(path):
            lost += [
                f"{place}:{line}: {name}"
                for name, anchor in references(text)
                if anchor not in MODEL
            ]
            lost += [
                f"{place}:{line}: {name}"
                for name, page, anchor in page_references(text)
                if not (DOCS / f"{page}.md").exists()
                or (anchor and anchor not in anchors(DOCS / f"{page}.md"))
            ]
    assert lost == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_of_the_pages(page: Path) -> None:
    lost = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        place, _, anchor = target.partition("#")
        if "://" in place or not anchor:
            continue
        other = page if not place else page.parent / place
        if not other.exists() or (other.suffix == ".md" and anchor not in anchors(other)):
            lost.append(target)
    assert lost == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_paths_in_the_pages(page: Path) -> None:
    """A file or folder that a page names is there."""
    if page.name == "CHANGELOG.md":  # it speaks of what was
        return
    places = "|".join(PACKAGES)
    named = re.findall(rf"`((?:{places})/[\w./-]*)`", page.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_nothing_cites_books_that_are_not_here() -> None:
    words = re.compile(r"\berrat(?:a|um)\b|\b(?:the|of a) contract\b|\(contract[,)]", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in SOURCES
        if path != Path(__file__)
        for line, text in texts(path)
        if words.search(text)
    ]
    assert found == []


def test_every_floor_is_described() -> None:
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    floors = [path.parent for path in (ROOT / "inference").glob("*/__init__.py")]
    assert floors
    assert [floor.name for floor in floors if f"`inference/{floor.name}/`" not in text] == []


def test_the_grammar_finds_what_is_written() -> None:
    """Planted references are seen: a test of references that finds none would always pass."""
    found = dict(references("zeta (4.19 with its cubic), Table 3.1, App. A, 25-27, (2.6-2.10)"))
    assert found["4.19"] == "eq-4-19"
    assert found["2.10"] == "eq-2-10"
    assert found["Table 3.1"] == "table-3-1"
    assert "appendix-a-27" in {anchor for _, anchor in references("App. A, 25-27")}
    assert [number for number, _ in references('equations="4.64-4.68, 5.2.3"')] == ["4.64", "4.68"]
    assert list(references("(3.0), 80 frames in (2.5 m, 3.5 m)")) == []
    (named,) = page_references("see docs/model.md, exact.")
    assert named[1:] == ("model", "exact")
    assert [a for _, _, a in page_references("docs/model.md, 4.1, 4.4 and 4.68")] == [
        "eq-4-1",
        "eq-4-4",
        "eq-4-68",
    ]
    assert len([1 for path in SOURCES for _, text in texts(path) for _ in references(text)]) > 50


def test_every_departure_and_anchor_is_unique() -> None:
    text = (DOCS / "model.md").read_text(encoding="utf-8")
    explicit = re.findall(r'<a id="([^"]+)">', text)
    assert len(explicit) == len(set(explicit))
