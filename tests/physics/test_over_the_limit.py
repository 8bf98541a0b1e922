"""Tip-overs on slopes about the static limit: below, at and above it each start goes over, none is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rollover import studies
from rollover.assessment.stability import stability_angles
from rollover.dynamics import simulate
from rollover.dynamics.placement import REST
from rollover.scenario import load
from rollover.studies.runner import Way, conduct
from rollover.studies.summary import answers

# deg, from where poses that follow from each other used to jump to where the vehicle stands no more
BANDS = [
    ("utility_tractor", 34.5),
    ("utility_tractor", 34.9),
    ("compact_tractor", 33.3),
    ("compact_tractor", 34.7),
    ("compact_tractor", 35.6),
    ("row_crop_tractor", 32.2),
    ("large_tractor", 31.6),
    ("vineyard_tractor", 25.3),
]
STUDY = """\
title: Who goes over from rest
scenario: {base: side_overturn_slope.yaml, simulation: {duration: 0.002}}
axes: [{kind: uniform, name: slope, paths: [ground.surface.angle_deg], low: 32.0, high: 37.0}]
plan: {kind: random, count: 120, seed: 4}
outputs: [{name: start/from_rest, limit: 0.5}]
"""


@pytest.mark.parametrize(("vehicle", "slope"), BANDS)
def test_just_below_the_limit_a_tip_over_goes_over(vehicle: str, slope: float) -> None:
    """It begins on two wheels, a degree beyond its balance, and rolls on rather than back."""
    changes = {"vehicle": f"vehicles/{vehicle}.yaml", "ground.surface.angle_deg": slope, "simulation.duration": 1.0}
    run = simulate.run(load("side_overturn_slope").replaced(changes))
    assert run.status == "done"
    assert run.sentence == ""
    roll = np.degrees(-run.recording["chassis/roll"])
    assert roll[0] > slope + 10.0  # past the end of the front axle's swing
    assert roll[-1] > roll[0] + 0.5
    assert np.all(np.diff(roll) > -1e-3)


def test_starts_from_rest_are_the_slopes_above_the_limit(tmp_path: Path) -> None:
    """Uniform from 32 to 37 deg: P = (37 - limit)/5, the limit by the relaxation of `rollover stability`."""
    path = tmp_path / "limit.yaml"
    path.write_text(STUDY)
    study = studies.load(path)
    found = answers(study, conduct(study, tmp_path / "out", Way(workers=0)))
    assert found["cases"] == {"all": 120, "done": 120, "failed": 0}
    limit = math.degrees(stability_angles(study.scenario, np.array([0.5 * math.pi]))[0].balance)
    exceedance = found["outputs"][0]["exceedance"]
    assert exceedance["low"] < (37.0 - limit) / 5.0 < exceedance["high"]
    assert exceedance["high"] - exceedance["low"] < 0.19  # 2 * 1.96 sqrt(0.4 * 0.6/120) = 0.175
    assert found["from_rest"] == exceedance["hits"]
    assert found["outputs"][0]["quantiles"] == []  # of what is 0 or 1 there are none


def test_above_the_limit_the_run_says_that_it_began_from_rest() -> None:
    run = simulate.run(
        load("side_overturn_slope").replaced({"ground.surface.angle_deg": 36.0, "simulation.duration": 0.01})
    )
    assert run.sentence == REST
