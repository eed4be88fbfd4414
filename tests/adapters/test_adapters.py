"""Every adapter of the registry against dumps written by other code from the published formats."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inference.estimate import estimate
from service.adapters import ADAPTERS
from service.adapters.adapter import Adapter, Converted, Settings, converted
from service.cli import main
from service.errors import MalformedError
from service.frame_files import read_table
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import SineWaveSensor
from tests.adapters.writers import WRITERS, Written, tmf882x

BY_NAME = {adapter.name: adapter for adapter in ADAPTERS}
# settings without which an adapter has nothing to go by
NEEDED = {"afbr-s50": Settings(read=(0.5, 0.5), frequency_hz=24e6)}
GIVEN = Settings(read=(0.5, 0.5))
SPEED_OF_LIGHT = 299792458.0


def dump(written: list[Written], form: str) -> bytes:
    frames, rows = zip(*written, strict=True)
    if form == ".bin":
        return b"".join(frames)
    if form == ".hex":
        return "\n".join(f"{frame.hex(' ')}  # {n}" for n, frame in enumerate(frames)).encode()
    lines = [",".join(map(str, row.values())) for row in rows]
    return "\n".join([",".join(rows[0]), *lines]).encode()


def convert(
    name: str, written: list[Written], form: str, settings: Settings | None = None
) -> Converted:
    settings = settings or NEEDED.get(name, GIVEN)
    return converted(BY_NAME[name], dump(written, form), form, settings)


def test_every_adapter_has_a_writer_and_a_name_of_its_own() -> None:
    assert {*WRITERS, "tmf882x"} == set(BY_NAME)
    assert len(BY_NAME) == len(ADAPTERS)
    page = (Path(__file__).parents[2] / "docs" / "adapters.md").read_text()
    for adapter in ADAPTERS:
        assert f"`{adapter.name}`" in page
        assert adapter.title in page


@pytest.mark.parametrize("form", [".bin", ".hex", ".csv"])
@pytest.mark.parametrize("name", WRITERS)
@given(
    modulus=st.floats(100.0, 4000.0),
    phases=st.lists(st.floats(0.05, 6.2), min_size=1, max_size=8),
)
def test_a_round_trip(name: str, form: str, modulus: float, phases: list[float]) -> None:
    """What was written comes back to half a step of its registers, in every form alike."""
    result = convert(name, [WRITERS[name](modulus, phase) for phase in phases], form)
    i, q = (np.array(result.columns[column]) for column in "iq")
    # half a step of a component, or of amplitude (1/16) and of phase
    step = 0.5 if name != "afbr-s50" else 0.5 / 16 + modulus * math.pi / 65536
    assert np.abs(i - modulus * np.cos(phases)).max() <= step * (1 + 1e-12)
    assert np.abs(q - modulus * np.sin(phases)).max() <= step * (1 + 1e-12)


@pytest.mark.parametrize("name", WRITERS)
def test_ranges_of_a_dump(name: str) -> None:
    """From the registers to metres: c phase / (4 pi f), by the frequency of the data sheet."""
    phases = np.linspace(0.2, 5.5, 12)
    result = convert(name, [WRITERS[name](3000.0, phase) for phase in phases], ".bin")
    assert isinstance(result.sensor, SineWaveSensor)
    frequency = {"isl29501": 4.5e6, "opt3101": 10e6, "afbr-s50": 24e6}[name]
    assert result.sensor.frequency_hz == frequency
    # registers without a column of frames are handed on, and no reader mistakes them for one
    table = read_table(json.dumps(dict(result.columns)).encode(), ".json")
    frames = frames_from_columns(result.sensor, table.columns)
    scene = parse_scene({"discrepancy": 0})
    (answer,) = estimate(result.sensor, scene, frames, ["conventional"]).results
    truth = phases * SPEED_OF_LIGHT / (4 * math.pi * frequency)
    # 5 sd of the stated noise and the rounding of the registers
    assert np.all(np.abs(answer.range_m - truth) <= 5 * answer.sd_m)


@pytest.mark.parametrize("name", ["isl29501", "opt3101"])
def test_q_of_the_other_sign_is_turned_by_the_phase_register(name: str) -> None:
    written = [WRITERS[name](2000.0, phase, sign=-1) for phase in (0.3, 1.0, 2.0)]
    result = convert(name, written, ".bin")
    assert np.allclose(result.columns["q"], 2000 * np.sin([0.3, 1.0, 2.0]), atol=0.51)
    assert any("turned" in line for line in result.notes)
    still = convert(name, [WRITERS[name](2000.0, 1.0)] * 3, ".bin")
    assert any("supposed" in line for line in still.notes)


@pytest.mark.parametrize("name", WRITERS)
def test_noise_is_that_of_the_frames(name: str) -> None:
    """Scatter of 400 frames of a steady motion: within 20 %, 4 sd of an estimate by the median."""
    rng = np.random.default_rng(5)
    true = 3000.0 * np.exp(1j * np.linspace(0.4, 0.8, 400))
    noisy = true + rng.normal(0, 20.0, 400) + 1j * rng.normal(0, 20.0, 400)
    written = [WRITERS[name](abs(z), float(np.angle(z))) for z in noisy]
    settings = Settings(frequency_hz=24e6) if name == "afbr-s50" else Settings()
    result = convert(name, written, ".bin", settings)
    assert result.sensor.noise.read == pytest.approx((20.0, 20.0), rel=0.2)
    with pytest.raises(RefusedError, match="state it"):
        convert(name, written[:5], ".bin", settings)


def test_the_shot_noise_monitor_is_the_noise_of_a_pixel() -> None:
    """The mean modulus of two components of sd 2: a Rayleigh law's, 2 sqrt(pi / 2) = 2.507."""
    written = [WRITERS["afbr-s50"](500.0, 1.0, sna=round(16 * 2 * math.sqrt(math.pi / 2)))] * 2
    result = convert("afbr-s50", written, ".bin", Settings(frequency_hz=24e6))
    assert result.sensor.noise.read == pytest.approx((2.0, 2.0), rel=0.01)


