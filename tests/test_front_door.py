"""The front door: every public name resolves, and the package alone brings nothing heavy."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import hybridtof
from simulator.errors import HybridTofError, InvalidInputError

ROOT = Path(__file__).parents[1]
HEAVY = {"numpy", "scipy", "numba", "emcee", "pydantic", "fastapi", "h5py", "llvmlite"}
PULSED = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-3]}}
PLATE = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}}


@pytest.mark.parametrize("name", hybridtof.__all__)
def test_every_name_resolves(name: str) -> None:
    assert getattr(hybridtof, name) is not None
    assert name in dir(hybridtof)


def test_names_unknown_to_it() -> None:
    with pytest.raises(AttributeError, match="no attribute 'estimates'"):
        hybridtof.estimates  # type: ignore[attr-defined]  # noqa: B018


def test_type_checkers_and_readers_find_the_same_homes() -> None:
    """The imports for type checkers, the table of homes and ``__all__`` say the same."""
    tree = ast.parse((ROOT / "hybridtof" / "__init__.py").read_text(encoding="utf-8"))
    homes: dict[str, str] = {}
    tables: list[dict[str, str]] = []
    for node in tree.body:
        if isinstance(node, ast.If):
            for line in node.body:
                if isinstance(line, ast.ImportFrom) and line.module is not None:
                    homes |= {alias.name: line.module for alias in line.names}
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Dict):
            tables.append(ast.literal_eval(node.value))
    (table,) = tables
    own = {"read_frames", "__version__"}
    assert table.keys() | own == set(hybridtof.__all__)
    assert {name: homes[name] for name in table} == table


def loaded(code: str) -> set[str]:
    """Top-level packages that a fresh interpreter holds after some code."""
    report = "import sys; print(*{name.partition('.')[0] for name in sys.modules})"
    command = [sys.executable, "-c", f"{code}\n{report}"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.split())


def test_the_package_runs_as_the_script_does() -> None:
    command = [sys.executable, "-m", "hybridtof", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == f"hybridtof {hybridtof.__version__}\n"
    wrong = subprocess.run([*command[:3], "estimates"], capture_output=True, check=False, cwd=ROOT)
    assert wrong.returncode == 2


def test_the_import_brings_nothing_heavy() -> None:
    """Counted in modules: a clock would say more of the machine."""
    code = "import sys; before = len(sys.modules); import hybridtof\n"
    code += "assert len(sys.modules) - before < 10, sorted(sys.modules)"
    found = loaded(code)
    assert "hybridtof" in found
    assert not found & (HEAVY | {"simulator", "inference", "service"})


def test_no_compiler_until_something_is_computed() -> None:
    code = f"""
import hybridtof
sensor = hybridtof.parse_sensor({PULSED})
scene = hybridtof.parse_scene({PLATE})
hybridtof.frames_from_columns(sensor, {{"w1": [0.01], "w2": [1.0]}})
hybridtof.SamplerSettings(seed=1)
"""
    found = loaded(code)
    assert "pydantic" in found
    assert not found & {"numba", "llvmlite", "emcee", "fastapi"}


def test_nothing_below_knows_the_front_door() -> None:
    for package in ("simulator", "inference", "service"):
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                assert not any(name.partition(".")[0] == "hybridtof" for name in names), path


@pytest.mark.parametrize("suffix", [".csv", ".ndjson", ".json"])
def test_frames_from_files(tmp_path: Path, suffix: str) -> None:
    text = {
        ".csv": "w1,w2\n0.02,0.3\n0.03,0.4\n",
        ".ndjson": '{"w1": 0.02, "w2": 0.3}\n{"w1": 0.03, "w2": 0.4}\n',
        ".json": '{"w1": [0.02, 0.03], "w2": [0.3, 0.4]}',
    }
    path = tmp_path / f"frames{suffix}"
    path.write_text(text[suffix], encoding="utf-8")
    sensor = hybridtof.parse_sensor(PULSED)
    frames = hybridtof.read_frames(sensor, str(path))
    assert isinstance(frames, hybridtof.Frames)
    np.testing.assert_array_equal(frames.readings, [[0.02, 0.3], [0.03, 0.4]])
    np.testing.assert_array_equal(hybridtof.read_frames(sensor, path).readings, frames.readings)


@pytest.mark.parametrize("name", ["phase", "Amplitude", "phase_rad"])
def test_readings_in_polar_form_are_told_how_to_be_given(name: str) -> None:
    wave = {"kind": "sine_wave", "frequency_hz": 1e7, "noise": {"read": [1e-3, 1e-3]}}
    sensor = hybridtof.parse_sensor(wave)
    with pytest.raises(InvalidInputError, match=r"i = amplitude cos\(phase\)"):
        hybridtof.frames_from_columns(sensor, {"i": [1.0], "q": [1.0], name: [1.0]})
    with pytest.raises(InvalidInputError, match="known_range_m"):
        hybridtof.frames_from_columns(sensor, {"i": [1.0], "q": [1.0], "distance_m": [1.0]})


def test_bad_files(tmp_path: Path) -> None:
    sensor = hybridtof.parse_sensor(PULSED)
    path = tmp_path / "frames.csv"
    path.write_text("i,q\n0.02,0.3\n", encoding="utf-8")
    with pytest.raises(InvalidInputError, match="/i: is not a column of a pulsed sensor"):
        hybridtof.read_frames(sensor, path)
    with pytest.raises(HybridTofError, match="frames are read from"):
        hybridtof.read_frames(sensor, tmp_path / "frames.txt")
    with pytest.raises(FileNotFoundError):
        hybridtof.read_frames(sensor, tmp_path / "none.csv")


def test_an_application_brings_nothing_that_it_may_never_need() -> None:
    """A posterior brings scipy's statistics, and a database that is opened its migrations."""
    late = {"scipy.stats", "scipy.optimize", "scipy.interpolate", "alembic", "emcee", "numba"}
    code = f"import sys, service.app; assert not {late} & sys.modules.keys(), sys.modules.keys()"
    assert "service" in loaded(code)
