"""When a linear fit that answers by itself says misfit, and what its errors excuse."""

import numpy as np
import pytest
from scipy import special

from benchmarks.random_sets.spoiled import spoiled_set
from inference.estimate import estimate
from inference.estimates import Status
from inference.fits.answer.ranges import MISFIT
from inference.fits.likelihood.model_error import unexplained
from simulator.scene import parse_scene
from tests.fits.scenes import OBJECT, data, path, sensor_of, served


@pytest.mark.parametrize("truth", [OBJECT, {"c0": 1e10, "c1": 0.0, "c2": 0.1}], ids=["all", "c2"])
@pytest.mark.parametrize(("p_value", "misfit"), [(1e-2, False), (1e-5, True)])
def test_a_misfit_is_said_at_its_false_alarm_rate(
    p_value: float, misfit: bool, truth: dict[str, float]
) -> None:
    """The noise is stated so that the residuals of one set have this p-value; 1e-3 parts them.

    Of a plane that fills the view only c2 is told, and the linear fit itself answers.
    """
    frames = data(sensor_of("pulsed", 1e5), {"object": truth}, path(20))
    (healthy,) = served(sensor_of("pulsed", 1e5), {}, frames, ["object_fit"])
    assert healthy.fit is not None
    wanted = special.chdtri(healthy.fit["degrees_of_freedom"], p_value)
    stated = 1e5 * float(np.sqrt(wanted / healthy.fit["chi_square"]))
    (found,) = served(sensor_of("pulsed", stated), {}, frames, ["object_fit"])
    assert found.fit is not None
    assert found.fit["p_value"] == pytest.approx(p_value, rel=0.05)
    assert found.fit["misfit"] is misfit
    # what it contradicts is not handed out, whichever way the ranges came
    assert (found.status == (Status.NONE if misfit else Status.UNIQUE)).all()
    assert np.isfinite(found.roots_m).all() == (not misfit)
    assert {found.reasons[k] for k in found.reason} == {MISFIT if misfit else ""}
    if misfit:
        assert found.parameters is not None
        assert {one["status"] for one in found.parameters.values()} == {"not_identified"}


def test_light_beyond_any_error_is_not_excused_by_it() -> None:
    """A residual of A standard deviations of one error costs A squared, but for a share of that.

    The share grows no more than up to an error of 3.29: between A^2 / (1 + 3.29^2 share) and A^2,
    however bright the light is. Within its law an error is excused, and leaves up to its share.
    """
    share, bright, none = 0.0053, np.array([[1e3], [2e3], [1e4]]), np.zeros(3)
    for far in (20.0, 1e3):
        left = unexplained(bright[:, 0] * far, bright, share, none)
        assert far**2 * 0.9 < left < far**2 * 1.001
    assert unexplained(bright[:, 0], bright, share, none) == pytest.approx(1.0, rel=1e-2)
    # what following leaves: three rows, each a standard deviation of that
    rest = np.sqrt(share) * bright[:, 0] * [1.0, -1.0, 1.0]
    assert unexplained(rest, bright, share, none) < special.chdtri(3, 0.05)
    # the square of an error, where the fit follows the error itself, and so much more than that
    light = np.array([1e4, 1e5, 1e6])
    for times, excused in ((1.0, True), (5.0, False)):
        left = unexplained(times * share * light, np.zeros((3, 1)), share, light)
        assert bool(left < special.chdtri(3, 1e-3)) is excused


def test_outliers_beside_a_square_law_are_a_misfit() -> None:
    """Four of 32 frames show something else; c2 was identified, 7.6 standard deviations off."""
    case = spoiled_set(903311776, 7)
    found = estimate(case.sensor, parse_scene(case.scene), case.frames, ["object_fit"]).results[0]
    assert found.fit is not None
    assert found.fit["misfit"]
    assert found.parameters is not None
    assert {one["status"] for one in found.parameters.values()} == {"not_identified"}
