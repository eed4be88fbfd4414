"""Valid documents of every kind."""

from typing import Any

SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {
        "kind": "pulsed",
        "pulse_width_s": 1e-7,
        "gain": 1.0,
        "noise": {"read": [1e-6, 1e-6], "shot": 0.0, "relative": 0.0},
    },
    "sine_wave": {
        "kind": "sine_wave",
        "frequency_hz": 5e6,
        "phase_offset_rad": 0.0,
        "gain": 1.0,
        "noise": {"read": [1e-6, 1e-6], "derivative": [1e-5, 1e-5]},
        "full_scale": [1.0, 2.0],
    },
}
LAWS: dict[str, dict[str, Any]] = {
    "uniform": {"prior": "uniform", "low": 0.02, "high": 5.0},
    "loguniform": {"prior": "loguniform", "low": 0.02, "high": 5.0},
    "normal": {"prior": "normal", "mean": 1.0, "sd": 0.1},
    "halfnormal": {"prior": "halfnormal", "sd": 1.0},
    "lognormal": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
    "truncated_normal": {
        "prior": "truncated_normal",
        "mean": 1.0,
        "sd": 0.1,
        "low": 0.5,
        "high": 2.0,
    },
}
WALL: dict[str, Any] = {"strength": 0.8, "distance_m": 3.0}
SCENES: list[dict[str, Any]] = [
    {},
    {
        "object": {"c0": 0.0769, "c1": -0.123, "c2": LAWS["lognormal"]},
        "crosstalk": [0.02, 0.5],
        "background": WALL | {"shadow": {"c0": 0.056, "c1": 0.013}},
        "range_m": LAWS["uniform"],
        "motion": "radial",
        "discrepancy": {"flux": 0.05, "range_m": 0.001},
    },
    *({"object": {"c0": law, "c1": law, "c2": law}, "range_m": law} for law in LAWS.values()),
    {"crosstalk": [LAWS["normal"], 0]},
    {"crosstalk": {"values": [LAWS["normal"], 0.5], "optional": True}},
    {"background": WALL | {"shadow": "object", "optional": True}, "motion": "tangential"},
    {"background": {"strength": LAWS["lognormal"], "distance_m": LAWS["uniform"]}},
    {"background": WALL | {"shadow": {"c1": LAWS["halfnormal"]}}, "motion": "static"},
    {"range_m": {"prior": "stroke", "low": 0.1, "high": 3.0}, "discrepancy": 0.05},
    {"discrepancy": "default"},
    {"range_m": {"prior": "reference", "low": 0.1, "high": 3.0}},
]
