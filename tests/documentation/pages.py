"""Code blocks of a page, and the steps of a page that is run from its top to its end.

A step is a fenced block below a mark, an HTML comment that no reader of the page sees:

``<!-- file: NAME -->``
    The block is what stands in this file.
``<!-- run -->``
    The block, Python or shell, is run in the folder of the files. Python blocks of a page share
    their names.
``<!-- prints -->``, ``<!-- prints, numbers to 5 % -->``
    The block is what was printed since: words as they stand, numbers to the digits that are shown,
    or to this share of themselves. A line ``...`` stands for any lines.
"""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").glob("*.md"),
        ROOT / "benchmarks" / "README.md",
    ]
)

_FENCE = re.compile(r"(?:<!-- ([^>]*) -->\n)?```(\w*)\n(.*?)\n```", re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Block(NamedTuple):
    """A fenced block: the mark above it ("" is none), its language ("" is none), its text."""

    mark: str
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [Block(mark or "", language, code) for mark, language, code in _FENCE.findall(text)]


def snippets(page: Path) -> list[str]:
    """Code in the running text of a page."""
    text = _FENCE.sub("", page.read_text(encoding="utf-8"))
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", text)


def difference(shown: str, said: str, share: float = 0.0) -> str:
    """Where the lines that a page shows are not those that were printed; "" where they are."""
    lines = [" ".join(line.split()) for line in said.strip().splitlines()]
    wanted = [" ".join(line.split()) for line in shown.strip().splitlines()]
    at = 0
    skipping = False
    for line in wanted:
        if line == "...":
            skipping = True
            continue
        while skipping and at < len(lines) and not _same(line, lines[at], share):
            at += 1
        skipping = False
        if at == len(lines) or not _same(line, lines[at], share):
            return f"shown: {line}\nsaid:  {lines[at] if at < len(lines) else '(nothing more)'}"
        at += 1
    return "" if skipping or at == len(lines) else f"not shown: {lines[at]}"


def _same(shown: str, said: str, share: float) -> bool:
    if _NUMBER.split(shown) != _NUMBER.split(said):
        return False
    return all(
        abs(float(one) - float(other)) <= max(_last_digit(one) * 0.501, share * abs(float(one)))
        for one, other in zip(_NUMBER.findall(shown), _NUMBER.findall(said), strict=True)
    )


def _last_digit(number: str) -> float:
    """Worth of the last digit that is written: an integer is exact."""
    mantissa, _, exponent = number.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals) if decimals or exponent else 0.0
