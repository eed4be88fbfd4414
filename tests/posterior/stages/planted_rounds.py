"""Rounds of importance draws that come to what a test says."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from inference.posterior.sampling.rounds_so_far import Rounds
from inference.posterior.stages import setting_out

__all__ = ["plant_rounds"]


def plant_rounds(monkeypatch: pytest.MonkeyPatch, make: Callable[..., Rounds]) -> None:
    """Have rounds come at once to what a function of the arguments of `first_draws` returns."""

    def drawn(*arguments: Any) -> SimpleNamespace:
        return SimpleNamespace(open=arguments[2][0][:1], arguments=arguments)

    monkeypatch.setattr(setting_out, "first_draws", drawn)
    monkeypatch.setattr(setting_out, "taken_in", lambda drawn, _: make(*drawn.arguments))
