"""Answers as plain data that JSON keeps to the last bit, and what differs between two of them."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Estimates, TechniqueResult
from inference.identifiability.before_data import Foresight
from inference.posterior.answer.posterior import Posterior
from inference.tracking.track import Track

__all__ = [
    "differences",
    "of_estimates",
    "of_foresight",
    "of_posterior",
    "of_result",
    "of_track",
    "plain",
    "read",
    "write",
]

STORED = Path(__file__).parent / "stored"
_SHOWN_DRAWS = 25  # beside a digest of all of them


def plain(value: Any) -> Any:
    """Turn arrays, mappings and numbers into what JSON holds; Python writes floats exactly."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _digest(array: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def of_result(result: TechniqueResult) -> dict[str, Any]:
    """Return everything that a technique says of the frames, its time left out."""
    return {
        "technique": result.technique,
        "status": plain(result.status),
        "roots_m": plain(result.roots_m),
        "roots_sd_m": plain(result.roots_sd_m),
        "root_count": plain(result.root_count),
        "near_fold": plain(result.near_fold),
        "reason": [result.reasons[k] for k in result.reason],
        "range_bounds_m": plain(result.range_bounds_m),
        "power_law": plain(result.power_law),
        "zeta": plain(result.zeta),
        "parameters": plain(result.parameters and dict(result.parameters)),
        "fit": plain(result.fit and dict(result.fit)),
    }


def of_estimates(estimates: Estimates) -> dict[str, Any]:
    """Return the results, and what was left out and why."""
    return {
        "chosen": estimates.chosen,
        "results": [of_result(result) for result in estimates.results],
        "left_out": {item.name: item.reason for item in estimates.left_out},
    }


def of_posterior(posterior: Posterior) -> dict[str, Any]:
    """Return the answer, some of its draws, and a digest of all of them."""
    document = posterior.to_json()
    runtime = document.pop("runtime")
    draws = posterior.draws
    parameters = draws.parameters.reshape(math.prod(draws.parameters.shape[:3]), len(draws.names))
    ranges = draws.range_m.reshape(-1, draws.range_m.shape[-1])
    return document | {
        "likelihood_calls": runtime["likelihood_calls"],
        "k_hat": runtime["k_hat"],
        "names": list(draws.names),
        "draws": {
            "shape": list(draws.parameters.shape),
            "parameters": plain(parameters[:: max(len(parameters) // _SHOWN_DRAWS, 1)]),
            "range_m": plain(ranges[:: max(len(ranges) // _SHOWN_DRAWS, 1)]),
        },
        "digests": {
            name: _digest(getattr(draws, name))
            for name in ("parameters", "log_density", "range_m", "readings", "log_likelihood")
        },
    }


def of_foresight(foresight: Foresight) -> dict[str, Any]:
    """Return what frames at given ranges would tell."""
    return {
        "reference": plain(foresight.reference),
        "sd": plain(foresight.sd),
        "posterior_sd": plain(foresight.posterior_sd),
        "range_sd": plain(foresight.range_sd),
        "scale_sd": plain(foresight.information.scale_sd),
        "rank": int(foresight.information.rank),
        "needed": foresight.needed,
        "distinct": foresight.distinct,
        "rows": [
            [row.parameter, row.status, row.contraction, row.reason]
            for row in foresight.identifiability
        ],
    }


def of_track(track: Track) -> dict[str, Any]:
    """Return every column of a track."""
    names = (
        "status",
        "present",
        "best_m",
        "best_sd_m",
        "static_sd_m",
        "rate_m_s",
        "rate_sd_m_s",
        "weight",
        "outlier",
        "surprise",
        "misfit",
        "hypotheses_m",
        "hypotheses_sd_m",
        "hypotheses_weight",
        "crosstalk",
        "crosstalk_sd",
    )
    return {name: plain(getattr(track, name)) for name in names}


def differences(
    stored: Any, found: Any, relative: float | None = None, where: str = ""
) -> list[str]:
    """Return where two answers differ, each as a line.

    Parameters
    ----------
    stored, found
        Plain data.
    relative : float, optional
        Relative difference up to which numbers are the same; left out: to the last bit. Digests
        are then not looked at.
    where : str
        Pointer of the two.
    """
    if relative is not None and where.startswith("/digests"):
        return []
    if isinstance(stored, dict) and isinstance(found, dict):
        lines = [f"{where}/{key}: only stored" for key in stored if key not in found]
        lines += [f"{where}/{key}: only found" for key in found if key not in stored]
        for key in stored:
            if key in found:
                lines += differences(stored[key], found[key], relative, f"{where}/{key}")
        return lines
    if isinstance(stored, list) and isinstance(found, list):
        if len(stored) != len(found):
            return [f"{where}: {len(stored)} entries stored, {len(found)} found"]
        pairs = enumerate(zip(stored, found, strict=True))
        return [x for i, (a, b) in pairs for x in differences(a, b, relative, f"{where}/{i}")]
    if type(stored) is type(found) and _same(stored, found, relative):
        return []
    return [f"{where}: {stored!r} stored, {found!r} found"]


def _same(a: Any, b: Any, relative: float | None) -> bool:
    if not isinstance(a, float):
        return bool(a == b)
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    if relative is None:
        return a == b and math.copysign(1.0, a) == math.copysign(1.0, b)
    return math.isclose(a, b, rel_tol=relative)


def write(group: str, answers: dict[str, Any]) -> None:
    """Store the answers of a group, one line a column so that a change shows where it is."""
    STORED.mkdir(exist_ok=True)
    parts = []
    for name in sorted(answers):
        lines = ",\n".join(
            f"  {json.dumps(key)}: {json.dumps(item)}" for key, item in answers[name].items()
        )
        parts.append(f"{json.dumps(name)}: {{\n{lines}\n }}")
    text = "{\n " + ",\n ".join(parts) + "\n}\n"
    (STORED / f"{group}.json").write_text(text, encoding="utf-8")


def read(group: str) -> dict[str, Any]:
    """Return the stored answers of a group; none before the first recording."""
    path = STORED / f"{group}.json"
    if not path.exists():
        return {}
    stored: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return stored