def test_what_the_sensor_calls_invalid_is_left_out() -> None:
    good, bad = WRITERS["opt3101"](900.0, 1.0), WRITERS["opt3101"](900.0, 2.0, status=0)
    loud = WRITERS["opt3101"](900.0, 2.0, overload=1)
    result = convert("opt3101", [good, bad, loud, loud], ".csv")
    assert len(result.columns["i"]) == 1
    assert any("left out 2 frames, the first is frame 2" in line for line in result.notes)
    pixel = WRITERS["afbr-s50"]
    statuses = {0x01: False, 0x02: False, 0x04: True, 0x08: False, 0x10: False, 0x20: True}
    written = [pixel(50.0, 1.0, status=status) for status in (0, *statuses, 0x40, 0x80)]
    kept = convert("afbr-s50", written, ".bin").columns["i"]
    assert len(kept) == 1 + sum(statuses.values()) + 1
    with pytest.raises(RefusedError, match="no frame is left"):
        convert("afbr-s50", [pixel(0.0, 1.0)], ".bin")


def test_emitters_are_not_mixed() -> None:
    both = [WRITERS["opt3101"](900.0, 1.0, channel=channel) for channel in (0, 2, 2)]
    with pytest.raises(InvalidInputError, match="several emitters"):
        convert("opt3101", both, ".bin")
    one = convert("opt3101", both, ".bin", Settings(read=(1.0, 1.0), channel=2))
    assert len(one.columns["i"]) == 2
    with pytest.raises(InvalidInputError, match="there are 0, 2"):
        convert("opt3101", both, ".bin", Settings(read=(1.0, 1.0), channel=1))
    for odd in ({"hdr": 1}, {"frequency": 1}):
        mixed = [WRITERS["opt3101"](900.0, 1.0), WRITERS["opt3101"](900.0, 1.0, **odd)]
        with pytest.raises(InvalidInputError, match="convert each alone"):
            convert("opt3101", mixed, ".bin")
    with pytest.raises(InvalidInputError, match="second frequency"):
        convert("opt3101", [WRITERS["opt3101"](900.0, 1.0, frequency=1)], ".bin")


@pytest.mark.parametrize("name", WRITERS)
def test_a_phase_offset_that_no_dump_tells_is_said(name: str) -> None:
    """What it costs is c / (4 pi f) times it: 0.024 m of 0.01 rad at 10 MHz."""
    result = convert(name, [WRITERS[name](900.0, 1.0)] * 3, ".bin")
    assert isinstance(result.sensor, SineWaveSensor)
    metres = 0.01 * SPEED_OF_LIGHT / (4 * math.pi * result.sensor.frequency_hz)
    (line,) = [line for line in result.notes if "phase_offset_rad is taken as 0" in line]
    assert f"0.01 rad of it move every range by {metres:.2g} m" in line
    assert "known_range_m" in line


@pytest.mark.parametrize(
    ("settings", "offset"),
    [
        (Settings(), "timing_offset_s"),
        (Settings(readings="sine_wave", frequency_hz=5e6), "phase_offset_rad"),
    ],
)
def test_how_to_find_the_offset_of_a_histogram_is_said(settings: Settings, offset: str) -> None:
    raw = tmf882x([[2] * 40 + [40000] + [2] * 87], 1e-10)
    notes = converted(BY_NAME["tmf882x"], raw, ".json", settings).notes
    assert f"known_range_m and a prior of {offset}" in notes[0]
    costs = ["0.01 rad of it move every range by 0.048 m at 5 MHz" in line for line in notes[1:]]
    assert costs == ([True] if settings.readings else [])


