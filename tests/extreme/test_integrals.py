"""Integrals of single frames against ball arithmetic: the small version of `make stress`."""

import numpy as np
import pytest

from benchmarks.inner_integral import adaptive, unfinished
from tests.density.reference import FEW_TERMS, random_case
from tests.extreme.integrals import certified_log_integral, condition_of


def test_frames_are_integrated_as_balls_enclose_them() -> None:
    """The quadrature's bound is a thousandth of a nat; it keeps a millionth, or a few roundings."""
    rng = np.random.default_rng(7)
    decided = 0
    for _ in range(24):
        case = random_case(rng, FEW_TERMS)
        certified = certified_log_integral(case)
        if certified is None:
            continue
        decided += 1
        noise = case.sensor.noise
        if noise.shot == noise.relative == 0.0:  # others would ask for kernels of their own
            assert unfinished(case) == 0  # none ran out of panels
        value = float(certified.mid())
        allowed = max(1e-6, 1e3 * condition_of(case, value) * float(np.finfo(float).eps))
        assert adaptive(case) == pytest.approx(value, abs=allowed, rel=0)
    assert decided > 18
