"""Archives: what goes in comes out, to the last bit, and no code with it."""

import dataclasses
import io
import math
import pickle
import zipfile
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from inference.posterior.archive import pack, pack_addition, pack_parts, unpack, unpack_parts
from inference.posterior.sampling.ensemble import Ensemble, new_ensemble
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Local, Mixture, Proposal
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.verdict import Verdict
from simulator.frames import Frames

JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**62), 2**62)
    | st.floats(allow_nan=False)
    | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)
ARRAYS = hnp.arrays(
    st.sampled_from([np.float64, np.int64, np.uint32, np.bool_]),
    hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


def through(value: Any) -> Any:
    arrays: dict[str, NDArray[Any]] = {}
    meta, again = unpack(pack({"value": pack_parts(value, "value", arrays)}, arrays))
    return unpack_parts(meta["value"], again)


def same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return (
            isinstance(b, np.ndarray)
            and a.dtype == b.dtype
            and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
        )
    if dataclasses.is_dataclass(a):
        names = [field.name for field in dataclasses.fields(a)]
        return type(a) is type(b) and all(same(getattr(a, n), getattr(b, n)) for n in names)
    if isinstance(a, tuple):
        return type(b) is tuple and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


NAMES = st.from_regex(r"[a-z]{1,8}(\.[a-z0-9]{1,8})*", fullmatch=True)  # as paths of fields are


@settings(deadline=None, max_examples=30)
@given(st.dictionaries(st.text(), JSON), st.dictionaries(NAMES, ARRAYS))
def test_json_and_arrays(meta: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
    arrays.pop("meta", None)  # the one name that is taken
    arrays.pop("file", None)
    found, again = unpack(pack(meta, arrays))
    assert found == meta
    assert arrays.keys() == again.keys()
    assert all(same(array, again[name]) for name, array in arrays.items())


def test_the_order_in_memory_survives_what_is_appended() -> None:
    """It decides last bits of sums; numpy 2.5 joins arrays column by column to nothing in rows."""
    rng = np.random.default_rng(121)
    axes, chain = np.asfortranarray(rng.standard_normal((5, 5))), rng.standard_normal((7, 4, 2))
    before, now = {"axes": axes, "chain": chain[:3].copy()}, {"axes": axes, "chain": chain}
    added = pack_addition({}, now, before)
    assert added is not None
    _, again = unpack(pack({}, before), added)
    for name, array in now.items():
        assert same(again[name], array)
        assert again[name].strides == array.strides


def parts() -> list[Any]:
    rng = np.random.default_rng(120)
    mixture = Mixture(rng.standard_normal((1, 2)), np.ones((1, 2, 2)), np.ones(1))
    proposal = Proposal(mixture, fit_map(rng.standard_normal((50, 2))), 0.5)
    assert proposal.transport is not None
    local = dataclasses.replace(proposal, more=(Local(proposal.transport, mixture),))
    start = rng.standard_normal((4, 2))
    ensemble = new_ensemble(proposal, start, np.zeros(4), np.random.SeedSequence(7))
    return [
        ensemble,
        (ensemble, ensemble),
        mixture,
        proposal,
        local,
        Population(start, np.zeros(4), np.ones(4), 0.25, -1e308, 3, 99),
        WeightedDraws(np.ones((3, 2)), np.ones(3), np.ones(3) / 3, math.inf, -1e308),
        Frames(np.ones((2, 2)), gain=np.array([1.0, np.nextafter(1.0, 2.0)])),
        Verdict(False, ("one", "two")),
        (),
        (1, 0.1, "text", None, True, (2.5,)),
        np.array([math.nan, -0.0, 5e-324, math.inf]),
    ]


@pytest.mark.parametrize("value", parts(), ids=lambda value: type(value).__name__)
def test_parts_of_a_checkpoint(value: Any) -> None:
    assert same(value, through(value))


def test_a_random_stream_goes_on_where_it_stood() -> None:
    mixture = Mixture(np.zeros((1, 2)), np.eye(2)[None], np.ones(1))
    proposal = Proposal(mixture, None, 0.5)
    ensemble = new_ensemble(proposal, np.zeros((4, 2)), np.zeros(4), np.random.SeedSequence(8))
    again = through(ensemble)
    assert isinstance(again, Ensemble)
    first, second = (np.random.RandomState(), np.random.RandomState())
    first.set_state(("MT19937", *ensemble.random))
    second.set_state(("MT19937", *again.random))
    assert np.array_equal(first.standard_normal(5), second.standard_normal(5))


def test_nothing_is_pickled() -> None:
    arrays: dict[str, NDArray[Any]] = {}
    data = pack({"parts": pack_parts(tuple(parts()), "parts", arrays)}, arrays)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in archive.namelist():
            content = archive.read(name)
            assert content.startswith(b"\x93NUMPY")
            with pytest.raises((pickle.UnpicklingError, ValueError, EOFError, KeyError)):
                pickle.loads(content)  # noqa: S301  # that it fails is the point


def test_objects_are_refused_both_ways() -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        pack({}, {"bad": np.array([object()])})
    buffer = io.BytesIO()
    text = np.frombuffer(b"{}", dtype=np.uint8)
    np.savez(buffer, meta=text, bad=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ValueError, match="allow_pickle"):
        unpack(buffer.getvalue())


def test_what_is_no_part_is_a_mistake() -> None:
    with pytest.raises(TypeError, match="here: cannot archive"):
        pack_parts(object(), "here", {})
    with pytest.raises(TypeError, match=r"here.1: cannot archive"):
        pack_parts((1, {"a": 1}), "here", {})
