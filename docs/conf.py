"""How Sphinx makes one site of the pages: ``make docs``.

The source is the root of the repository, so that links to the README, to benchmarks and to
notebooks are the same here and where the repository is read. Pages are written for both.
"""

import re
from importlib.metadata import version as installed

from sphinx.application import Sphinx

project = "hybridtof"
author = "the hybridtof project"
version = release = installed("hybridtof")

extensions = ["myst_parser"]
root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "benchmarks/README.md",
]
myst_enable_extensions = ["attrs_inline"]
myst_heading_anchors = 4

html_theme = "furo"
html_title = "hybridtof"
html_copy_source = False
html_show_copyright = False
pygments_style = "friendly"


def setup(app: Sphinx) -> None:
    """Let Sphinx read the pages' own forms of anchors and of a table of contents."""
    app.connect("source-read", _read)


def _read(_app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = anchored(source[0])
    if page == root_doc:
        source[0] += contents(source[0])


def anchored(text: str) -> str:
    """Turn the anchors of a page, which are HTML, into targets that Sphinx checks."""
    text = re.sub(r'^<a id="([^"]+)"></a>$', r"(\1)=", text, flags=re.MULTILINE)
    return re.sub(r'<a id="([^"]+)"></a>', r"[]{#\1}", text)


def contents(text: str) -> str:
    """Make of each section of the front page that lists pages a part of the table of contents."""
    parts = ""
    for heading, section in re.findall(r"^## (.+)\n((?:(?!## ).*\n?)*)", text, re.MULTILINE):
        pages = re.findall(r"^[*-] \[[^]]+\]\(([^)#]+)\.md\)", section, re.MULTILINE)
        if pages:
            lines = "\n".join(f"{page}" for page in pages)
            parts += f"\n```{{toctree}}\n:hidden:\n:caption: {heading}\n\n{lines}\n```\n"
    return parts
