"""From readings to answers through the front door alone."""

import numpy as np

import hybridtof

PULSED = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-3]}}
SHAPE = {"c0": 0.0769, "c1": -0.123}
PLATE = {"object": SHAPE | {"c2": 0.0957}}


def test_from_simulation_to_a_track() -> None:
    """All of it through the front door, each answer about the truth."""
    sensor = hybridtof.parse_sensor(PULSED)
    scene = hybridtof.parse_scene(PLATE)
    way = hybridtof.RadialTrajectory(from_m=0.3, to_m=0.6, frames=20)
    made = hybridtof.simulate(sensor, scene, way, seed=1)
    assert hybridtof.plan(sensor, scene, made.frames).chosen == "conventional"
    found = hybridtof.estimate(sensor, scene, made.frames, ["intensity"]).results[0]
    assert (found.status == hybridtof.Status.UNIQUE).all()
    # five standard deviations: a false alarm in 1e5 runs, and the seed is fixed
    assert (np.abs(found.range_m - made.range_m) < 5 * found.sd_m).all()
    roots = hybridtof.all_roots("intensity", sensor, scene, made.frames)
    np.testing.assert_allclose(roots.roots_m[:, 0], found.range_m)
    followed = hybridtof.track(sensor, scene, made.frames, hybridtof.TrackingSettings(rate_sd=3.0))
    assert (np.abs(followed.best_m - made.range_m) < 5 * followed.best_sd_m).all()
    foreseen = hybridtof.identifiability(sensor, scene, made.range_m.tolist())
    assert foreseen.needed == 0 or foreseen.distinct >= foreseen.needed


def test_a_fold_is_what_infer_does() -> None:
    """The chunked fold, by its names, gives the draws of the one call."""
    sensor = hybridtof.parse_sensor(PULSED)
    scene = hybridtof.parse_scene(
        {"object": SHAPE | {"c2": {"prior": "uniform", "low": 0.01, "high": 1.0}}}
    )
    way = hybridtof.RadialTrajectory(from_m=0.3, to_m=0.6, frames=5)
    frames = hybridtof.simulate(sensor, scene, way, seed=2).frames
    settings = hybridtof.SamplerSettings(seed=3, method="importance", target_ess=50)
    job = hybridtof.fold.prepare(sensor, scene, frames, settings)
    checkpoint = hybridtof.fold.start(job)
    while pieces := [hybridtof.fold.run(task) for task in hybridtof.fold.tasks(job, checkpoint)]:
        checkpoint = hybridtof.fold.merge(job, checkpoint, pieces)
    assert hybridtof.fold.progress(job, checkpoint).finished
    folded = hybridtof.fold.summarise(job, checkpoint, 0.0, 0.0)
    called = hybridtof.infer(sensor, scene, frames, settings)
    np.testing.assert_array_equal(folded.range_m.q50, called.range_m.q50)
