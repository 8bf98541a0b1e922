"""Simulations are remembered as far as there is room, and an answer is the same where there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rollover.diagnosis import diagnose
from rollover.diagnosis.fit import cache, residual_block
from rollover.diagnosis.fit.cache import Memory
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.prepared import prepared, weighted_datasets
from rollover.diagnosis.selection.candidates import candidates_of
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


def test_a_linearised_place_is_not_worked_out_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same block of a place that is asked for again; another one where step, clock or noise are others."""
    dataset = weighted_datasets(scenario(), prepared(scenario(), recorded({}, 2), Executor())[0])
    problem, layer = Problem(dataset), next(c for c in candidates_of(dataset, (), "drop") if c.id == "soil-layer")
    made: list[float] = []
    whole = problem._block
    monkeypatch.setattr(problem, "_block", lambda *given: made.append(given[3]) or whole(*given))

    def block(fd_step: float = 1e-3, shift: float = 0.0) -> ResidualBlock:
        found = problem.block(0, (layer,), (0.4, 0.5), shift, fd_step)
        assert found is not None
        return found

    first = block()
    assert block() is first
    assert len(made) == 1
    assert len({id(b) for b in (first, block(5e-3), block(shift=1e-6))}) == 3
    with problem.held(fixed_shifts=True):
        assert block() is not first
    assert block() is first
    assert len(made) == 4
    signals = [tuple(replace(s, sigma=2.0 * s.sigma) for s in e.signals) for e in dataset]
    problem.with_noise_model([replace(e, signals=louder) for e, louder in zip(dataset, signals, strict=True)])
    assert block().squares < first.squares
    monkeypatch.setattr(residual_block, "KEPT", 1)
    before, _ = block(), block(5e-3)
    again = block()
    assert again is not before
    assert np.array_equal(again.J, before.J)
    assert np.array_equal(again.slope, before.slope)
