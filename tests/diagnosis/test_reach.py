"""Whether any combination of effects could come down to noise: told by all their directions beside the best one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.selection import decision
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.score_test import ScoreTest, score_test
from rollover.diagnosis.selection.stepwise import is_out_of_reach
from rollover.diagnosis.selection.truncated_start import loading_first
from rollover.recording import Recording
from tests.diagnosis.drops import recorded
from tests.diagnosis.test_discrepancy import judged

SPEEDS = (1.5, 2.2, 3.0)


def looked_at(recordings: list[tuple[str, Recording]]) -> tuple[Fitted, ScoreTest]:
    """The scenario as it is, and all effects looked at beside it."""
    problem: Problem = judged(recordings)
    base = problem.fit((), ())
    assert base is not None
    return base, score_test(problem, base, candidates_of(problem.dataset, (), "drop"))


@pytest.mark.parametrize(
    "missing",
    [
        {
            "effects.soil-layer.depth": 0.1,
            "effects.soil-layer.stiffness_ratio": 1.4,
            "effects.guide-friction.force": 60.0,
        },
        {"effects.soil-viscous-damping.damping": 150.0, "effects.soil-stiffness.scale": 1.06},
    ],
)
def test_two_effects_at_once_are_within_reach(missing: dict[str, float]) -> None:
    base, looked = looked_at(recorded(missing, 3, speeds=SPEEDS, noise=0.002))
    count = sum(b.residual.size for b in base.blocks)
    assert base.left > 9.0 * count
    assert looked.outside < 0.2 * base.left
    assert not is_out_of_reach(base, looked)


@pytest.mark.parametrize(
    ("left", "outside", "is_out"),
    [
        (30.0, 20.0, True),  # of what is beyond the noise two thirds are in no direction
        (30.0, 12.0, False),  # a third: two effects may take the rest, and more where slopes do not hold
        (2.0, 1.6, False),  # noise that quiet stretches tell too little of
        (2.5, 1.8, True),
    ],
)
def test_what_is_mostly_in_no_direction_is_out_of_reach(left: float, outside: float, is_out: bool) -> None:
    base, _ = looked_at(recorded({}, 3, speeds=SPEEDS[:1], noise=0.01))
    blocks = tuple(replace(b, residual=b.residual * np.sqrt(left * b.residual.size / b.total)) for b in base.blocks)
    fitted = replace(base, blocks=blocks)
    count = sum(b.residual.size for b in blocks)
    nothing = ScoreTest(score=0.0, scores={}, null=np.zeros(10), detectable={})
    assert fitted.left == pytest.approx(left * count, rel=0.05)
    assert is_out_of_reach(fitted, replace(nothing, outside=outside * count)) is is_out


@pytest.mark.parametrize("out_of_reach", [True, False])
def test_no_pairs_are_tried_of_what_is_out_of_reach(monkeypatch: pytest.MonkeyPatch, out_of_reach: bool) -> None:
    fit: Any = SimpleNamespace(left=900.0, effects=("a",), blocks=())
    step: Any = SimpleNamespace(fitted=fit, again=lambda _: step, cross_validated=lambda *_: step)
    look: Any = SimpleNamespace(detectable={})
    taken: Any = SimpleNamespace(
        base=fit, fitted=fit, steps=(step,), first=step, before=None, left=None, at_first=look, looked=look, count=9,
        refuted=False, paired=False, out_of_reach=out_of_reach,
    )  # fmt: skip
    inquiry: Any = SimpleNamespace(
        problem=SimpleNamespace(effort=SimpleNamespace(is_ensemble=False), again=lambda f: f, dataset=[]),
        groups=(), phases=(), executor=SimpleNamespace(parallel_map=None),
    )  # fmt: skip
    tried: list[Any] = []
    monkeypatch.setattr(decision, "forward_selection", lambda *_: taken)
    monkeypatch.setattr(decision, "loading_first", lambda _, found: found)
    monkeypatch.setattr(decision, "is_enough", lambda *_: False)
    monkeypatch.setattr(decision, "mismatch_of", lambda *_: None)
    monkeypatch.setattr(decision, "_one_each", lambda _, steps: list(steps))
    monkeypatch.setattr(decision, "best_subsets", lambda *found, **_: tried.append(found))
    assert decision.explained(inquiry, fit).parts == (step,)
    assert bool(tried) is not out_of_reach
    if out_of_reach:
        assert loading_first(inquiry, taken) is taken  # nor is the way down explained first
