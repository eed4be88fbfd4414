"""Machine code is kept under a digest of what it is made of, or in memory where nothing can be."""

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

import simulator.compiled
from simulator import kernel_cache
from simulator.closed import closed


@simulator.compiled.compiled
def twice(x: float) -> float:
    return x + x


@simulator.compiled.compiled
def four_times(x: float) -> float:
    return twice(twice(x))


@simulator.compiled.compiled_for_both
def thrice(x: float, times: int) -> float:
    return 3.0 * x * times


@simulator.compiled.compiled
def nine_times(x: float) -> float:
    return thrice(thrice(x, 0) + thrice(x, 1), 1)


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("KERNELS_COMPILE", "always")


@pytest.mark.usefixtures("always")
def test_a_kernel_that_a_kernel_calls_gets_its_way_in_from_python_when_it_is_used() -> None:
    kernel: Any = twice
    assert four_times(3.0) == 12.0
    assert not kernel.dispatcher.overloads  # the other's machine code is within the caller's
    assert kernel.called.targetoptions["no_cpython_wrapper"]
    assert twice(3.0) == 6.0
    assert len(kernel.dispatcher.overloads) == 1


within: Any = None


def quarter(x: float) -> float:
    return float(within(within(x)))


def eighth(x: float) -> float:
    return float(0.25 * within(x))


@pytest.mark.usefixtures("always")
def test_what_only_kernels_call_is_never_made_runnable_and_taken_in_from_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for taken, (caller, answer) in enumerate([(quarter, 0.75), (eighth, 0.375)]):
        inner: Any = simulator.compiled.compiled(half)
        monkeypatch.setitem(globals(), "within", inner)
        assert simulator.compiled.compiled(caller)(3.0) == answer
        assert sum(inner.called.stats.cache_hits.values()) == taken
    runnable = {
        path.parent.name == "inner": b"ELF" in path.read_bytes() for path in tmp_path.rglob("*.nbc")
    }
    assert runnable == {True: False, False: True}


