"""What is said of each unknown, and that the figures in it are computed."""

import re
from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.offers import Offer
from inference.identifiability.status import STATUSES, Identifiability, status_of
from simulator.errors import InvalidInputError
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, sensor_of

BACKGROUND: dict[str, Any] = {
    "strength": {"prior": "lognormal", "median": 0.0177, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.7},
}
STROKE = np.geomspace(0.2, 2.0, 40).tolist()


def foresee(scene: dict[str, Any], ranges: list[float], gone: int = 0) -> Foresight:
    """Of a model that is exact where the scene does not say otherwise."""
    scene = {"discrepancy": 0} | scene
    present = [True] * len(ranges) + [False] * gone
    sensor = sensor_of("pulsed", 1000.0)
    return identifiability(sensor, parse_scene(scene), ranges + [1.0] * gone, present)


def rows(found: Foresight) -> dict[str, Identifiability]:
    return {row.parameter: row for row in found.identifiability}


def test_limits_of_a_status() -> None:
    assert [status_of("object.c0", s) for s in (0.1, 0.5, 0.9)] == [
        "identified",
        "weak",
        "not_identified",
    ]
    assert [status_of("range_m", s) for s in (0.01, 0.1, 0.5)] == [
        "identified",
        "weak",
        "not_identified",
    ]
    assert status_of("range_m", float("nan")) == "not_identified"


def test_everything_identified() -> None:
    found = foresee({"crosstalk": UNKNOWN_CROSSTALK}, np.geomspace(0.1, 2.0, 40).tolist())
    assert {row.status for row in found.identifiability} == {"identified"}
    assert (found.information.rank, found.needed, found.distinct) == (5, 5, 40)
    for row in found.identifiability:
        assert 0.96 < row.contraction <= 1


def test_an_object_that_does_not_move_must_move() -> None:
    found = foresee({}, [1.0] * 40)
    assert (found.information.rank, found.distinct, found.needed) == (1, 1, 3)
    for name in ("object.c1", "object.c2"):
        reason = rows(found)[name].reason
        assert "the object must move" in reason
        assert "3 unknowns need at least 3 distinct ranges" in reason
        assert re.search(r"an object that moves from 0.5 to 2 m would bring the bound", reason)
    # the range itself needs no object
    assert rows(found)["range_m"].status == "identified"


def test_too_few_distinct_ranges() -> None:
    found = foresee({}, [1.0, 2.0] * 20)
    assert (
        "seen at 2 distinct ranges, and 3 unknowns need at least 3"
        in rows(found)["object.c1"].reason
    )


def test_just_as_many_ranges_as_needed() -> None:
    """Published: five frames of unknown distance and object have a second exact solution."""
    scene = {"background": BACKGROUND | {"shadow": "object"}}
    for frames, told in ((5, True), (6, False)):
        found = foresee(scene, np.linspace(0.2, 2.0, frames).tolist())
        assert (found.information.rank, found.needed) == (5, 5)
        for row in found.identifiability:
            assert ("several exact solutions: one more would" in row.reason) == told


def test_frames_without_the_object_fix_the_background() -> None:
    """The figure in the reason is that of the experiment with the frames added."""
    scene = {"background": BACKGROUND}
    still = foresee(scene, [1.0] * 40)
    for name in ("background.strength", "background.distance_m"):
        reason = rows(still)[name].reason
        said = re.search(r"three frames without the object would [^;]* to ([\d.e-]+) %", reason)
        assert said is not None, reason
        with_them = foresee(scene, [1.0] * 40, gone=3)
        assert rows(with_them)[name].status == "identified"
        bound = 100 * with_them.information.sd[with_them.information.names.index(name)]
        assert float(said.group(1)) == pytest.approx(bound, rel=0.06)


def test_crosstalk_and_a_far_background_look_alike() -> None:
    known = {"shadow": {"c0": 0.056, "c1": 0.01}}
    scene = {
        "object": OBJECT,
        "crosstalk": UNKNOWN_CROSSTALK,
        "background": BACKGROUND | known,
    }
    found = rows(foresee(scene, STROKE))
    for name in ("crosstalk.w2", "background.distance_m"):
        assert found[name].status != "identified"
        assert "crosstalk and a background at 3 m look alike" in found[name].reason
    assert "knowing the crosstalk would lower the bound" in found["background.distance_m"].reason
    # without crosstalk they do not, and all is identified
    alone = foresee({"object": OBJECT, "background": BACKGROUND | known}, STROKE)
    assert {row.status for row in alone.identifiability} == {"identified"}


def test_square_law() -> None:
    """Far away the flux falls as r^-4 and tells c0 c2 alone; near by as r^-2, without c0 and c1."""
    far = rows(foresee({}, np.geomspace(3.0, 10.0, 40).tolist()))
    assert "falls as r^-4 and tells c0 c2 alone" in far["object.c1"].reason
    assert "about sqrt(c0), from 0.16 to 1.3 m" in far["object.c1"].reason
    large = {"object": {"c0": {"prior": "lognormal", "median": 1e4, "sigma": 1.0}}}
    near = rows(foresee(large, np.geomspace(0.1, 1.0, 40).tolist()))
    assert "falls as r^-2, whatever c0 and c1" in near["object.c0"].reason
    assert near["object.c2"].status == "identified"


