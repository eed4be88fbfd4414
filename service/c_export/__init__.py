"""Techniques as C99 for a microcontroller: one file of C, with its proven error in its head.

A technique that can be exported is a function and a line here.
"""

import json
import math
import re
import textwrap
from collections.abc import Mapping

import numpy as np

from inference.known import known_of
from inference.plan import obstacle
from inference.realtime.model_error import model_error_of
from inference.technique import Task
from inference.techniques import ALL_TECHNIQUES
from service.c_export.conventional import conventional
from service.c_export.from_light import background_cancelling, from_late_light, from_light
from service.c_export.source import ROUNDING, Asked, Exported, Generator, literal
from simulator.errors import InvalidInputError, Problem, RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["GENERATORS", "c_text", "export_c"]

GENERATORS: Mapping[str, Generator] = {
    "conventional": conventional,
    "intensity": from_light,
    "intensity_w1": from_late_light,
    "background_cancelling": background_cancelling,
}

_HEAD = """/*
@COMMENT
 */
#include <float.h>
#include <math.h>

/* R writes literals alone: R(0.5); a variable is cast to @_real */
#ifdef @UPPER_FLOAT
typedef float @_real;
#define R(number) number##f
#define SQRT sqrtf
#define ATAN2 atan2f
#define EPSILON FLT_EPSILON
#else
typedef double @_real;
#define R(number) number
#define SQRT sqrt
#define ATAN2 atan2
#define EPSILON DBL_EPSILON
#endif
typedef @_real real;
#define SIZE(x) ((x) < 0 ? -(x) : (x))
#define LARGER(x, y) (SIZE(x) > SIZE(y) ? SIZE(x) : SIZE(y))

enum { @_UNIQUE, @_AMBIGUOUS, @_NONE, @_SATURATED };

typedef struct {
    int status;
    @_real range_m; /* 0 without a range */
    @_real sd_m;    /* whole standard deviation; 0 without a range, -1 where it is no number */
    int near_fold;  /* 1: the object may be there or farther, whatever sd_m is */
} @_answer;

int @_range(@_real first, @_real second, @_answer *out);

"""
_FOOT = """
int @_range(@_real first, @_real second, @_answer *out)
{
    out->range_m = 0;
    out->sd_m = 0;
    out->near_fold = 0;
    out->status = @_NONE;
@FULL    if (first - first == 0 && second - second == 0)
        out->status = answer(first, second, out);
    if (out->status == @_UNIQUE && !(out->sd_m - out->sd_m == 0))
        out->sd_m = -1;
    return out->status;
}
"""
_FULL_SCALE = """    if (first >= FULL1 || first <= -FULL1 || second >= FULL2 || second <= -FULL2) {
        out->status = @_SATURATED;
        return out->status;
    }
"""


def export_c(technique: str, sensor: Sensor, scene: Scene, tolerance: float = 1e-4) -> Exported:
    """Export a technique.

    Parameters
    ----------
    technique : str
        One of `GENERATORS`.
    sensor, scene : Sensor, Scene
        For which; the scene's numbers become constants.
    tolerance : float
        Largest error of a table, relative to the range.

    Raises
    ------
    InvalidInputError
        At ``/technique`` or ``/tolerance``.
    RefusedError
        Where the scene does not serve the technique, or there is no export of it, with the reason.
    """
    if technique not in GENERATORS:
        must = ", ".join(GENERATORS)
        raise InvalidInputError.at("/technique", f"{technique!r} is not exported; {must} are")
    if not 1e-9 <= tolerance <= 0.1:
        raise InvalidInputError.at("/tolerance", f"must lie from 1e-9 to 0.1, is {tolerance:g}")
    known = known_of(scene)
    if isinstance(sensor, PulsedSensor) and sensor.timing_offset_s is not None:
        raise RefusedError(
            "timing_offset_s is not exported to C; leave it out, and take it off",
            Problem("/sensor/timing_offset_s", "is not exported"),
        )
    if sensor.temperature is not None:
        raise RefusedError(
            "the export to C knows no temperature: leave `temperature` out of the sensor, and turn "
            "the readings back to reference_k before the call (docs/scenes.md, temperature)",
            Problem("/sensor/temperature", "is not exported"),
        )
    if sensor.noise.flickers:
        raise RefusedError(
            "the export to C knows no source that flickers: leave noise.relative out, and add "
            "relative times the largest reading to noise.read",
            Problem("/sensor/noise/relative_of", "is not exported"),
        )
    reason = obstacle(ALL_TECHNIQUES[technique], sensor, scene, known, None)
    if reason is not None:
        raise RefusedError(f"{technique}: {reason}")
    frames = Frames(readings=np.zeros((1, 2)))  # only the scene counts
    error = model_error_of(Task(sensor, scene, frames, known))
    asked = Asked(technique, sensor, scene, known, error, tolerance)
    return GENERATORS[technique](asked)


