"""Fits that are followed where slopes mislead: behind a cliff, and beside a kink."""

from __future__ import annotations

import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.refine import combed
from rollover.simulate import run
from rollover.synthesis import synthetic
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded
from tests.diagnosis.test_fits import candidate, judge_of
from tests.physics.scenes import shipped

CHANNELS = (FORCE, DEPTH, ACCELERATION)


def test_a_damping_behind_a_cliff_is_found() -> None:
    """A hopping striker: what its body does after each landing hangs on the one before."""
    true = {"stiffness": 1.888e6, "damping": 1372.0}
    hidden = {f"effects.structural-compliance.{name}": value for name, value in true.items()}
    speeds = (1.13, 2.4, 2.8, 1.98, 1.6, 3.1)
    judge = judge_of(recorded(hidden, 1, speeds=speeds, channels=CHANNELS, rate=1500.0, noise=0.005))
    c = candidate(judge, "structural-compliance")
    count = sum(e.count for e in judge.evidence)
    led_astray = judge.fit((c,), (0.5625, 0.2), shifts=[0.0] * len(speeds))
    assert led_astray is not None
    assert led_astray.left > 4.0 * count
    found = combed(judge, led_astray)
    assert found.left < 1.2 * count
    assert c.values(found.x)["stiffness"] == pytest.approx(true["stiffness"], rel=0.02)
    assert c.values(found.x)["damping"] == pytest.approx(true["damping"], rel=0.1)


def test_a_pair_that_leaves_nothing_is_named_by_both() -> None:
    """A crust and a guide that rubs, recorded from full runs: these meet the crust's end a step late."""
    hidden = {"effects.soil-crust.thickness": 0.03, "effects.guide-friction.force": 40.0}
    made = []
    for seed, speed in enumerate((1.2, 1.5, 2.0, 2.5, 3.0, 3.4), start=1):
        conditions = {"initiation.speed": speed}
        full = run(shipped("drop_test").replaced({**conditions, **hidden})).recording
        made.append((f"v{speed}", synthetic(full, channels=CHANNELS, rate=1000.0, seed=seed, conditions=conditions)))
    found = diagnose(shipped("drop_test"), made)
    assert {e.id for e in found.effects} == {"soil-crust", "guide-friction"}
    assert not found.remaining_significant
    by = {e.id: e.parameters for e in found.effects}
    assert by["soil-crust"]["thickness"].value == pytest.approx(0.03, rel=0.01)
    assert by["guide-friction"]["force"].value == pytest.approx(40.0, rel=0.05)
    assert found.after["held_out"].nrmse == pytest.approx(1.0, abs=0.03)