@pytest.mark.parametrize("member", ["c0", "c2"])
def test_a_fourth_law_tells_the_one_that_is_unknown_of_two(member: str) -> None:
    """Its product with the known one is told, so that their product hides nothing."""
    known = {key: value for key, value in OBJECT.items() if key != member}
    scene = {"object": known, "crosstalk": UNKNOWN_CROSSTALK}
    found = rows(foresee(scene, np.geomspace(3.0, 10.0, 40).tolist()))
    row = found[f"object.{member}"]
    assert row.status != "identified"
    assert "alone tell it to" in row.reason or "order of magnitude" in row.reason
    assert "c0 c2 alone" not in row.reason
    shape = {"object": {"c0": OBJECT["c0"], "c2": OBJECT["c2"]}}
    reason = rows(foresee(shape, np.geomspace(3.0, 10.0, 40).tolist()))["object.c1"].reason
    assert "falls as r^-4, whatever c1" in reason


def test_a_longer_stroke() -> None:
    scene = {"crosstalk": UNKNOWN_CROSSTALK}
    found = rows(foresee(scene, np.geomspace(0.3, 0.4, 40).tolist()))
    reason = found["object.c1"].reason
    said = re.search(r"moves from ([\d.]+) to ([\d.]+) m would lower [^;]* to ([\d.]+) %", reason)
    assert said is not None, reason
    low, high = float(said.group(1)), float(said.group(2))
    longer = foresee(scene, np.geomspace(low, high, 40).tolist())
    bound = 100 * longer.information.sd[longer.information.names.index("object.c1")]
    # the ends of the stroke are said with two digits, the bound too
    assert float(said.group(3)) == pytest.approx(bound, rel=0.3)


def test_no_frame_holds_an_object() -> None:
    scene = {"crosstalk": UNKNOWN_CROSSTALK, "background": BACKGROUND}
    found = foresee(scene, [], gone=4)
    assert (found.information.rank, found.distinct) == (2, 0)
    by_name = rows(found)
    for name in ("object.c0", "background.shadow.c1", "range_m"):
        assert by_name[name].status == "not_identified"
        assert by_name[name].contraction == pytest.approx(0.0, abs=1e-9)
        assert "no frame holds an object" in by_name[name].reason
    together = by_name["background.strength"].reason
    assert "the readings stay the same when it and crosstalk.w1, crosstalk.w2" in together


def test_noise_is_the_reason_where_nothing_else_is() -> None:
    sensor = sensor_of("pulsed", 3.0)
    found = identifiability(sensor, parse_scene({"object": OBJECT}), [1.5] * 3)
    (row,) = found.identifiability
    assert row.parameter == "range_m"
    assert row.status != "identified"
    said = re.search(r"noise ([\d.]+) times lower would tell it to 10 %", row.reason)
    assert said is not None
    assert float(said.group(1)) == pytest.approx(10 * found.information.scale_sd, rel=0.06)


def test_reference_values_are_those_given() -> None:
    scene = {"background": BACKGROUND}
    at = {"object.c0": 0.07, "background.shadow.c0": 0.05, "background.distance_m": 4.0}
    sensor = sensor_of("pulsed")
    found = identifiability(sensor, parse_scene(scene), STROKE, at=at)
    assert {name: found.reference[name] for name in at} == pytest.approx(at)
    assert found.reference["background.strength"] == pytest.approx(0.0177)  # the prior's median


def test_remedies_give_what_they_promise() -> None:
    """Each bound is that of the experiment with the remedy taken.

    What has a parameter identified comes first, and of what achieves as much the cheapest.
    """
    scene = parse_scene({"background": BACKGROUND})
    stroke, sensor = np.geomspace(0.3, 0.6, 12).tolist(), sensor_of("pulsed", 1000.0)
    found = identifiability(sensor, scene, stroke)
    kinds = ["empty", "distance", "distances", "odometry", "motion"]
    met = set()
    for row in found.identifiability:
        assert (row.parameter in found.remedies) == (row.status != "identified")
        for offer in found.remedies.get(row.parameter, ()):
            met.add(offer.kind)
            known: dict[str, Any] = {}
            ranges, present = list(stroke), [True] * 12
            if offer.kind == "empty":
                count = {"three": 3, "ten": 10, "thirty": 30}[offer.words.split()[0]]
                ranges, present = ranges + [1.0] * count, present + [False] * count
            elif offer.kind == "odometry":
                known["displacement_sd_m"] = [1e-3] * 12
            elif offer.kind.startswith("distance"):
                ends = {0.3: stroke[0], 0.42: (stroke[0] * stroke[-1]) ** 0.5, 0.6: stroke[-1]}
                at = [ends[float(text)] for text in re.findall(r"0\.\d+", offer.words)]
                ranges += [place for place in at for _ in range(5)]
                present += [True] * 5 * len(at)
                known["known_range_sd_m"] = [None] * 12 + [1e-3] * 5 * len(at)
            else:
                continue
            of = identifiability(sensor, scene, ranges, present, **known).information
            if row.parameter != "range_m":  # of which known ranges are a part there
                bound = of.sd[of.names.index(row.parameter)]
                assert offer.bound == pytest.approx(bound, rel=1e-6)
        by_status: dict[str, list[Offer]] = {}
        for offer in found.remedies.get(row.parameter, ()):
            by_status.setdefault(offer.status, []).append(offer)
        assert list(by_status) == [status for status in STATUSES if status in by_status]
        for offers in by_status.values():
            offered = [kinds.index(offer.kind) for offer in offers]
            assert offered == sorted(offered)
            bounds = [offer.bound for offer in offers]
            assert bounds == sorted(bounds, reverse=True)
    assert met >= {"empty", "distance", "distances", "odometry"}
    assert "known to 1 mm, would lower the bound" in rows(found)["range_m"].reason


