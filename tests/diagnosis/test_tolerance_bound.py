"""A stated tolerance is the most that a scenario may miss by: it does not hide an effect that predicts other drops."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import diagnose, pipeline
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.inference.discrepancy import Discrepancy
from rollover.diagnosis.result import Diagnosis, Score, Verdict
from rollover.diagnosis.statements import is_hardly_tolerated
from rollover.dynamics.drop_test import DropModel
from rollover.recording import Clock, Recording
from rollover.scenario import Scenario
from tests.diagnosis.drops import ACCELERATION, FORCE
from tests.physics.scenes import shipped
from tests.rollover.diagnosed import nothing_found

MASS, NOSE_SHARE, STIFFNESS, NOISE, RATE = 0.58858, 0.11176, 1700.0, 0.05, 1500.0
WATER = {
    "ground.law.drag_coefficient": 0.652887,
    "effects.soil-added-mass-growth.rate": 9.28404,
    "effects.soil-added-mass-growth.fade": 0.00475771,
}
UNCERTAIN = dict(zip(WATER, (0.3, 4.64, 0.0075), strict=True))


def rigid() -> Scenario:
    return shipped("cone_drop").replaced({"initiation.lead_time": 0.015, "vehicle.mass": MASS, **WATER})


def sprung_drops() -> list[tuple[str, Recording]]:
    """Cones on a spring of 1,700 N/m, from 0.25 to 1.5 m into water that is known to a half."""
    rng = np.random.default_rng(7)
    spring = {"nose_share": NOSE_SHARE, "stiffness": STIFFNESS, "damping": 10.0}
    spring = {f"effects.structural-compliance.{k}": v for k, v in spring.items()}
    known = {"effects.structural-compliance.stiffness": None, "effects.structural-compliance.nose_share": NOSE_SHARE}
    found = []
    for height in (0.25, 0.75, 1.5):
        speed = float(np.sqrt(2.0 * 9.81 * height))
        t = np.arange(-0.014, 0.049, 1.0 / RATE)
        run = DropModel(scenario=rigid(), step=1e-4).with_({"initiation.speed": speed, **spring}).run(t - 0.001)
        r = Recording(
            title=f"{height} m",
            time=t,
            channels={ACCELERATION: run[ACCELERATION] + rng.normal(0.0, NOISE, t.size)},
            conditions={"initiation.speed": speed, **WATER, **known},
            clock=Clock(zero="known", within=0.002),
            uncertainty=UNCERTAIN,
        )
        found.append((f"{height} m", r))
    return found


def test_a_tolerance_does_not_hide_a_spring() -> None:
    # uncertain water leaves 0.8 of what is tolerated, while peaks are off by their double
    with Executor(1) as executor:
        found = diagnose(rigid(), sprung_drops(), tolerance=0.05, executor=executor)
    (effect,) = found.effects
    assert (found.verdict, effect.id, found.broken) == ("missing-physics", "structural-compliance", ())
    stiffness = effect.parameters["stiffness"]
    assert stiffness.low is not None
    assert stiffness.high is not None
    assert stiffness.low < STIFFNESS < stiffness.high
    assert any("the tolerance is the most" in note for note in found.notes)


def test_a_bound_holds_each_scale_that_it_is_stated_for() -> None:
    held = Discrepancy(scales={FORCE: 0.08, ACCELERATION: 0.02}).at_most({FORCE: 0.05})
    assert dict(held.scales) == {FORCE: 0.05, ACCELERATION: 0.02}


@pytest.mark.parametrize(
    ("share", "answer", "named"),
    [
        ((0.9, 0.6), "likeness", True),
        ((0.6, 0.4), "likeness", False),  # as of what a background resembles
        ((0.6, 0.4), "whole", True),  # no more than noise is left
        (None, "nothing", False),
    ],
)
def test_within_a_tolerance_what_is_sure_is_named(
    monkeypatch: pytest.MonkeyPatch, share: tuple[float, float] | None, answer: Any, named: bool
) -> None:
    effects: Any = (SimpleNamespace(explains=SimpleNamespace(share=share[0], low=share[1])),) if share else ()
    beside = replace(nothing_found(), effects=effects, answer=answer)
    monkeypatch.setattr(pipeline, "concluded", lambda *_: hardly(1.2, 0.9))
    monkeypatch.setattr(pipeline, "_diagnosed", lambda *_: beside)
    monkeypatch.setattr(pipeline, "checked", lambda found: found)
    made = sprung_drops()[:1]
    assert bool(diagnose(rigid(), made, tolerance=0.05).effects) == named
    assert not diagnose(rigid(), made, tolerance=0.05, estimate=False).effects
    assert not diagnose(rigid(), made).effects


def hardly(misfit: float, iso: float | None, verdict: Verdict = "no-mismatch") -> Diagnosis:
    score = Score(nrmse=misfit, iso18571=iso, peak_force_error=None)
    return replace(nothing_found(), verdict=verdict, before={"held_out": score})


def test_what_passes_by_chance_or_is_poor_is_hardly_tolerated() -> None:
    assert is_hardly_tolerated(hardly(1.2, 0.9))
    assert is_hardly_tolerated(hardly(0.8, 0.52))
    assert not is_hardly_tolerated(hardly(0.8, 0.9))
    assert not is_hardly_tolerated(hardly(0.8, None))
    assert not is_hardly_tolerated(hardly(1.2, 0.52, "unexplained"))
