"""What the last bits of an answer depend on besides the code."""

import json
import platform
from pathlib import Path

import llvmlite.binding
import numba
import numpy as np
import scipy

__all__ = ["RECORDED", "machine", "note"]

_PATH = Path(__file__).parent / "stored" / "machine.json"


def machine() -> dict[str, str]:
    """Return processor and versions here."""
    return {
        "processor": str(llvmlite.binding.get_host_cpu_name()),
        "platform": f"{platform.system()} {platform.machine()}",
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "numba": numba.__version__,
    }


def note() -> None:
    """Store where the answers are recorded."""
    _PATH.write_text(json.dumps(machine(), indent=1) + "\n", encoding="utf-8")


RECORDED: dict[str, str] = (
    json.loads(_PATH.read_text(encoding="utf-8")) if _PATH.exists() else machine()
)
