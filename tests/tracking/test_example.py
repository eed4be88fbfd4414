"""The example of docs/streams.md runs, and says what it should."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "streams.md"


def test_the_example_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    mark = "<!-- executed by tests/tracking/test_example.py -->"
    found = re.search(rf"{mark}\n```python\n(.*?)\n```", PAGE.read_text("utf-8"), re.DOTALL)
    assert found is not None
    names: dict[str, object] = {}
    exec(compile(found[1], str(PAGE), "exec"), names)  # noqa: S102  # our own text
    first, second = capsys.readouterr().out.splitlines()
    numbers = [float(word) for word in re.findall(r"[\d.]+|nan", first)]
    present, ranges, deviations = np.reshape(numbers, (3, 3))
    assert (present > 0.99).all()
    assert (np.abs(ranges - 0.7) < 0.02).all()
    assert (deviations < 0.015).all()  # the model's error, mostly
    assert second.startswith("[0.")
    assert "nan" in second