@pytest.mark.parametrize("stroke", [[0.2, 1.0, 2.0], [2.2, 3.0, 5.0], [0.2, 1.0, 5.0]])
def test_a_stroke_may_reach_the_ends_of_its_prior(stroke: list[float]) -> None:
    """What odometry tells is less than what a ruler does, and no less than nothing."""
    scene = parse_scene({"range_m": {"prior": "uniform", "low": 0.2, "high": 5.0}})
    sensor, sds = sensor_of("pulsed", 1000.0), [1e-3] * 3
    left_out = identifiability(sensor, scene, stroke)
    nothing = identifiability(sensor, scene, stroke, None, None, None, [None] * 3, [None] * 3)
    assert nothing.identifiability == left_out.identifiability
    offered = {offer.kind for offers in left_out.remedies.values() for offer in offers}
    ruler = identifiability(sensor, scene, stroke, known_range_sd_m=sds)
    if np.ptp(stroke) > 4.7:  # no offset is left that they could have
        assert "odometry" not in offered
        with pytest.raises(InvalidInputError, match=r"/ranges_m: spans 4\.8 m"):
            identifiability(sensor, scene, stroke, displacement_sd_m=sds)
        return
    odometry = identifiability(sensor, scene, stroke, displacement_sd_m=sds)
    sds_of = [of.posterior.scale_sd for of in (ruler, odometry, left_out)]
    assert sds_of == sorted(sds_of)


def test_odometry_of_an_object_at_rest_is_refused() -> None:
    """Its offset open, it tells no range: it was once taken for a ruler."""
    scene = parse_scene({"motion": "static", "discrepancy": 0})
    with pytest.raises(InvalidInputError, match="/displacement_sd_m: is given, and the scene"):
        identifiability(sensor_of("pulsed", 1000.0), scene, [1.0], displacement_sd_m=[1e-3])


def test_what_helps_enough_is_named_even_if_more_helps_more() -> None:
    found = rows(foresee({"crosstalk": UNKNOWN_CROSSTALK}, np.geomspace(0.3, 0.6, 20).tolist()))
    assert (
        "5 frames with the object at 0.3 and 0.6 m each, known to 1 mm" in found["object.c1"].reason
    )


def test_a_gain_hides_behind_the_reflectance_and_an_offset_behind_the_object() -> None:
    """Readings depend on gain c2 alone; of an offset the flux tells little, and a ruler all."""
    noise = {"read": [1e-4, 1e-4]}
    pulse = {"kind": "pulsed", "pulse_width_s": 2e-8, "noise": noise}
    gain = {"prior": "lognormal", "median": 1.0, "sigma": 0.2}
    offset = {"prior": "normal", "mean": 0.0, "sd": 3e-10}
    ranges = np.geomspace(0.3, 1.5, 12).tolist()
    exact = parse_scene({"discrepancy": 0})
    found = rows(identifiability(parse_sensor(pulse | {"gain": gain}), exact, ranges))
    row = found["sensor.gain"]
    assert row.status == "not_identified"
    assert "when it and object.c2 change together" in row.reason
    assert "knowing the object's c2 would bring the bound down" in row.reason
    sensor = parse_sensor(pulse | {"timing_offset_s": offset})
    before = identifiability(sensor, parse_scene({}), ranges)
    assert rows(before)["sensor.timing_offset_s"].status == "not_identified"
    kinds = {offer.kind: offer.bound for offer in before.remedies["sensor.timing_offset_s"]}
    assert kinds["distance"] < 2e-3  # a millimetre of a typical range of 0.67 m, and the noise
    told = [1e-3, *[None] * 10, 1e-3]
    after = identifiability(sensor, parse_scene({}), ranges, known_range_sd_m=told)
    assert rows(after)["sensor.timing_offset_s"].status == "identified"
