"""Coordinates in which crosstalk and a background that look alike do not."""

from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.archive import pack_parts, unpack_parts
from inference.posterior.sampling.reparametrisation import Reparametrisation, reparametrisation_of
from inference.posterior.sampling.transport import fit_map
from simulator.scene import parse_scene
from tests.posterior.scenes import KINDS, data, sensor_of

NORMAL: dict[str, Any] = {"prior": "normal", "mean": 0.01, "sd": 0.02}
STRENGTH: dict[str, Any] = {"prior": "lognormal", "median": 0.02, "sigma": 0.5}
DISTANCE: dict[str, Any] = {"prior": "lognormal", "median": 3.0, "sigma": 0.3}
WALL: dict[str, Any] = {"strength": STRENGTH, "distance_m": DISTANCE}


def density_of(kind: str, scene: dict[str, Any]) -> CollapsedDensity:
    sensor = sensor_of(kind)
    return collapsed_density(sensor, parse_scene(scene), data(sensor, frames=4).frames)


def reparametrised(kind: str, scene: dict[str, Any]) -> tuple[CollapsedDensity, Reparametrisation]:
    density = density_of(kind, scene)
    changed = reparametrisation_of(density)
    assert changed is not None
    return density, changed


@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("distance", [DISTANCE, 3.0], ids=["unknown", "known"])
def test_equal_static_light_is_one_place(kind: str, distance: Any) -> None:
    """Under a normal prior y is the static light of a bare background in the prior's units."""
    wall = {"strength": STRENGTH, "distance_m": distance}
    density, changed = reparametrised(kind, {"crosstalk": [NORMAL, NORMAL], "background": wall})
    z = np.random.default_rng(1).standard_normal((50, len(density.parameters)))
    terms = density.parameters.terms(z)
    assert terms.crosstalk is not None
    assert terms.background is not None
    strength, far = terms.background[:, 0], terms.background[:, 1]
    r0, wave = density.instrument.r0, density.instrument.wave
    if wave is None:
        light = np.stack([strength * np.minimum(far / r0, 1.0), strength], axis=1)
    else:
        phase = wave[0] * far + wave[1]
        light = strength[:, None] * np.stack([np.cos(phase), np.sin(phase)], axis=1)
    wanted = (terms.crosstalk + light - 0.01) / 0.02
    # tables of 50 knots a standard deviation, linear between: (sigma / 50)^2 / 8 of the light
    tolerance = 2e-4 * float(np.abs(light).max()) / 0.02
    np.testing.assert_allclose(changed.forward(z)[:, changed.crosstalk], wanted, atol=tolerance)


@pytest.mark.parametrize(
    "crosstalk",
    [[NORMAL, NORMAL], [0.01, NORMAL], [{"prior": "halfnormal", "sd": 0.02}, NORMAL]],
    ids=["normal", "one known", "half normal"],
)
def test_what_is_reparametrised_can_be_undone(crosstalk: Any) -> None:
    density, changed = reparametrised("pulsed", {"crosstalk": crosstalk, "background": WALL})
    z = 3.0 * np.random.default_rng(2).standard_normal((200, len(density.parameters)))
    y = changed.forward(z)
    unknown = [name.startswith("crosstalk") for name in density.parameters.names]
    assert list(changed.crosstalk) == list(np.flatnonzero(unknown))
    np.testing.assert_array_equal(y[:, ~np.array(unknown)], z[:, ~np.array(unknown)])
    np.testing.assert_allclose(changed.backward(y), z, rtol=0, atol=1e-14 * float(np.abs(y).max()))


def test_a_map_of_reparametrised_coordinates_keeps_volumes() -> None:
    density, changed = reparametrised("pulsed", {"crosstalk": [NORMAL, NORMAL], "background": WALL})
    d = len(density.parameters)
    rng = np.random.default_rng(3)
    transport = fit_map(rng.standard_normal((2000, d)), changed)
    z = rng.standard_normal((5, d))
    x, log_det = transport.unbend(z)
    np.testing.assert_allclose(transport.bend(x)[0], z, atol=1e-9)
    h = 1e-5
    for k in range(len(z)):
        steps = np.concatenate([z[k] + h * np.eye(d), z[k] - h * np.eye(d)])
        ends = transport.unbend(steps)[0]
        jacobian = (ends[:d] - ends[d:]) / (2 * h)
        # central differences of smooth functions, and of tables that are linear between knots
        assert np.linalg.slogdet(jacobian)[1] == pytest.approx(log_det[k], abs=1e-4)


def test_it_survives_the_archive() -> None:
    _, changed = reparametrised("sine_wave", {"crosstalk": [NORMAL, NORMAL], "background": WALL})
    arrays: dict[str, Any] = {}
    again = unpack_parts(pack_parts(changed, "reparametrisation", arrays), arrays)
    z = np.random.default_rng(4).standard_normal((9, 9))
    np.testing.assert_array_equal(again.forward(z), changed.forward(z))


@pytest.mark.parametrize(
    "scene",
    [
        {},
        {"crosstalk": [NORMAL, NORMAL]},
        {"background": WALL},
        {"crosstalk": [NORMAL, NORMAL], "background": WALL | {"strength": 0.02}},
        {"crosstalk": [0.01, 0.02], "background": WALL},
    ],
    ids=str,
)
def test_what_is_not_confounded_is_left_alone(scene: dict[str, Any]) -> None:
    assert reparametrisation_of(density_of("pulsed", scene)) is None