@pytest.mark.usefixtures("always")
@pytest.mark.parametrize(("said", "whose"), [([closed], "internal"), ([], "linkonce_odr")])
def test_what_a_closed_kernel_calls_is_its_own(
    said: list[Any], whose: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from simulator import inner_code

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    found: dict[str, str] = {}
    optimize = inner_code._Library._optimize_final_module

    def note(library: Any) -> None:
        kept = [one for one in library._final_module.functions if not one.is_declaration]
        found.update({one.name: one.linkage.name for one in kept if "cpython" not in one.name})
        optimize(library)

    monkeypatch.setattr(inner_code._Library, "_optimize_final_module", note)
    monkeypatch.setitem(globals(), "within", simulator.compiled.compiled(half))
    for _ in range(2):  # the second comes from the disk
        kernel: Any = simulator.compiled.compiled(quarter)
        for say in said:
            say(kernel)
        assert kernel(3.0) == 0.75
    assert sum(kernel.dispatcher.stats.cache_hits.values()) == 1
    halves = {name for name in found if "4half" in name}
    (own,) = (name for name in found if "7quarter" in name and name not in halves)
    assert {found[name] for name in halves} == {whose}
    assert found[own] == "external"
    # by name alone others would be given what is called in a way of its own
    assert {name.startswith(own) for name in halves} == {whose == "internal"}


@pytest.mark.usefixtures("always")
def test_numbers_written_in_a_call_are_no_types_and_both_sides_may_share_machine_code() -> None:
    kernel: Any = thrice
    assert nine_times(2.0) == 18.0
    assert thrice(2.0, 1) == 6.0
    assert len(kernel.dispatcher.overloads) == 1


def half(x: float) -> float:
    return 0.5 * x


def no_home() -> Path:
    raise RuntimeError("Could not determine home directory.")


def kept_in(folder: Path) -> dict[str, tuple[int, int]]:
    """Return what lies below a folder, with its size and the time of its last change."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    stats = {path: path.stat() for path in files}
    return {path.name: (found.st_size, found.st_mtime_ns) for path, found in stats.items()}


@pytest.mark.usefixtures("always")
def test_kernels_work_where_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "below"))
    assert kernel_cache.base_folder() is None
    assert simulator.compiled.compiled(half)(3.0) == 1.5
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    assert kernel_cache.base_folder() is None


@pytest.mark.usefixtures("always")
def test_machine_code_is_kept_where_it_can_be_and_used_from_a_copy_that_is_read_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "first"))
    assert simulator.compiled.compiled(half)(3.0) == 1.5
    kinds = {Path(name).suffix for name in kept_in(tmp_path / "first")}
    assert kinds == {".nbi", ".nbc", ".lock"}
    shutil.copytree(tmp_path / "first", tmp_path / "copy", copy_function=shutil.copyfile)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "copy"))
    # as it is for one who may not write: the superuser may in any case
    monkeypatch.setattr("simulator.kernel_cache.os.access", lambda *_: False)
    before = kept_in(tmp_path / "copy")
    kernel: Any = simulator.compiled.compiled(half)
    assert kernel(3.0) == 1.5
    assert sum(kernel.dispatcher.stats.cache_hits.values()) == 1
    assert kernel(3) == 1.5  # of other types: compiled, and not kept
    assert kept_in(tmp_path / "copy") == before


@pytest.mark.parametrize("fault", ["of another user", "others may write"])
def test_machine_code_of_others_is_refused(
    fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = tmp_path / "hybridtof"
    folder.mkdir()
    if fault == "others may write":
        folder.chmod(0o777)
    elif os.getuid() == 0:  # what is the superuser's own is nobody else's to refuse
        os.chown(folder, 12345, -1)
    else:
        another = os.getuid() + 1
        monkeypatch.setattr(os, "getuid", lambda: another)
    with caplog.at_level("WARNING", logger="hybridtof"):
        assert kernel_cache.base_folder() is None
    assert str(folder) in caplog.text


def test_who_is_in_a_hurry_gets_what_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """The interpreter answers at once what it has answered before; nothing is compiled."""

    def half(x: float) -> float:
        return x / 2

    monkeypatch.delenv("KERNELS_COMPILE", raising=False)
    kernel: Any = simulator.compiled.compiled(half)
    with simulator.compiled.ready_only(), pytest.raises(simulator.compiled.NotReadyError):
        kernel(3.0)
    assert kernel(3.0) == 1.5
    with simulator.compiled.ready_only():
        assert kernel(3.0) == 1.5
        with pytest.raises(simulator.compiled.NotReadyError):
            kernel(3)  # another kind of call, which wants machine code of its own
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    with simulator.compiled.ready_only(), pytest.raises(simulator.compiled.NotReadyError):
        kernel(3.0)


def test_who_knows_that_the_interpreter_is_too_slow_does_not_ask_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*_: object) -> tuple[float, float]:
        raise AssertionError("the interpreter is asked")

    monkeypatch.setattr("simulator.uncompiled.run", run)
    monkeypatch.delenv("KERNELS_COMPILE", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel: Any = simulator.compiled.compiled(half)
    with simulator.compiled.at_once(kernel):
        with simulator.compiled.at_once():
            assert kernel(3.0) == 1.5
        assert kernel(3) == 1.5  # another kind of call
    other: Any = simulator.compiled.compiled(half)
    with pytest.raises(AssertionError, match="asked"):
        other(3.0)


def test_who_calls_often_waits_a_tenth_as_long_for_the_interpreter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits: list[float] = []

    def run(_: Any, args: tuple[float], most_s: float) -> tuple[float, float]:
        limits.append(most_s)
        return args[0], 0.0

    monkeypatch.setattr("simulator.uncompiled.run", run)
    monkeypatch.setattr(simulator.compiled, "_START_S", 0.0)
    monkeypatch.delenv("KERNELS_COMPILE", raising=False)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel: Any = simulator.compiled.compiled(half)
    with simulator.compiled.soon(kernel), simulator.compiled.soon():
        kernel(3.0)
    kernel(3.0)
    often: Any = simulator.compiled.hot(simulator.compiled.compiled(half))
    with simulator.compiled.soon(often):
        often(3.0)
    monkeypatch.setenv("KERNELS_COMPILE", "soon")
    kernel(3.0)
    assert limits == pytest.approx([share * limits[1] for share in (0.1, 1.0, 0.1, 0.1)])
    assert limits[1] > 0.0