def test_amplitude_and_phase_of_an_opt3101() -> None:
    settings = Settings(read=(1.0, 1.0), readings="amplitude_phase", period_s=0.5)
    result = convert("opt3101", [WRITERS["opt3101"](900.0, 1.0)] * 3, ".bin", settings)
    assert result.columns["i"][0] == pytest.approx(900 * math.cos(1.0), abs=0.05)
    assert result.columns["time_s"] == [0.0, 0.5, 1.0]
    assert result.columns["tmain"] == [2345.0] * 3
    assert result.columns["amb_data"] == [512.0] * 3


def test_an_automatic_gain_that_changes_is_not_guessed() -> None:
    written = [WRITERS["isl29501"](2000.0, 1.0, gain=gain) for gain in (1000, 1500)]
    with pytest.raises(InvalidInputError, match="no public source says"):
        convert("isl29501", written, ".bin")
    linear = convert("isl29501", written, ".bin", Settings(read=(1.0, 1.0), agc="linear"))
    assert linear.columns["gain"] == [1.0, 1.5]
    plain = convert("isl29501", written, ".bin", Settings(read=(1.0, 1.0), agc="compensated"))
    assert "gain" not in plain.columns


def test_histograms() -> None:
    """A pulse of photons in one bin, on a floor: w1 / w2 is its place in the histogram."""
    histograms = [[2] * 40 + [40000] + [2] * 87, [2] * 60 + [30000] + [2] * 67]
    raw = tmf882x(histograms, 1e-10)
    result = converted(BY_NAME["tmf882x"], raw, ".json", Settings(period_s=0.1))
    w1, w2 = (np.array(result.columns[name]) for name in ("w1", "w2"))
    assert w2 == pytest.approx([39998.0, 29998.0])
    assert w1 / w2 == pytest.approx(np.array([40.5, 60.5]) / 128)
    assert result.columns["time_s"] == [0.0, 0.1]
    wave = converted(
        BY_NAME["tmf882x"], raw, ".json", Settings(readings="sine_wave", frequency_hz=5e6)
    )
    angle = np.arctan2(wave.columns["q"], wave.columns["i"])
    assert angle == pytest.approx(2 * math.pi * 5e6 * 1e-10 * np.array([40.5, 60.5]))
    with pytest.raises(RefusedError, match="frame 0 has no photon"):
        converted(BY_NAME["tmf882x"], tmf882x([[2] * 128], 1e-10), ".json", Settings())


@pytest.mark.parametrize("adapter", ADAPTERS, ids=lambda adapter: adapter.name)
@given(raw=st.binary(max_size=120), form=st.sampled_from([".bin", ".hex", ".csv", ".json", ".x"]))
def test_junk_is_refused_by_name(adapter: Adapter, raw: bytes, form: str) -> None:
    """Whatever the bytes, an error of the project or finite frames."""
    try:
        result = converted(adapter, raw, form, NEEDED.get(adapter.name, GIVEN))
    except (InvalidInputError, MalformedError, RefusedError):
        return
    assert all(np.isfinite(column).all() for column in result.columns.values())


def histograms(*zones: list[float], width: str = "1e-10") -> bytes:
    """Positions of one zone each."""
    positions = [{"zone_histograms": [zone]} for zone in zones]
    return f'{{"bin_width_s": {width}, "positions": {json.dumps(positions)}}}'.encode()


