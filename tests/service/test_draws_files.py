"""Draws as files: what goes in comes out, and ArviZ reads it as it should."""

import io
import json
import warnings
from pathlib import Path
from typing import Any

import h5netcdf
import numpy as np
import pytest

from inference.posterior.sampling.diagnostics import split_r_hat
from service.draws_described import DescribedDraws, describe_draws
from service.draws_formats import accepted_format
from service.draws_ndjson import to_ndjson
from service.draws_netcdf import to_netcdf
from tests.service.drawn import ENSEMBLES, SATURATED, STEPS, THINNED, WALKERS, draws, job


@pytest.fixture
def described() -> DescribedDraws:
    return describe_draws(job(), "emcee", draws())


def test_netcdf_holds_the_draws(described: DescribedDraws) -> None:
    data = to_netcdf(described)
    with h5netcdf.File(io.BytesIO(data), "r") as file:
        assert set(file.groups) == {
            "posterior",
            "sample_stats",
            "posterior_predictive",
            "log_likelihood",
            "observed_data",
            "constant_data",
        }
        assert file.attrs["seed"] == 3
        assert json.loads(file.attrs["sensor"])["kind"] == "pulsed"
        posterior = file["posterior"]
        chain = (ENSEMBLES, WALKERS * STEPS)
        for j, name in enumerate(described.draws.names):
            values = posterior[name]
            assert values.dimensions == ("chain", "draw")
            wanted = described.draws.parameters[..., j].reshape(chain)
            assert np.array_equal(values[...], wanted)
        assert posterior["object.c0"].attrs["units"] == "m2"
        stats = file["sample_stats"]
        assert np.array_equal(stats["lp"][...], described.draws.log_density.reshape(chain))
        assert np.array_equal(stats["mode"][...], described.draws.mode.reshape(chain))
        assert np.array_equal(stats["accepted"][...], described.draws.accepted.reshape(chain))
        # walker by walker, each step by step
        assert posterior["walker"][...].tolist() == np.repeat(np.arange(WALKERS), STEPS).tolist()
        assert np.array_equal(posterior["step"][...], np.tile(described.draws.step, WALKERS))
        predictive = file["posterior_predictive"]
        assert predictive["frame"][...].tolist() == [0, 1, 3, 4]
        assert predictive["range_m"].dimensions == ("chain", "draw", "frame")
        assert predictive["w1"].shape == (ENSEMBLES, WALKERS * THINNED, 4)
        for group in (predictive, file["log_likelihood"]):
            number = group["draw"][...]
            assert np.array_equal(group["walker"][...], number // STEPS)
            assert np.array_equal(group["step"][...], described.draws.step[number % STEPS])
        assert np.isfinite(predictive["range_m"][...]).all()
        observed = file["observed_data"]
        assert np.array_equal(observed["w2"][...], described.readings[:, 1])
        assert file["constant_data"]["time_s"][...].tolist() == [0.0, 1.0, 3.0, 4.0]


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


def test_ndjson_holds_the_draws(described: DescribedDraws) -> None:
    lines = [json.loads(line) for line in to_ndjson(described).splitlines()]
    assert len(lines) == ENSEMBLES * WALKERS * STEPS
    order = [(line["ensemble"], line["walker"], line["step"]) for line in lines]
    assert order == sorted(order)
    line, of = lines[STEPS + 1], described.draws
    assert (line["ensemble"], line["walker"], line["step"]) == (0, 1, 14)
    assert line["parameters"] == dict(zip(of.names, of.parameters[0, 1, 1], strict=True))
    assert line["mode"] == of.mode[0, 1, 1]
    assert "range_m" not in line
    with_ranges = [line for line in lines if "range_m" in line]
    assert len(with_ranges) == ENSEMBLES * WALKERS * THINNED
    for line in with_ranges[:3]:
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
    form = accepted_format(accept)
    assert (None if form is None else form.suffix) == suffix
