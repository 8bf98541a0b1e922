"""What a run says about itself: a frame that fails, ground that nobody measured, ground that is not hard any more."""

from __future__ import annotations

import functools
from dataclasses import replace

import pytest

from ground.hard import NO_LONGER_HARD, Hard
from ground.law import Calibration, Domain, laws
from ground.ye import Ye2006
from rollover.assessment.criteria import criteria, in_words
from rollover.assessment.loads import peak_loads
from rollover.dynamics.result import Run
from rollover.dynamics.simulate import run
from rollover.spec.stand import StaticTest
from tests.physics.scenes import shipped
from viz.content.verdict import verdict
from viz.pages.report import headline, page


@functools.cache
def dropped(stiffness: float) -> Run:
    law = {"kind": "hard", "stiffness": stiffness}
    return run(shipped("drop_test").replaced({"ground.law": law, "simulation.duration": 0.05}))


def test_hard_ground_is_uncalibrated_and_says_so_everywhere() -> None:
    """132 kg at 3 m/s on 1 GN/m give way by v sqrt(m/k) = 1.1 mm: hard, but no measurement stands behind it."""
    result = dropped(1e9)
    assert 0.5e-3 < result.recording["ground/sinkage"].max() < 1.1e-3
    assert result.domain_flags == ("uncalibrated",)
    peaks = peak_loads(result, None)
    assert {p.domain_flags for p in peaks if p.raw} == {("uncalibrated",)}
    head = headline(result, peaks)
    assert (head.state, "not calibrated" in head.detail) == ("warn", True)
    html = page(result, peaks, {"scenario_hash": "", "versions": {}, "files": []})
    assert "inside the calibrated domain" not in html
    assert "no measurement stands behind" in html
    assert "**The ground law is not calibrated:**" in verdict(result, peaks)


def test_ground_that_gives_way_is_not_hard() -> None:
    """50 kN/m: v sqrt(m/k) is 154 mm without damping, against 0.1 x 45 mm."""
    result = dropped(5e4)
    assert result.recording["ground/sinkage"].max() > 0.05
    assert result.domain_flags == ("uncalibrated", "deep-sinkage")
    text = verdict(result, peak_loads(result, None))
    assert "sinkage beyond the range of the ground law, 4.5 mm" in text
    first = result.flags[result.recording["ground/sinkage"] <= NO_LONGER_HARD]
    assert not (first & (1 << 17)).any(), "only where it is deep"


def test_a_measured_law_is_inside_and_a_tested_depth_ends() -> None:
    clay = shipped("drop_test")
    result = run(clay.replaced({"simulation.duration": 0.2}))
    assert result.domain_flags == ()
    deepest = float(result.recording["ground/sinkage"].max())
    law = replace(clay.ground.law, calibration=Calibration(source="a test", sinkage_most=0.5 * deepest))
    again = run(replace(clay, ground=replace(clay.ground, law=law), simulation=result.scenario.simulation))
    assert again.domain_flags == ("deep-sinkage",)


def test_which_laws_know_where_they_were_measured() -> None:
    """Only the regression of its paper brings a domain of its own; any law has that of its calibration."""
    assert Ye2006().domain.calibrated
    assert not Hard().domain.calibrated
    assert Hard(calibration=Calibration(source="a test")).domain.calibrated
    assert Hard(calibration=Calibration(source="a test", sinkage_most=1.0)).domain.sinkage_most == NO_LONGER_HARD
    assert pytest.approx(4.5e-3) == NO_LONGER_HARD
    assert Domain().calibrated
    assert "hard" in laws()


@functools.cache
def side_load(factor: float, push_on: str | None) -> Run:
    """The shipped static test's side load on a frame whose mounts have `factor` of their strength and stiffness."""
    scenario = shipped("static_rops_test")
    begin, vehicle = scenario.initiation, scenario.vehicle
    assert isinstance(begin, StaticTest)
    changes = {}
    for mount in vehicle.rops.mounts:
        for name in ("yield_force", "yield_moment"):
            if getattr(mount, name) is not None:
                changes[f"vehicle.rops.mounts.{mount.name}.{name}"] = [
                    None if v is None else factor * v for v in getattr(mount, name)
                ]
    scenario = scenario.replaced(changes)
    loads = tuple(load for load in begin.loads or () if load.name in ("side", "crush-front"))
    return run(replace(scenario, initiation=replace(begin, loads=loads, push_on=push_on, rate=0.2)))


def test_a_weak_frame_fails_at_the_load_where_it_fails() -> None:
    """A fifth of 34 kN, and 64 N of the dashpots: E = F (x - F/(2 k)) = 4.04 kJ over 0.6 m, less than 5.25 kJ."""
    rows = {row.requirement.name: row for row in criteria(side_load(0.2, None))}
    side = rows["side load"]
    assert side.verdict == "not met"
    assert side.simulated == pytest.approx(6864.0 * (0.6 - 6864.0 / (2 * 0.32e6)), rel=0.02)
    assert side.margin == pytest.approx(side.simulated / 5250.0 - 1.0)
    assert "given up: deflected by more than 600 mm" in side.note


def test_the_margin_is_what_the_frame_took_until_it_failed() -> None:
    """34 kN up to 0.6 m, less the elastic triangle: E = F (x - F/(2 k)) = 34 (0.6 - 0.053) kJ = 18.6 kJ of 5.25 kJ."""
    rows = {row.requirement.name: row for row in criteria(side_load(1.0, "side"))}
    side = rows["side load"]
    assert side.verdict == "met"
    assert side.simulated == pytest.approx(34e3 * (0.6 - 34e3 / (2 * 0.32e6)), rel=0.02)
    assert side.margin == pytest.approx(side.simulated / 5250.0 - 1.0)
    assert "crush, rear" not in rows, "the frame is done with"
    as_told = {row.requirement.name: row for row in criteria(side_load(1.0, None))}
    assert as_told["side load"].margin is None
    assert any("pushed until it fails" in sentence for sentence in in_words(list(as_told.values())))