@pytest.mark.parametrize(
    ("name", "raw", "form", "settings", "match"),
    [
        ("isl29501", b"\0" * 24, ".bin", GIVEN, "24 bytes are no whole number of frames of 23"),
        ("isl29501", b"", ".bin", GIVEN, "holds no frame"),
        ("isl29501", b"00 11\n", ".hex", GIVEN, "line 1: has 2 bytes where a frame has 23"),
        ("isl29501", b"0g", ".hex", GIVEN, "line 1: must be pairs"),
        ("isl29501", b"i_raw\n1\n", ".csv", GIVEN, "/i_raw_exponent: is missing"),
        ("isl29501", b"w1\n1\n", ".csv", GIVEN, "/w1: is no register"),
        ("opt3101", b"i,q\n1,8388608\n", ".csv", GIVEN, "/q: line 2: must be an integer"),
        ("opt3101", b"i,q\n1,1.5\n", ".csv", GIVEN, "/q: line 2: must be an integer"),
        ("opt3101", b"i,q,i\n1,1,1\n", ".csv", GIVEN, "/i: the column is repeated"),
        ("opt3101", b"i,q\n1\n", ".csv", GIVEN, "line 2: has 1 fields"),
        ("opt3101", b"i,q,time_s\n1,1,x\n", ".csv", GIVEN, "/time_s: line 2"),
        ("opt3101", b"i\n1\n", ".csv", GIVEN, "/q: is missing"),
        ("opt3101", b"i,q\n1,1\n", ".csv", Settings(readings="w"), "/readings: must be iq or"),
        ("opt3101", b"i,q\n1,1\n", ".csv", Settings(agc="linear"), "/agc: says nothing"),
        ("opt3101", b"i,q\n1,1\n", ".csv", Settings(read=(0.0, 1.0)), "/read: must lie between"),
        ("opt3101", b"i,q\n1,1\n", ".csv", Settings(read=(1e99, 1.0)), "/read: must lie between"),
        ("opt3101", b"i,q\n1,1\n", ".csv", Settings(frequency_hz=1e99), "/frequency_hz: must lie"),
        ("opt3101", b"i,q\n1,1\n", ".json", GIVEN, "/form: a dump of the TI OPT3101 is .bin"),
        ("afbr-s50", b"phase,amplitude\n1,1\n", ".csv", GIVEN, "/frequency_hz: must be stated"),
        ("tmf882x", b"{", ".json", Settings(), "JSON"),
        ("tmf882x", b"{}", ".json", Settings(), "/bin_width_s"),
        ("tmf882x", histograms([1], width="-1"), ".json", Settings(), "/bin_width_s: Input"),
        ("tmf882x", histograms([1], width="0"), ".json", Settings(), "/bin_width_s: Input"),
        ("tmf882x", histograms([1], width="NaN"), ".json", Settings(), "/bin_width_s: Input"),
        ("tmf882x", histograms([1], width='"1"'), ".json", Settings(), "/bin_width_s: Input"),
        ("tmf882x", histograms(), ".json", Settings(), "/positions: "),
        ("tmf882x", histograms([1] * 9), ".json", Settings(), "/zone_histograms/0: has 9"),
        ("tmf882x", histograms([1] * 128, [1] * 129), ".json", Settings(), "histograms/0: has 129"),
        ("tmf882x", histograms([-1] * 128), ".json", Settings(), "histograms/0/0: Input"),
        ("tmf882x", histograms([math.inf]), ".json", Settings(), "histograms/0/0: Input"),
    ],
)  # fmt: skip
def test_bad_input_is_named(
    name: str, raw: bytes, form: str, settings: Settings, match: str
) -> None:
    with pytest.raises((InvalidInputError, MalformedError), match=match):
        converted(BY_NAME[name], raw, form, settings)


def test_exponents_beyond_any_converter() -> None:
    raw = b"i_raw_exponent,i_raw,q_raw_exponent,q_raw\n0,1,0,1\n0,1,32,1\n"
    with pytest.raises(InvalidInputError, match="/q_raw_exponent: frame 1"):
        converted(BY_NAME["isl29501"], raw, ".csv", GIVEN)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "dump.hex"
    path.write_bytes(dump([WRITERS["opt3101"](900.0, p) for p in (1.0, 1.2, 1.4)], ".hex"))
    out, scene = tmp_path / "frames.csv", tmp_path / "scene.json"
    arguments = ["convert", "opt3101", str(path), "--read", "2", "2", "--period-s", "0.1"]
    assert main([*arguments, "--output", str(out), "--document", str(scene)]) == 0
    said = capsys.readouterr()
    printed = json.loads(said.out)
    assert printed["sensor"]["noise"]["read"] == [2.0, 2.0]
    assert "note: phase_offset_rad is taken as 0" in said.err
    assert any("phase_offset_rad is taken as 0" in line for line in printed["notes"])
    assert read_table(out.read_bytes(), ".csv").columns.i == printed["frames"]["i"]
    assert main(["estimate", str(out), "--scene", str(scene)]) == 0
    body = json.loads(capsys.readouterr().out)
    found = [frame["range_m"] for frame in body["results"][0]["frames"]]
    assert found == pytest.approx(
        np.array([1.0, 1.2, 1.4]) * SPEED_OF_LIGHT / (4e7 * math.pi), rel=2e-3
    )
    assert main([*arguments[:3], "--agc", "linear"]) == 2
    assert "--agc" in capsys.readouterr().err
    assert main(["convert", "vl53l0x", str(path)]) == 2
    assert "isl29501, opt3101" in capsys.readouterr().err
