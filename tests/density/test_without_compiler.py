"""What the kernels of a posterior say without a compiler: the same to the last bit."""

import math
from typing import Any

import numpy as np
import pytest

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
