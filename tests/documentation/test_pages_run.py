"""Pages whose examples are run from top to end, and what they print is what they show."""

import contextlib
import io
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.cli import main
from service.demo.running import running_service
from tests.documentation.pages import PAGES, blocks, difference

RUN = [page for page in PAGES if any(block.mark == "run" for block in blocks(page))]
SERVICE = "http://127.0.0.1:8000"


@pytest.fixture
def address(request: pytest.FixtureRequest) -> Iterator[str]:
    """Of a running service, for a page that asks one."""
    if SERVICE not in request.node.callspec.params["page"].read_text(encoding="utf-8"):
        yield ""
        return
    if shutil.which("curl") is None:
        pytest.skip("no curl: apt-get install curl")
    with running_service() as address:
        yield address


def command(line: str, exit_codes: list[int]) -> str:
    """Run a line of the command line of hybridtof in this process; what it prints."""
    words = shlex.split(line)
    where = None
    if ">" in words:
        at = words.index(">")
        (where,) = words[at + 1 :]
        words = words[:at]
    # commands write bytes
    with contextlib.redirect_stdout(io.TextIOWrapper(io.BytesIO(), encoding="utf-8")) as printed:
        exit_codes.append(main(words[1:]))
    printed.seek(0)
    if where is None:
        return printed.read()
    Path(where).write_text(printed.read(), encoding="utf-8")
    return ""


def shell(text: str, address: str) -> str:
    """Run a block for the shell: hybridtof here, what else there is by the shell itself."""
    said = ""
    codes: list[int] = []
    for line in text.replace("\\\n", " ").splitlines():
        if line.startswith("hybridtof ") and "|" not in line:
            said += command(line, codes)
        else:
            here = line.replace(SERVICE, address)
            done = subprocess.run(["sh", "-c", here], check=True, capture_output=True, text=True)
            said += done.stdout
    assert set(codes) <= {0}
    return said


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::FutureWarning:arviz")  # of its own next version
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_what_is_printed_is_what_is_shown(
    page: Path, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    said = ""
    for mark, language, text in blocks(page):
        if mark.startswith("file: "):
            Path(mark.removeprefix("file: ")).write_text(text + "\n", encoding="utf-8")
        elif mark == "run" and language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                here = text.replace(SERVICE, address)
                exec(compile(here, page.name, "exec"), names)  # noqa: S102  # our own text
            said += printed.getvalue()
        elif mark == "run":
            said += shell(text, address)
        elif found := re.fullmatch(r"prints(?:, numbers to (\d+) %)?", mark):
            assert not difference(text, said, float(found[1] or 0) / 100)
            said = ""


def test_differences_are_seen() -> None:
    assert not difference("a 1.20 m\n...\nend", "a  1.2049 m\nx\ny\nend")
    assert difference("a 1.20 m", "a 1.206 m")
    assert difference("a 1.20 m", "b 1.20 m")
    assert difference("7 frames", "8 frames")
    assert not difference("1.00", "1.04", 0.05)
    assert difference("1.00", "1.06", 0.05)
    assert difference("one", "one\ntwo")
    assert difference("one\ntwo", "one")
    assert len(RUN) >= 3
