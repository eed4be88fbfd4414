"""The flux at a range as a coordinate: sheets that frames at few ranges make become flat."""

from typing import Any

import numpy as np
import pytest

import hybridtof
from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.archive import pack_parts, unpack_parts
from inference.posterior.infer import infer
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.flux_coordinate import FluxCoordinate
from inference.posterior.sampling.reparametrisation import Reparametrisation
from inference.posterior.sampling.transport import fit_map
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import data, sensor_of

NORMAL: dict[str, Any] = {"prior": "normal", "mean": 0.01, "sd": 0.02}
STRENGTH: dict[str, Any] = {"prior": "lognormal", "median": 0.02, "sigma": 0.5}
WALL: dict[str, Any] = {"strength": STRENGTH, "distance_m": 3.0}
SHAPES: dict[str, dict[str, Any]] = {
    "nothing known": {},
    "c1 known": {"object": {"c1": -0.1}},
    "a uniform c0": {"object": {"c0": {"prior": "uniform", "low": 0.0, "high": 1.0}}},
    "a wall": {"crosstalk": [NORMAL, NORMAL], "background": WALL},
}


def density_of(scene: dict[str, Any]) -> CollapsedDensity:
    sensor = sensor_of("pulsed")
    return collapsed_density(sensor, parse_scene(scene), data(sensor, frames=4).frames)


@pytest.mark.parametrize("scene", list(SHAPES.values()), ids=list(SHAPES))
def test_it_can_be_undone_and_survives_the_archive(scene: dict[str, Any]) -> None:
    density = density_of(scene)
    rng = np.random.default_rng(2)
    z = 2.0 * rng.standard_normal((300, len(density.parameters)))
    changed = coordinates_of(density)
    assert isinstance(changed, FluxCoordinate)
    changed = changed.fitted(z)
    y = changed.forward(z)
    np.testing.assert_allclose(changed.backward(y), z, rtol=0, atol=1e-13 * float(np.abs(y).max()))
    arrays: dict[str, Any] = {}
    again = unpack_parts(pack_parts(changed, "coordinates", arrays), arrays)
    np.testing.assert_array_equal(again.forward(z), y)


def test_objects_of_one_flux_are_one_place() -> None:
    """Of draws that agree on the flux at 0.37 m to 1e-5 that range is found, and so the flux."""
    density = density_of({})
    rng = np.random.default_rng(3)
    z = rng.standard_normal((2000, 3))
    natural = density.parameters.natural(z)
    c0, c1 = natural[:, 0], natural[:, 1]
    flux = 0.02 * np.exp(1e-5 * rng.standard_normal(2000))
    c2 = flux * (0.37**2 + c1 * 0.37 + c0) / c0
    z = density.parameters.standard(np.column_stack([c0, c1, c2]))
    start = coordinates_of(density)
    assert isinstance(start, FluxCoordinate)
    changed = start.fitted(z)
    # two grids of 36 knots, over six decades and then over three knots of these
    assert changed.range_m == pytest.approx(0.37, rel=0.02)
    before, after = (float(np.std(each[:, changed.c2])) for each in (z, changed.forward(z)))
    # a hundredth beside the right range the flux moves by two hundredths at most
    assert after < 0.02
    assert before > 1.0


def test_a_map_in_it_keeps_volumes() -> None:
    density = density_of({})
    rng = np.random.default_rng(3)
    transport = fit_map(rng.standard_normal((2000, 3)), coordinates_of(density))
    z = rng.standard_normal((5, 3))
    x, log_det = transport.unbend(z)
    np.testing.assert_allclose(transport.bend(x)[0], z, atol=1e-9)
    h = 1e-5
    for k in range(len(z)):
        steps = np.concatenate([z[k] + h * np.eye(3), z[k] - h * np.eye(3)])
        ends = transport.unbend(steps)[0]
        jacobian = (ends[:3] - ends[3:]) / (2 * h)
        # central differences of smooth functions, and of tables that are linear between knots
        assert np.linalg.slogdet(jacobian)[1] == pytest.approx(log_det[k], abs=1e-4)


@pytest.mark.parametrize("known", ["c0", "c2"])
def test_with_c0_or_c2_known_nothing_changes(known: str) -> None:
    assert coordinates_of(density_of({"object": {known: 0.1}})) is None
    wall = {"crosstalk": [NORMAL, NORMAL], "background": WALL, "object": {known: 0.1}}
    assert isinstance(coordinates_of(density_of(wall)), Reparametrisation)


def test_one_near_frame_and_five_empty_ones_are_answered() -> None:
    """A first try of a user, at 0.15 m: without the flux 1,332 steps of ensembles were too few."""
    noise = {"read": [2e-5, 1e-3]}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    crosstalk = [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 2.0}]
    w1 = [0.0039974, 0.0039867, 0.0040181, 0.0039851, 0.0039908, 0.0358996]
    w2 = [0.0213665, 0.0203515, 0.0200940, 0.0190783, 0.0202202, 3.2085228]
    columns: dict[str, Any] = {"w1": w1, "w2": w2, "object_present": [False] * 5 + [True]}
    frames = hybridtof.frames_from_columns(sensor, columns)
    settings = SamplerSettings(method="auto", seed=0, max_seconds=30)
    answer = infer(sensor, parse_scene({"crosstalk": crosstalk}), frames, settings)
    assert answer.verdict.converged
    assert answer.range_m.q05[5] < 0.15 < answer.range_m.q95[5]
    status = {each.parameter: each.status for each in answer.identifiability}
    assert {status["object.c1"], status["object.c2"]} <= {"weak", "not_identified"}
