"""Errors of the model that are far larger than the noise."""

import hybridtof


def test_a_frame_without_late_light_beside_frames_of_little_noise_is_answered() -> None:
    """The covariance of the noise, 1, is no part of a double beside squared errors of 1e16."""
    noise = {"read": [1e-6, 1e-6], "derivative": [1e-5, 1e-5]}
    sensor = hybridtof.parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    crosstalk = [{"prior": "normal", "mean": 0.0, "sd": 0.1}] * 2
    scene = hybridtof.parse_scene({"object": {"c0": 0.08, "c1": 0.0}, "crosstalk": crosstalk})
    columns = {
        "time_s": [0.0, 0.1, 0.2, 0.3],
        "w1": [0.0, 0.0119, 0.0099, 0.0085],
        "w2": [0.441, 0.297, 0.212, 0.159],
        "dw1_dt": [-0.033, -0.024, -0.017, -0.012],
        "dw2_dt": [-1.76, -1.13, -0.67, -0.42],
    }
    frames = hybridtof.frames_from_columns(sensor, columns)
    names = ["crosstalk_fit", "joint_fit", "iterative_differential"]
    answer = hybridtof.estimate(sensor, scene, frames, names)
    refused = {each.name for each in answer.left_out}
    assert {each.technique for each in answer.results} | refused >= set(names)
