"""How far the linear response to errors of the model is believed of an unknown."""

import numpy as np
import pytest

from inference.identifiability.model_response import FluxTold, ModelResponse
from inference.posterior.answer.responses import Responses
from inference.posterior.criticism.discrepancy_check import misses


def responses(way: float, curvature: float) -> Responses:
    """Two draws whose one unknown is moved by a way, and known to 1 there."""
    none, two = np.zeros(0), np.zeros((1, 2))
    each = [
        ModelResponse(
            parameters=np.array([[1.0, 0.0]]),
            log_r=two,
            shift=(np.array([way]), np.zeros(1)),
            error=FluxTold(np.zeros(2), np.eye(2)),
            told=none,
            own=none,
            alone=none,
            sd=none,
            shared=none,
            followed=none,
        )
    ] * 2
    return Responses(np.zeros((2, 1)), np.zeros((2, 1)), (), tuple(each), none, curvature, False)


@pytest.mark.parametrize(
    ("way", "curvature", "missed"),
    [
        (5.0, 0.001, False),
        (-15.0, 0.001, False),
        (30.0, 0.001, True),  # empty frames tell crosstalk that bright ones pull elsewhere
        (-30.0, 0.0, True),
        (5.0, 0.3, True),
        (2.0, 0.3, False),
    ],
)
def test_no_way_is_straight_to_less_than_a_twentieth(
    way: float, curvature: float, missed: bool
) -> None:
    """Crosstalk 126 standard deviations away came back to within 10, `identified`."""
    assert misses(responses(way, curvature).missed) is missed
