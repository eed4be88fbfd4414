"""What is offered helps, in the order of what it achieves; where nothing helps, that is said."""

import re
from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.experiment import information
from inference.identifiability.offers import NOTHING_HELPS, NOTHING_IDENTIFIES
from inference.identifiability.status import STATUSES
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

STROKE = np.geomspace(0.5, 1.2, 12).tolist()
SCENES: dict[str, dict[str, Any]] = {
    "object": {},
    "crosstalk": {
        "crosstalk": [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 0.1}]
    },
    "background": {
        "background": {
            "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
            "distance_m": {"prior": "normal", "mean": 3.0, "sd": 0.1},
        }
    },
}


def sensor_of(read: float = 1e-4) -> Sensor:
    pulse = {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [read, read]}}
    return parse_sensor(pulse)


def foresee(
    scene: dict[str, Any],
    ranges: list[float],
    gone: int = 0,
    at: dict[str, float] | None = None,
    moved: float | None = None,
) -> Foresight:
    present = [True] * len(ranges) + [False] * gone
    told = [moved] * len(ranges) + [None] * gone
    return identifiability(
        sensor_of(),
        parse_scene(scene),
        ranges + [1.0] * gone,
        present,
        at,
        displacement_sd_m=told,
    )


@pytest.mark.parametrize("name", list(SCENES))
@pytest.mark.parametrize("error", [{}, {"discrepancy": 0}])
def test_offers_help_and_come_by_what_they_achieve(name: str, error: dict[str, Any]) -> None:
    found = foresee(SCENES[name] | error, STROKE)
    made = 0
    for row in found.identifiability:
        offers = found.remedies.get(row.parameter, ())
        made += len(offers)
        ranks = [STATUSES.index(offer.status) for offer in offers]
        assert ranks == sorted(ranks)
        assert all(rank <= STATUSES.index(row.status) for rank in ranks)
        assert all(offer.bound < 1 for offer in offers)
        open_still = row.status != "identified"
        assert (NOTHING_HELPS in row.reason) == (open_still and not offers)
        never = open_still and bool(offers) and ranks[0] > 0
        assert (NOTHING_IDENTIFIES in row.reason) == never
    assert made > 0


@pytest.mark.parametrize(
    ("name", "given", "least"),
    [("object", False, 0), ("object", True, 2), ("crosstalk", False, 2), ("background", True, 3)],
)
def test_an_offer_does_what_it_says(name: str, given: bool, least: int) -> None:
    """The status that is promised is that of the experiment with the offer taken.

    At values of all unknowns that are given, and over draws of their priors where none is. There
    odometry does not have an object's c0 identified, as it does at the medians.
    """
    at = foresee(SCENES[name], STROKE).reference if given else None
    found = foresee(SCENES[name], STROKE, at=at)
    made = 0
    for parameter, of in found.remedies.items():
        for offer in of:
            if offer.kind == "empty":
                count = {"three": 3, "ten": 10, "thirty": 30}[offer.words.split()[0]]
                then = foresee(SCENES[name], STROKE, count, at)
            elif offer.kind == "odometry":
                then = foresee(SCENES[name], STROKE, at=at, moved=1e-3)
            else:
                continue
            (after,) = [row for row in then.identifiability if row.parameter == parameter]
            assert offer.status == after.status
            made += 1
    assert made >= least


def test_what_identifies_comes_before_what_is_cheaper_and_does_not() -> None:
    """Odometry is less trouble than another stroke, and brings c0 no farther than `weak`."""
    at = foresee(SCENES["crosstalk"], STROKE).reference
    offers = foresee(SCENES["crosstalk"], STROKE, at=at).remedies["object.c0"]
    assert [(offer.kind, offer.status) for offer in offers] == [
        ("motion", "identified"),
        ("odometry", "weak"),
    ]


def test_less_noise_is_offered_only_where_it_would_help() -> None:
    """Errors of the model do not fall with it; without them the figure is that of the readings."""
    scene = SCENES["background"]
    by_default, exact = (foresee(scene | of, STROKE) for of in ({}, {"discrepancy": 0}))
    reasons = {row.parameter: row.reason for row in by_default.identifiability}
    assert "less noise would not help" in reasons["object.c1"]
    quiet = information(by_default.experiment, 1e6)
    bound = quiet.sd[quiet.names.index("object.c1")]
    said = re.search(r"would leave it open by ([\d.]+) times sqrt", reasons["object.c1"])
    assert said is not None
    assert float(said.group(1)) == pytest.approx(bound, rel=0.1)
    names = exact.information.names
    lower = identifiability(sensor_of(1e-6), parse_scene(scene | {"discrepancy": 0}), STROKE)
    assert information(exact.experiment, 100.0).sd == pytest.approx(
        lower.information.sd, rel=1e-6
    ), names
