"""JSON out, against the standard library."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.json_text import encode

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=15,
)


@given(values)
def test_same_as_the_standard_library(value: Any) -> None:
    try:
        wanted = json.loads(json.dumps(value, allow_nan=False))
    except ValueError:
        with pytest.raises(ValueError, match="JSON compliant"):
            encode(value)
    else:
        assert json.loads(encode(value)) == wanted


def test_what_orjson_does_not_take() -> None:
    assert encode({"a": 2**70, "b": "\ud800"}) == b'{"a": 1180591620717411303424, "b": "\\ud800"}'
    assert encode([np.float64(1.5), np.array([1.0, math.nan])]) == b"[1.5,[1.0,null]]"