def c_text(
    exported: Exported, technique: str, sensor: Sensor, scene: Scene, name: str = "hybridtof"
) -> str:
    """Return the file of C.

    Parameters
    ----------
    exported : Exported
        As of `export_c`.
    technique, sensor, scene
        Of which.
    name : str
        With which the names in C begin.

    Returns
    -------
    str
        C99 that needs sqrt and, of a sine wave, atan2.

    Raises
    ------
    InvalidInputError
        At ``/name``.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name):
        raise InvalidInputError.at("/name", "must be a name in C: small letters, digits and _")
    lines = [_HEAD.replace("@COMMENT", _comment(exported, technique, sensor, scene, name))]
    constants = dict(exported.constants)
    full = ""
    if sensor.full_scale is not None:
        constants |= {"FULL1": sensor.full_scale[0], "FULL2": sensor.full_scale[1]}
        full = _FULL_SCALE
    body = exported.body + _FOOT.replace("@FULL", full)
    used = {
        key: literal(value)
        if math.isfinite(value)
        else "R(1e30)"  # of a limit: farther than any reading tells
        for key, value in constants.items()
        if re.search(rf"\b{key}\b", body)
    }
    lines += [f"#define {key} {value}\n" for key, value in used.items()]
    for key, values in exported.tables.items():
        lines.append(f"\n#define NODES {len(values)}\n" if key == "ranges" else "\n")
        rows = textwrap.fill(", ".join(map(literal, values)), 96, break_long_words=False)
        lines.append(f"static const real {key}[NODES] = {{\n{textwrap.indent(rows, '    ')}\n}};\n")
    return "".join([*lines, body]).replace("@UPPER", name.upper()).replace("@", name)


def _comment(exported: Exported, technique: str, sensor: Sensor, scene: Scene, name: str) -> str:
    low, high = exported.limits_m
    bound = exported.bound
    errors = []
    for kind, unit in ROUNDING.items():
        share = ""
        if any(bound.readings):
            first, second = (k * unit / s for k, s in zip(bound.readings, bound.read, strict=True))
            share = f" + ({first:.2g} |first| + {second:.2g} |second|) sd"
        errors.append(
            f"{kind}: {bound.method:.3g} m + {unit * bound.relative:.3g} r + "
            f"{unit * bound.absolute_m:.3g} m + {unit * bound.crosstalk:.3g} sd{share}"
        )
    system = {
        "sensor": sensor.model_dump(mode="json", exclude_none=True),
        "scene": scene.model_dump(mode="json", exclude_unset=True),
    }
    columns = ", ".join(sensor.columns)
    paragraphs = [
        f"Range by {technique}, exported by hybridtof.",
        f"{name}_range(first, second, &answer) takes the readings {columns} of a frame and returns "
        f"its status, the numbers of hybridtof: unique 0, ambiguous 1, none 2, saturated 3. Ranges "
        f"lie between {low:.6g} and {high:.6g} m; at these ends, and where a reading is at a limit "
        "to within its rounding, the status may be that of the other side. It keeps no state. "
        f"-D{name.upper()}_FLOAT computes in float.",
        f"Distance from the exact range r of the same readings, sd its standard deviation by "
        f"noise, at most: {'; '.join(errors)}.",
        f"How that is known: {exported.proof}.",
        "The standard deviation is of noise, followed along the curve to three of its own, and of "
        "errors of the model; -1 where such noise may leave no light, so that an object at any "
        "farther range reads alike. What a scene knows only by a prior is not part of it.",
        json.dumps(system).replace("*/", "* /"),
    ]
    filled = "\n\n".join(textwrap.fill(text, 96, break_on_hyphens=False) for text in paragraphs)
    return "\n".join(f" * {line}".rstrip() for line in filled.splitlines())
