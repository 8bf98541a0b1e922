"""Draws of a posterior: as often above the truth as below it, as wide as the intervals, convergence told."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chisquare
from typer.testing import CliRunner

import rollover as ro
from rollover.calibration.posterior import r_hat, sampled
from rollover.cli.main import app
from rollover.recording.importers import write_recording
from tests.diagnosis.drops import recorded
from viz.figures.corner import highest

pytest.importorskip("emcee", reason="draws need the extra `posterior`")


def test_ranks_of_the_truth_among_the_draws_are_uniform() -> None:
    """Simulation-based calibration: truths from the prior, data from the truths, draws from the data."""
    rng = np.random.default_rng(1)
    n, p, sigma, ranks = 30, 4, 0.3, []
    A = rng.standard_normal((n, p))
    A[:, 1] = A[:, 0] + 0.5 * A[:, 1]  # two that are told apart badly
    covariance = sigma**2 * np.linalg.inv(A.T @ A)
    for k in range(120):
        truth = rng.uniform(size=p)
        y = A @ truth + sigma * rng.standard_normal(n)
        centre = np.clip(np.linalg.lstsq(A, y, rcond=None)[0], 0.0, 1.0)

        def log_density(u: np.ndarray, y: np.ndarray = y) -> float:
            r = (y - A @ u) / sigma
            return -0.5 * float(r @ r)

        draws = sampled(log_density, centre, covariance, draws=960, seed=k).draws
        assert np.all((draws >= 0.0) & (draws <= 1.0))
        ranks.append(np.mean(draws < truth, axis=0))
    for each in np.array(ranks).T:
        counts, _ = np.histogram(each, bins=8, range=(0.0, 1.0))
        assert chisquare(counts).pvalue > 0.05, counts


def test_a_ridge_that_is_no_ellipse_is_followed() -> None:
    """Only the product is told: along u v = 1/4 the density of log u is even, which no quadratic approximation has."""

    def log_density(u: np.ndarray) -> float:
        return -0.5 * ((float(u[0] * u[1]) - 0.25) / 0.05) ** 2

    found = sampled(log_density, np.array([0.5, 0.5]), np.array([[0.04, -0.035], [-0.035, 0.04]]), draws=20_000, seed=2)
    grid = (np.arange(1000) + 0.5) / 1000.0
    u, v = np.meshgrid(grid, grid, indexing="ij")
    density = np.exp(-0.5 * ((u * v - 0.25) / 0.05) ** 2).sum(axis=1)
    wanted = float(np.sum(grid * density) / density.sum())
    assert found.draws[:, 0].mean() == pytest.approx(wanted, abs=0.02)
    spread = float(np.sqrt(np.sum((grid - wanted) ** 2 * density) / density.sum()))
    assert found.draws[:, 0].std() == pytest.approx(spread, rel=0.1)


def test_walkers_that_do_not_agree_are_told() -> None:
    rng = np.random.default_rng(0)
    alike = rng.standard_normal((400, 8, 1))
    assert r_hat(alike)[0] == pytest.approx(1.0, abs=0.01)
    apart = alike + np.where(np.arange(8) < 4, 0.0, 2.0)[None, :, None]
    assert r_hat(apart)[0] > 1.2
    drifting = alike + np.linspace(0.0, 3.0, 400)[:, None, None]
    assert r_hat(drifting)[0] > 1.1
    assert r_hat(np.zeros((400, 8, 1)))[0] == np.inf, "walkers that never moved agree on nothing"


def test_contours_hold_the_shares_that_are_said() -> None:
    rng = np.random.default_rng(0)
    counts, _, _ = np.histogram2d(*rng.standard_normal((2, 200_000)), bins=40)
    outer, inner = highest(counts)
    assert counts[counts >= outer].sum() / counts.sum() == pytest.approx(0.95, abs=0.01)
    assert counts[counts >= inner].sum() / counts.sum() == pytest.approx(0.68, abs=0.03)


def asked(*words: str) -> Any:
    return CliRunner().invoke(app, list(words), env={"COLUMNS": "200", "TERM": "dumb", "NO_COLOR": "1"})


@pytest.fixture(scope="module")
def drops(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drops")
    for name, recording in recorded({"vehicle.mass": 140.0}, speeds=(2.0, 3.0)):
        write_recording(recording, folder / f"{name}.csv")
    return folder


def test_the_draws_of_a_calibration_agree_with_its_intervals(drops: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    fit = ["--fit", "vehicle.mass", "--fit", "ground.law.stiffness_scale=0.3:3", "--starts", "0"]
    words = ["calibrate", "drop_test", str(drops), *fit, "--out", str(out)]
    done = asked(*words, "--posterior", "--draws", "1000")
    assert done.exit_code == 0, done.output
    assert "posterior: 1000 samples by emcee" in done.output
    answer = json.loads((out / "calibrate.json").read_text())
    told = answer["posterior"]
    assert told["draws"] == 1000
    with (out / "posterior.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == list(answer["parameters"])
    draws = np.array(rows[1:], dtype=float)
    assert draws.shape == (1000, 2)
    for k, (path, e) in enumerate(answer["parameters"].items()):
        each = told["parameters"][path]
        width = e["high"] - e["low"]
        assert each["low"] == pytest.approx(e["low"], abs=0.15 * width)
        assert each["high"] == pytest.approx(e["high"], abs=0.15 * width)
        assert each["mean"] == pytest.approx(float(draws[:, k].mean()), rel=1e-6)
        assert each["r_hat"] < 1.1
        assert 1.0 <= each["autocorrelation_time"] < 10.0
        assert each["effective_draws"] > 100.0
    paths = ["vehicle.mass", "ground.law.stiffness_scale=0.3:3"]
    fitted = ro.calibrate("drop_test", drops, paths, starts=0, posterior=1000)
    assert np.allclose(fitted.draws, draws, rtol=1e-8), "the same draws from Python"
    assert ro.calibrate("drop_test", drops, paths, starts=0).draws.shape == (0, 2)
    assert told["correlation"][0][1] == pytest.approx(answer["correlation"][0][1], abs=0.1)
    page = (out / "report.html").read_text()
    assert "What stays open" in page
    assert "Samples of the posterior" in page
    without = asked(*words, "--force")
    assert without.exit_code == 0, without.output
    again = json.loads((out / "calibrate.json").read_text())
    assert "posterior" not in again
    assert not (out / "posterior.csv").exists()
    same = {key: value for key, value in answer.items() if key not in ("posterior", "draws")}
    assert again == same, "draws change nothing of the fit"


def test_without_the_package_the_cure_is_named(drops: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "emcee", None)
    out = tmp_path / "out"
    done = asked("calibrate", "drop_test", str(drops), "--fit", "vehicle.mass", "--posterior", "--out", str(out))
    assert done.exit_code == 2
    assert "pip install 'rollover[posterior]'" in done.output
    assert not out.exists()
