"""Tests of a group run in one process, in a run of two."""

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.groups import TOGETHER, group_of

ROOT = Path(__file__).parents[1]
FILES = ("tests/test_api_page.py", "tests/test_stated_limits.py", "tests/simulator/test_priors.py")


def test_a_folder_or_a_file_is_a_group() -> None:
    assert group_of("tests/density/test_one.py::test[a/b::c]") == "density"
    assert group_of("tests/frame/test_other.py::test") == "density"
    assert group_of("tests/simulator/test_one.py::test") == "tests/simulator/test_one.py"
    assert group_of("tests/test_one.py::test") == "tests/test_one.py"
    assert all((ROOT / "tests" / folder).is_dir() for folder in TOGETHER)


def test_two_processes_share_groups_and_no_group() -> None:
    """As libraries of tests have it, by marks, all tests may be handed out one by one, unsaid."""
    options = ["-n", "2", "--no-loadscope-reorder", "-v", "-p", "no:cacheprovider"]
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    run = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *FILES],
        cwd=ROOT, env=kept, capture_output=True, text=True, check=True,
    )  # fmt: skip
    ran = re.findall(r"^\[(gw\d)\].* PASSED (\S+?)::", run.stdout, re.MULTILINE)
    assert {file for _, file in ran} == set(FILES)
    assert {process for process, _ in ran} == {"gw0", "gw1"}
    assert len(set(ran)) == len(FILES)
