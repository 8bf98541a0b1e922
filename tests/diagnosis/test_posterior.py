"""`diagnose --posterior`: draws of what is named, beside its intervals; what has none is told."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest
from typer.testing import CliRunner

import rollover as ro
from rollover.cli.main import app
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.forward.averaging import simulated
from rollover.diagnosis.inference.posterior import drawn
from rollover.diagnosis.own_model.declaration import found_at
from rollover.effects import Search
from rollover.recording.importers import write_recording
from tests.diagnosis.drops import recorded, scenario

pytest.importorskip("emcee", reason="draws need the extra `posterior`")

RANGE = Search(200.0, 450.0, "log")
DAMPED = {"effects.soil-viscous-damping.damping": 300.0, "effects.soil-viscous-damping.exponent": 1.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("drops")
    for name, recording in recorded(DAMPED, speeds=(1.5, 2.5, 3.5)):
        write_recording(recording, place / f"{name}.csv")
    return place


def asked(*words: object) -> Any:
    env = {"COLUMNS": "200", "TERM": "dumb", "NO_COLOR": "1"}
    return CliRunner().invoke(app, ["diagnose", *map(str, words)], env=env)


def test_draws_of_what_is_named_lie_where_its_interval_does(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["drop_test", folder, "--workers", "0", "--out", out]
    done = asked(*words, "--posterior", "--draws", "1000")
    assert done.exit_code == 0, done.output
    answer = json.loads((out / "diagnosis.json").read_text())
    (effect,) = answer["effects"]
    told = answer["posterior"]
    with (out / "posterior.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == list(told["parameters"])
    draws = np.array(rows[1:], dtype=float)
    assert draws.shape == (1000, len(rows[0]))
    k = rows[0].index(f"{effect['id']}.damping")
    one, each = effect["parameters"]["damping"], told["parameters"][rows[0][k]]
    width = one["high"] - one["low"]
    assert each["mean"] == pytest.approx(float(draws[:, k].mean()), rel=1e-6)
    assert abs(each["median"] - one["value"]) < 0.25 * width
    # the interval has a gain error of the model in each channel beside what the draws have
    assert 0.25 * width < each["high"] - each["low"] < width
    assert each["low"] < 300.0 < each["high"]
    assert each["r_hat"] < 1.1
    text = (out / "report.html").read_text()
    assert "What stays open" in text
    assert "--posterior --draws 1000" in text
    found = ro.diagnose("drop_test", folder, posterior=1000)
    assert found.posterior is not None
    assert list(found.posterior.names) == rows[0]
    # posterior.csv has nine digits
    assert np.allclose(found.posterior.values, draws, rtol=1e-8), "the same draws from Python"
    without = asked(*words, "--force")
    assert without.exit_code == 0, without.output
    again = json.loads((out / "diagnosis.json").read_text())
    assert not (out / "posterior.csv").exists()
    drop = ("posterior", "draws", "seconds", "simulations")
    assert {k: v for k, v in again.items() if k not in drop} == {k: v for k, v in answer.items() if k not in drop}


def test_ranks_of_the_truth_among_the_draws_are_uniform() -> None:
    """Simulation-based calibration: damping and clocks from their priors, drops from these, draws from the drops.

    Twenty drawn as widely as a campaign leaves open would stray from uniform by half of that here and there; draws half
    as wide as they should be, or off by one deviation, are seen (tested by hand).
    """
    candidate = Candidate(id="soil-viscous-damping", kind="physics", family="", search={"damping": RANGE})
    rng, ranks = np.random.default_rng(5), []
    for k in range(20):
        true = float(RANGE.low * (RANGE.high / RANGE.low) ** rng.uniform())
        changes = {"effects.soil-viscous-damping.damping": true}
        every = recorded(changes, seed=k, speeds=(2.0, 3.5), noise=0.03, rate=200.0)
        found = [dataset_of(name, *simulated(scenario(), r)) for name, r in every]
        problem = Problem([e for e in found if e is not None])
        estimate_time_shifts(problem)
        fitted = problem.fit((candidate,), (0.5,))
        assert fitted is not None
        values = drawn(problem, fitted, 500, seed=k).values
        ranks.append(float(np.mean(values[:, 0] < true)))
    assert kstest(ranks, "uniform").pvalue > 0.05, sorted(ranks)


def test_nothing_named_has_no_draws(tmp_path: Path) -> None:
    for name, recording in recorded({}, speeds=(2.0, 3.0)):
        write_recording(recording, tmp_path / "rec" / f"{name}.csv")
    done = asked("drop_test", tmp_path / "rec", "--workers", "0", "--out", tmp_path / "out", "--posterior")
    assert done.exit_code == 0, done.output
    assert "nothing is named, so that there are no samples" in done.output
    assert "posterior" not in json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert not (tmp_path / "out" / "posterior.csv").exists()


def test_an_overturn_and_a_model_of_ones_own_are_refused(folder: Path, tmp_path: Path) -> None:
    done = asked("side_overturn", folder, "--out", tmp_path / "out", "--posterior")
    assert (done.exit_code, "--posterior: of drops only, got an overturn" in done.stderr) == (2, True), done.output
    done = asked("--model", "duffing", folder, "--out", tmp_path / "out", "--posterior")
    assert (done.exit_code, "--posterior: beside --model" in done.stderr) == (2, True), done.output
    assert not (tmp_path / "out").exists()


def test_from_python_what_has_no_draws_is_refused(folder: Path) -> None:
    for what, asked_for, words in (
        ("side_overturn", True, "posterior: of drops only, got an overturn"),
        ("drop_test", 20, "posterior: out of bounds, got 20; 500 to 1e\\+06 is allowed"),
        ("drop_test", -1, "posterior: out of bounds, got -1"),
        ("drop_test", 1e3 + 0.5, "posterior: not a whole number, got 1000.5"),
        (found_at("duffing"), True, "not of a model of one's own; .* posterior"),
    ):
        with pytest.raises(ro.InputError, match=words):
            ro.diagnose(what, folder, posterior=asked_for)  # type: ignore[arg-type]


def test_without_the_package_the_cure_is_named(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "emcee", None)
    for call in (
        lambda: ro.diagnose("drop_test", folder, posterior=True),
        lambda: ro.calibrate("drop_test", folder, "vehicle.mass", posterior=True),
    ):
        with pytest.raises(
            ro.InputError, match=r"pip install 'rollover\[posterior\]' brings it, or leave posterior out"
        ):
            call()
    done = asked("drop_test", folder, "--posterior", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "pip install 'rollover[posterior]'" in done.output
    assert not (tmp_path / "out").exists()
