"""What each term of a scene costs: unknowns, arithmetic and time of one evaluation of the density.

Arithmetic is counted, not timed: kernels are run by the interpreter, instruction by instruction,
and every arithmetic instruction and elementary function counts as one, those on whole rows of a
small array as one too. The count is the same on every machine.
"""

import dataclasses
import dis
import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

from inference.density.collapsed import collapsed_density
from inference.density.discrepant import with_discrepancy
from service.report.clock import best
from service.report.readings import readings_of
from service.report.scenes import SCENES, ReportScene
from simulator import uncompiled
from simulator.compiled import Kernel

__all__ = ["TermCost", "operations_of", "term_costs"]

_FRAMES = 5
_TIMED = 40
_ARITHMETIC = {"BINARY_OP", "UNARY_NEGATIVE", "COMPARE_OP"}
_SEED = 1
_LONG_S = 1000.0
_ROOT = Path(uncompiled.__file__).parents[1]
_KERNELS = tuple(str(_ROOT / name) for name in ("simulator", "inference"))


@dataclasses.dataclass(frozen=True)
class TermCost:
    """What one more term costs.

    Attributes
    ----------
    term : str
        What the scene has.
    unknowns : int
        Of the scene, ranges apart.
    operations : float
        Arithmetic of one evaluation of the density, a frame.
    frame_s : float
        Processor time of the same [s].
    """

    term: str
    unknowns: int
    operations: float
    frame_s: float


def operations_of(action: Callable[[], object]) -> int:
    """Return how many arithmetic instructions the kernels take that a call uses.

    Parameters
    ----------
    action : callable
        What to count.
    """
    counted = [0]
    places: dict[CodeType, set[int]] = {}

    def of(code: CodeType) -> set[int]:
        if code not in places:
            places[code] = {
                step.offset for step in dis.get_instructions(code) if step.opname in _ARITHMETIC
            }
        return places[code]

    def inside(frame: FrameType, event: str, _: Any) -> Any:
        if event == "opcode" and frame.f_lasti in of(frame.f_code):
            counted[0] += 1
        return inside

    def entered(frame: FrameType, _event: str, _: Any) -> Any:
        name = frame.f_code.co_filename
        if name == uncompiled.__file__:
            counted[0] += frame.f_code.co_name in ("total", "_log", "_log1p", "_sqrt", "_pow")
            return None
        if not name.startswith(_KERNELS):
            return None
        frame.f_trace_opcodes, frame.f_trace_lines = True, False
        return inside

    answered = Kernel.__call__

    def interpreted(kernel: Kernel, *args: Any) -> Any:
        before = sys.gettrace()
        sys.settrace(entered)
        try:
            return uncompiled.run(kernel.__wrapped__, args, _LONG_S)[0]  # type: ignore[attr-defined]
        finally:
            sys.settrace(before)

    Kernel.__call__ = interpreted  # type: ignore[method-assign, assignment]
    try:
        action()
    finally:
        Kernel.__call__ = answered  # type: ignore[method-assign]
    return counted[0]


def term_costs() -> list[TermCost]:
    """Return what each term costs, from the bare object on."""
    by_name = {scene.name: scene for scene in SCENES}
    told = [
        ("object alone", by_name["Bare object"]),
        ("+ known crosstalk", by_name["Known crosstalk"]),
        ("+ unknown crosstalk", by_name["Unknown crosstalk"]),
        ("+ known wall", by_name["Known wall behind"]),
        (
            "+ wall of unknown strength, own shadow",
            by_name["Wall of unknown strength, the object's own shadow"],
        ),
        (
            "+ wall of unknown strength and shadow",
            by_name["Wall of unknown strength and shadow"],
        ),
        (
            "+ crosstalk and wall, all unknown",
            by_name["Crosstalk and wall unknown, 5 empty frames"],
        ),
    ]
    found = [_cost(name, scene) for name, scene in told]
    return [*found, _cost("+ stated error of the model", by_name["Bare object"], 0.05)]


def _cost(name: str, scene: ReportScene, flux_error: float = 0.0) -> TermCost:
    def evaluation(frames: int) -> tuple[int, Callable[[], object]]:
        made = readings_of(scene, frames, _SEED)
        density = collapsed_density(scene.sensor, scene.free, made.frames)
        if flux_error:
            density = with_discrepancy(density, flux_error)
        z = np.zeros((1, len(density.parameters)))
        return len(density.parameters), lambda: density.frame_log_likelihoods(z)

    unknowns, once = evaluation(_FRAMES)
    operations = operations_of(once) / _FRAMES
    _, timed = evaluation(_TIMED)

    def often() -> None:
        for _ in range(20):
            timed()

    return TermCost(name, unknowns, operations, best(often)[1] / (20 * _TIMED))
