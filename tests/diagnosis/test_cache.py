"""Simulations are remembered as far as there is room, and an answer is the same where there is none."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.fit import cache
from rollover.diagnosis.fit.cache import Memory
from tests.diagnosis.drops import recorded, scenario


def test_the_older_half_is_let_go_of() -> None:
    held = Memory(most=10 * 8)
    for k in range(10):
        held[k] = np.full(1, float(k))
    held["failed"] = None
    assert all(k in held for k in range(10))
    held["new"] = np.zeros(1)
    assert len(held) == 6
    assert [k for k in range(10) if k in held] == [6, 7, 8, 9]
    assert held["failed"] is None
    assert held[7] is not None
    for k in range(10, 16):
        held[k] = np.zeros(1)
    assert 7 not in held
    held["large"] = np.zeros(1000)
    assert "large" in held


def test_an_answer_is_the_same_with_little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    layer = {"effects.soil-layer.depth": 0.1, "effects.soil-layer.stiffness_ratio": 1.5}
    whole = diagnose(scenario(), recorded(layer, 4))
    monkeypatch.setattr(cache, "Memory", partial(Memory, most=40_000))
    short = diagnose(scenario(), recorded(layer, 4))
    (one,), (other,) = whole.effects, short.effects
    assert (one.id, short.sentence) == (other.id, whole.sentence)
    for name, told in one.parameters.items():  # what is asked for at 1e-12 beside it is answered for both while held
        again = other.parameters[name]
        assert (again.value, again.low, again.high) == pytest.approx((told.value, told.low, told.high), rel=1e-9)
    assert short.remaining_p_value == pytest.approx(whole.remaining_p_value, rel=1e-6)
    assert short.simulations > whole.simulations
