"""The table of techniques in the documents, from the registry.

    python -m service.technique_table docs/techniques.md

writes it anew between the two comments that mark its place.
"""

import sys
from pathlib import Path

from inference.techniques import ALL_TECHNIQUES

__all__ = ["END", "START", "main", "technique_table"]

START, END = "<!-- techniques: made by `make readme` -->", "<!-- end of techniques -->"


def _code(words: tuple[str, ...]) -> str:
    return ", ".join(f"`{word}`" for word in words) or "nothing"


def technique_table() -> str:
    """Return the table in Markdown."""
    lines = [
        "| technique | uses | must be known | may be present, unknown | physical roots | cost |",
        "|---|---|---|---|---|---|",
    ]
    for technique in ALL_TECHNIQUES.values():
        uses = technique.observables
        if technique.kinds == ("pulsed",):
            uses += " (pulsed only)"
        lines.append(
            f"| `{technique.name}` | {uses} | {_code(technique.needs)} "
            f"| {', '.join(technique.immune_to) or 'nothing'} | {technique.roots} "
            f"| {technique.cost:g} |"
        )
    return "\n".join(lines)


def main(path: Path) -> None:
    """Write the table into a file.

    Parameters
    ----------
    path : Path
        Markdown with both marks.
    """
    text = path.read_text(encoding="utf-8")
    before, rest = text.split(START)
    after = rest.split(END)[1]
    path.write_text(f"{before}{START}\n{technique_table()}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
