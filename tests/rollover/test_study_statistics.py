"""Sensitivity and reliability against closed forms."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr
from typer.testing import CliRunner

from rollover.cli.main import app
from rollover.studies import sensitivity
from rollover.studies.study import Reliability
from rollover.system.errors import InputError
from tests.rollover.studies import drops


def test_sobol_indices_of_a_product() -> None:
    # y = a(1 + 3 x1')(1 + x2') with x' uniform on -1 to 1: V1 = 9/3, V2 = 1/3, V12 = V1 V2 = 1, V = 13/3
    u = sensitivity.sobol_sample(2, 1024, 3)
    x = 2.0 * u - 1.0
    y = (1.0 + 3.0 * x[:, 0]) * (1.0 + x[:, 1])
    y[5] = np.nan  # one case failed: its base point goes, the others stay
    found = sensitivity.sobol_indices(y, 2, 0.95, 0)
    truth = ((9.0 / 13.0, 12.0 / 13.0), (1.0 / 13.0, 4.0 / 13.0))
    for row, (first, total) in zip(found, truth, strict=True):
        assert abs(row["first"] - first) < row["first_half_width"] < 0.15
        assert abs(row["total"] - total) < row["total_half_width"] < 0.15
        assert row["base"] == 1023


def test_morris_effects_of_a_plane() -> None:
    u = sensitivity.morris_sample(2, 6, 4, 0)
    x = (u - sensitivity.TAIL) / (1.0 - 2.0 * sensitivity.TAIL)
    found = sensitivity.morris_effects(u, 2.0 * x[:, 0] - 5.0 * x[:, 1], 4, 0.95, 0)
    assert [row["mean"] for row in found] == pytest.approx([2.0, -5.0], rel=1e-9)
    assert [row["magnitude"] for row in found] == pytest.approx([2.0, 5.0], rel=1e-9)
    assert [row["spread"] for row in found] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_reliability_of_a_plane_in_spite_of_noise() -> None:
    pytest.importorskip("openturns", reason="the extra reliability is not installed")
    from rollover.studies.reliability import form_and_importance_sampling

    def g(u: np.ndarray) -> np.ndarray:
        return np.asarray(0.8 * u[:, 0] + 0.6 * u[:, 1] - 2.9 + 0.01 * np.sin(40.0 * u[:, 0]))

    found = form_and_importance_sampling(g, ["a", "b"], Reliability(count=1000), 0.95)
    truth = float(ndtr(-2.9))
    assert found["low"] < truth < found["high"]
    assert found["high"] - found["low"] < 0.5 * truth
    assert found["beta"] == pytest.approx(2.9, abs=0.1)
    assert found["importance_factors"]["a"] == pytest.approx(0.64, abs=0.08)


def test_reliability_of_a_study(tmp_path: Path) -> None:
    pytest.importorskip("openturns", reason="the extra reliability is not installed")
    # the sinkage of a drop at 3 m/s falls with the soil's stiffness alone: a limit in x is a limit of the sinkage
    speed = ("{kind: uniform, name: speed, paths: [initiation.speed], low: 1.0, high: 3.5}",
             "{kind: normal, name: gravity, paths: [gravity], mean: 9.81, deviation: 1.0e-4}")  # fmt: skip
    first = ("ground/force_normal, limit: 3500.0", "ground/sinkage, limit: 0.6")
    path = drops(tmp_path, speed, first, ("  - {name: ground/sinkage}\n", ""))
    path.write_text(path.read_text() + "reliability: {count: 100}\n")
    out = tmp_path / "out"
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(out), "--workers", "0", "--json"])
    assert answer.exit_code == 0, answer.stderr
    found = json.loads(answer.stdout)["reliability"]
    assert found["importance_factors"]["soil"] > 0.999
    assert found["low"] < found["probability"] < found["high"]
    # one variable that counts: FORM is exact but for where its search stops
    assert found["form_probability"] == pytest.approx(found["probability"], rel=0.35)
    assert "importance sampling" in (out / "report.html").read_text()


def test_without_the_extra_there_is_a_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rollover.studies.reliability import installed

    monkeypatch.setitem(sys.modules, "openturns", None)
    with pytest.raises(InputError, match=r"pip install 'rollover\[reliability\]'"):
        installed()
