"""Draws as files: what goes in comes out, and ArviZ reads it as it should."""

import io
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import pytest

from inference.posterior.answer.inference_data import inference_data
from inference.posterior.sampling.diagnostics import split_r_hat
from service.exports import EXPORTS, export_by
from service.exports.described import DescribedDraws, describe_draws
from service.exports.export import Export
from service.exports.ndjson import to_ndjson
from service.exports.negotiation import accepted_export
from service.exports.netcdf import to_netcdf
from tests.service.drawn import ENSEMBLES, SATURATED, STEPS, THINNED, WALKERS, draws, job


@pytest.fixture
def described() -> DescribedDraws:
    return describe_draws(job(), "emcee", draws())


Read = dict[str, Any]


def read_netcdf(data: bytes) -> Read:
    """What a reader finds, in the arrays and the order of `Draws`."""
    with h5netcdf.File(io.BytesIO(data), "r") as file:
        posterior, stats = file["posterior"], file["sample_stats"]
        predictive, likelihood = file["posterior_predictive"], file["log_likelihood"]
        observed, constant = file["observed_data"], file["constant_data"]
        chains, draws = (posterior[name].shape[0] for name in ("chain", "draw"))
        # walker by walker, each step by step
        walkers = int(posterior["walker"][...].max()) + 1
        steps = draws // walkers
        assert posterior["walker"][...].tolist() == np.repeat(np.arange(walkers), steps).tolist()
        by_draw = (chains, walkers, steps)
        names = [name for name in posterior.variables if "." in name]
        number = predictive["draw"][...]
        for group in (predictive, likelihood):
            assert np.array_equal(group["draw"][...], number)
            assert np.array_equal(group["walker"][...], number // steps)
            assert np.array_equal(group["step"][...], posterior["step"][...][number])
        thinned = np.unique(number % steps)
        by_frame = (chains, walkers, thinned.size, -1)
        columns = [name for name in observed.variables if name != "frame"]
        readings = [predictive[name][...].reshape(by_frame) for name in columns]
        return {
            "names": tuple(names),
            "parameters": np.stack([posterior[n][...].reshape(by_draw) for n in names], axis=-1),
            "units": [posterior[name].attrs["units"] for name in names],
            "log_density": stats["lp"][...].reshape(by_draw),
            "accepted": stats["accepted"][...].reshape(by_draw),
            "mode": stats["mode"][...].reshape(by_draw),
            "step": posterior["step"][...][:steps],
            "thinned": thinned,
            "columns": tuple(columns),
            "frames": predictive["frame"][...],
            "range_m": predictive["range_m"][...].reshape(by_frame),
            "readings": np.stack(readings, axis=-1),
            "log_likelihood": likelihood["readings"][...].reshape(by_frame),
            "observed": np.stack([observed[name][...] for name in columns], axis=-1),
            "known": {n: constant[n][...].tolist() for n in constant.variables if n != "frame"},
            "attributes": {
                name: file.attrs[name]
                for name in ("method", "seed", "sensor", "scene", "inference_library_version")
            },
        }


def read_ndjson(data: bytes) -> Read:
    lines = [json.loads(line) for line in data.splitlines()]
    labels = [(line["ensemble"], line["walker"], line["step"]) for line in lines]
    assert labels == sorted(labels)
    shape = tuple(len({label[k] for label in labels}) for k in range(3))
    with_ranges = [line for line in lines if "range_m" in line]
    thinned = [k for k in range(shape[2]) if "range_m" in lines[k]]
    frames = [k for k, value in enumerate(with_ranges[0]["range_m"]) if value is not None]
    by_frame = (*shape[:2], len(thinned), len(frames))

    def per_frame(rows: list[list[float | None]]) -> Any:
        whole = np.array(rows, dtype=float)
        used = np.isin(np.arange(whole.shape[1]), frames)
        assert np.isnan(whole[:, ~used]).all()
        return whole[:, used].reshape(by_frame)

    columns = tuple(with_ranges[0]["readings"])
    readings = [per_frame([line["readings"][name] for line in with_ranges]) for name in columns]
    names = tuple(lines[0]["parameters"])
    parameters = [[line["parameters"][name] for name in names] for line in lines]
    return {
        "names": names,
        "parameters": np.array(parameters).reshape(*shape, len(names)),
        **{
            name: np.array([line[name] for line in lines]).reshape(shape)
            for name in ("log_density", "accepted", "mode")
        },
        "step": np.array([label[2] for label in labels[: shape[2]]]),
        "thinned": np.array(thinned),
        "columns": columns,
        "frames": np.array(frames),
        "range_m": per_frame([line["range_m"] for line in with_ranges]),
        "readings": np.stack(readings, axis=-1),
        "log_likelihood": per_frame([line["log_likelihood"] for line in with_ranges]),
    }


# how a client reads each form: a form that is added to the registry needs its reader here
READERS: dict[str, Callable[[bytes], Read]] = {".nc": read_netcdf, ".ndjson": read_ndjson}
# what every form must hold, and what only one that has a place for it must
ALWAYS = {
    "names", "parameters", "log_density", "accepted", "mode", "step", "thinned", "columns",
    "frames", "range_m", "readings", "log_likelihood",
}  # fmt: skip
ASKED = {"units", "observed", "known", "attributes"}


def written(described: DescribedDraws) -> Read:
    """What went in, to the last bit."""
    of, frames = described.draws, described.frames
    return {
        **{name: getattr(of, name) for name in ALWAYS - {"columns", "frames"}},
        "columns": described.columns,
        "frames": frames,
        "range_m": of.range_m[..., frames],
        "readings": of.readings[..., frames, :],
        "log_likelihood": of.log_likelihood[..., frames],
        "units": ["m2", "1"],
        "observed": described.readings,
        "known": {name: column.tolist() for name, column in described.columns_of_frames.items()},
        "attributes": {
            name: described.attributes[name]
            for name in ("method", "seed", "sensor", "scene", "inference_library_version")
        },
    }


@pytest.mark.parametrize("export", EXPORTS, ids=lambda export: export.suffix)
def test_what_is_read_back_is_what_was_written(export: Export, described: DescribedDraws) -> None:
    found, wanted = READERS[export.suffix](export.write(described)), written(described)
    assert found.keys() >= ALWAYS
    assert found.keys() <= ALWAYS | ASKED
    for name, value in found.items():
        if isinstance(value, np.ndarray):
            assert value.shape == wanted[name].shape, name
            assert np.array_equal(value, wanted[name]), name
        else:
            assert value == wanted[name], name


def test_every_form_has_a_reader_a_media_type_and_a_suffix_of_its_own() -> None:
    assert [export.suffix for export in EXPORTS] == list(READERS)
    assert len({export.media_type for export in EXPORTS}) == len(EXPORTS)
    for export in EXPORTS:
        assert export_by(export.media_type) is export
        assert accepted_export(export.media_type) is export
    with pytest.raises(KeyError):
        export_by("text/html")


def test_netcdf_has_the_groups_of_arviz(described: DescribedDraws) -> None:
    with h5netcdf.File(io.BytesIO(to_netcdf(described)), "r") as file:
        assert set(file.groups) == {
            "posterior",
            "sample_stats",
            "posterior_predictive",
            "log_likelihood",
            "observed_data",
            "constant_data",
        }
        assert file["posterior"]["object.c0"].dimensions == ("chain", "draw")
        assert file["posterior_predictive"]["range_m"].dimensions == ("chain", "draw", "frame")
        assert file["posterior_predictive"]["frame"][...].tolist() == [0, 1, 3, 4]


def test_arviz_reads_one_chain_an_ensemble(described: DescribedDraws, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # ArviZ announces its next version at import
        arviz = pytest.importorskip("arviz", reason="arviz is not installed")
    path = tmp_path / "draws.nc"
    path.write_bytes(to_netcdf(described))
    read: Any = arviz.from_netcdf(str(path))
    assert read.posterior.sizes == {"chain": ENSEMBLES, "draw": WALKERS * STEPS}
    assert set(read.posterior.data_vars) == {"object.c0", "object.c2"}
    assert {"walker", "step"} <= set(read.posterior.coords)
    assert read.posterior_predictive["range_m"].dims == ("chain", "draw", "frame")
    # split in halves of the walkers' steps, as ours is: the same formula, to rounding
    by_step = read.posterior.sortby(["step", "walker"])
    for j, name in enumerate(described.draws.names):
        ours = split_r_hat(described.draws.parameters[..., j])
        assert float(arviz.rhat(by_step)[name]) == pytest.approx(ours, rel=1e-10)
        # as stored, halves of walkers: close, and as blind or not to a lost ensemble
        assert float(arviz.rhat(read)[name]) == pytest.approx(ours, abs=0.02)
    # neighbours are steps of one walker, so that ArviZ sees their correlation: with a half
    # forgotten at each step, a third of the draws count
    ess = float(arviz.ess(read)["object.c0"])
    assert 0.2 < ess / (ENSEMBLES * WALKERS * STEPS) < 0.5
    summary = arviz.summary(read, kind="stats", hdi_prob=0.9)
    assert list(summary.index) == list(described.draws.names)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of frames that weigh much: these are random numbers
        assert np.isfinite(arviz.loo(read).elpd_loo)


def test_ndjson_has_ranges_in_some_lines_and_nulls_for_a_saturated_frame(
    described: DescribedDraws,
) -> None:
    lines = [json.loads(line) for line in to_ndjson(described).splitlines()]
    assert len(lines) == ENSEMBLES * WALKERS * STEPS
    with_ranges = [line for line in lines if "range_m" in line]
    assert len(with_ranges) == ENSEMBLES * WALKERS * THINNED
    for line in with_ranges:
        assert line["range_m"][SATURATED] is line["readings"]["w1"][SATURATED] is None
        assert len(line["range_m"]) == len(line["log_likelihood"]) == 5


@pytest.mark.parametrize(
    ("accept", "suffix"),
    [
        ("", ".nc"),
        ("*/*", ".nc"),
        ("application/*", ".nc"),
        ("application/x-netcdf", ".nc"),
        ("application/x-ndjson", ".ndjson"),
        ("application/ndjson", ".ndjson"),
        ("application/x-netcdf;q=0.1, application/x-ndjson;q=0.9", ".ndjson"),
        ("application/x-ndjson;q=0, */*", ".nc"),
        ("application/x-netcdf;q=0, */*;q=0.5", ".ndjson"),
        ("text/html, */*;q=0.1", ".nc"),
        ("application/json", None),
        ("application/x-netcdf;q=0", None),
        ("application/x-netcdf;q=many", None),
        (";;,,", None),
    ],
)
def test_negotiation(accept: str, suffix: str | None) -> None:
    form = accepted_export(accept)
    assert (None if form is None else form.suffix) == suffix


@pytest.mark.filterwarnings("default")  # arviz and what it brings
def test_draws_in_memory_are_steps_in_time_for_arviz() -> None:
    arviz: Any = pytest.importorskip("arviz", reason="arviz is not installed")
    made = draws()
    data = inference_data(made, "emcee", 3)
    chains = ENSEMBLES * WALKERS
    posterior, every = data["posterior"], data["every_step"]
    assert posterior["range_m"].shape == (chains, THINNED, 4)
    # the saturated frame has no draws
    assert posterior["frame"].values.tolist() == [0, 1, 3, 4]
    assert data["posterior_predictive"]["first"].dims == ("chain", "draw", "frame")
    at = {"chain": 2 * WALKERS + 1, "draw": 4}
    assert (int(every["ensemble"][at["chain"]]), int(every["walker"][at["chain"]])) == (2, 1)
    assert float(every["object.c2"][at]) == made.parameters[2, 1, 4, 1]
    assert float(every["lp"][at]) == made.log_density[2, 1, 4]
    step = made.thinned[3]
    assert int(posterior["draw"][3]) == made.step[step]
    assert float(posterior["range_m"][at["chain"], 3, 2]) == made.range_m[2, 1, 3, 3]
    assert float(posterior["object.c0"][at["chain"], 3]) == made.parameters[2, 1, step, 0]
    # each step keeps half of the one before: over walkers lined up it would not show
    one = every["object.c0"].values[:, :-1] * every["object.c0"].values[:, 1:]
    # autocorrelation of 1176 pairs, whose standard error is below 0.04
    assert one.mean() / every["object.c0"].values.var() == pytest.approx(0.5, abs=0.16)
    assert np.isfinite(arviz.loo(data).elpd_loo)
