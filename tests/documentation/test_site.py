"""The site is built without a warning, and every page is in it and can be found."""

import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from tests.documentation.pages import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))


def test_every_page_is_on_the_front_page() -> None:
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\* \[[^]]+\]\(([\w/.]+\.md)\)", text, re.MULTILINE)
    assert len(listed) == len(set(listed))
    missing = {page.name for page in PAGES} - set(listed) - {"index.md"}
    assert not missing


def test_anchors_are_unique_over_all_pages() -> None:
    """Sphinx has one name for each in all pages."""
    found = [a for page in PAGES for a in re.findall(r'<a id="([^"]+)">', page.read_text("utf-8"))]
    assert len(found) == len(set(found)) > 70


def test_links_into_the_source_lead_somewhere() -> None:
    """Of forms that other tests do not read: references, and HTML."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        targets = re.findall(r"^\[[^]]+\]: (\S+)$", text, re.MULTILINE)
        targets += re.findall(r'(?:href|src)="([^"]+)"', text)
        for target in targets:
            assert "://" in target or (page.parent / target.partition("#")[0]).exists(), target


@pytest.mark.slow
def test_site_is_built_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="no Sphinx: pip install 'hybridtof[docs]'")
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    found = re.search(r"\$\(BIN\)/sphinx-build (.*) out/docs$", makefile, re.MULTILINE)
    assert found is not None
    command = [sys.executable, "-m", "sphinx", *found[1].split(), str(tmp_path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    for page in PAGES:
        assert (tmp_path / "docs" / f"{page.stem}.html").exists()
    front = (tmp_path / "docs" / "index.html").read_text(encoding="utf-8")
    # a table of contents beside every page
    assert front.count('class="toctree-l1"') >= len(PAGES) - 1


def test_forms_of_the_pages_that_sphinx_does_not_know() -> None:
    pytest.importorskip("sphinx", reason="no Sphinx: pip install 'hybridtof[docs]'")
    conf = runpy.run_path(str(DOCS / "conf.py"))
    assert conf["anchored"]('<a id="a"></a>\n## A <a id="b"></a>') == "(a)=\n## A []{#b}"
    text = "# T\n\n## One\n\n* [a](a.md): words\n* [b](../b.md)\n\n## Two\n\nNo [list](c.md).\n"
    assert conf["contents"](text).splitlines()[1:] == [
        "```{toctree}",
        ":hidden:",
        ":caption: One",
        "",
        "a",
        "../b",
        "```",
    ]
