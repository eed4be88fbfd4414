"""What the kernels of a posterior say without a compiler: the same to the last bit."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inference.frame import modes, modes_by_arrays
from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from service.warm import questions
from simulator import uncompiled
from simulator.compiled import Kernel

_WALL = questions._CROSSTALK | {"background": questions._FREE_WALL}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "unknowns", "data"),
    [
        ({}, 3, {}),
        (questions._CROSSTALK, 5, {"crosstalk": True}),
        (_WALL, 9, {"wall": True, "crosstalk": True}),
    ],
    ids=["object", "crosstalk", "wall"],
)
def test_densities_and_draws(
    scene: dict[str, Any],
    unknowns: int,
    data: dict[str, bool],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(questions, "_FRAMES", 4)
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    sensor, known, frames = questions._question(questions._PULSED, scene, **data)
    frames = dataclasses.replace(frames, gain=np.array([1.0, 0.7, 1.7, 1.1]))
    density = fold.prepare(sensor, known, frames, SamplerSettings(seed=1)).density()
    z = np.random.default_rng(3).normal(size=(4, unknowns)) * 0.5
    asked: set[str] = set()

    def interpreted(kernel: Kernel, *args: Any) -> Any:
        asked.add(kernel._function.__qualname__)
        return uncompiled.run(kernel._function, args, math.inf)[0]

    def answers() -> list[bytes]:
        rng = np.random.default_rng(4)
        likely = density.frame_log_likelihoods(z)
        assert np.isfinite(likely).any()
        return [likely.tobytes(), density.draw_log_ranges(z, rng).tobytes()]

    machine = answers()
    with monkeypatch.context() as without:
        without.setattr(Kernel, "__call__", interpreted)
        assert answers() == machine
    assert len(asked) >= 2


@given(
    st.lists(
        st.sampled_from([-math.inf, math.inf, math.nan, 0.0, 1.0, 2.0]), min_size=1, max_size=12
    )
)
def test_tops_by_arrays_are_those_of_the_loop(values: list[float]) -> None:
    loop: Any = modes._tops
    knots = np.arange(0.0, len(values)) / 7
    found = np.full((2, len(values) // 2 + 1, modes._COLUMNS), 9.0)
    count = loop.__wrapped__(found[0], np.array(values), knots)
    assert modes_by_arrays._tops(found[1], np.array(values), knots) == count
    assert found[0].tobytes() == found[1].tobytes()
