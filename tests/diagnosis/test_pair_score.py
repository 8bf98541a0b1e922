"""What two effects gain together, against least squares of two columns."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.selection import pairs
from rollover.diagnosis.selection.score_test import ScoreTest, best_direction_pairs, score_test
from rollover.diagnosis.settings import SETTINGS
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded
from tests.diagnosis.test_fits import candidate, problem_of
from tests.diagnosis.test_pairs import DAMPING, GRADUAL, MASS, NOSE, fitted, inquiry, screened


def unit(D: np.ndarray) -> np.ndarray:
    return np.asarray(D / np.sqrt(np.sum(D**2, axis=0)))


def test_pair_gain_and_step_are_those_of_least_squares() -> None:
    rng = np.random.default_rng(1)
    D = unit(rng.standard_normal((60, 6)))
    misfit = 3.0 * rng.standard_normal(60)
    found = best_direction_pairs(D.T @ misfit, D.T @ D, list("abcdef"))
    assert len(found) == 15
    told = {}
    for i, j in itertools.combinations(range(6), 2):
        way, left, _, _ = np.linalg.lstsq(D[:, [i, j]], misfit, rcond=None)
        told[i, j] = misfit @ misfit - left[0], way
    assert [b.gain for b in found] == sorted((b.gain for b in found), reverse=True)
    for both in found:
        gain, way = told[both.columns]
        assert both.gain == pytest.approx(gain, rel=1e-9)
        assert both.along == pytest.approx(tuple(way), rel=1e-9)


def test_two_that_gain_nothing_alone_may_gain_all_together() -> None:
    """The misfit lies along the difference of two that are nearly alike: each alone sees 1 % of it."""
    rng = np.random.default_rng(2)
    first, across, other = np.linalg.qr(rng.standard_normal((40, 3)))[0].T
    second = np.cos(0.2) * first + np.sin(0.2) * across
    misfit = 30.0 * (np.cos(0.1) * across - np.sin(0.1) * first)  # at right angles to their mean
    D = np.stack([first, second, other], axis=1)
    best, *_ = best_direction_pairs(D.T @ misfit, D.T @ D, ["layer", "crust", "mass"])
    assert best.columns == (0, 1)
    assert best.gain == pytest.approx(900.0, rel=1e-9)
    assert np.max((D.T @ misfit) ** 2) < 0.011 * 900.0


def test_collinear_directions_gain_nothing_together() -> None:
    first, across = np.eye(40)[:2]
    D = np.stack([first, np.cos(0.01) * first + np.sin(0.01) * across], axis=1)
    misfit = 5.0 * across
    found = best_direction_pairs(D.T @ misfit, D.T @ D, ["one", "other"])
    assert all(b.gain == 0.0 for b in found)


def test_pairs_take_the_best_directions_of_two_effects() -> None:
    rng = np.random.default_rng(3)
    D = unit(rng.standard_normal((200, 40)))
    owners = [f"{k // 2}" for k in range(40)]  # two directions each: 190 pairs of owners
    found = best_direction_pairs(D.T @ rng.standard_normal(200), D.T @ D, owners)
    assert len(found) == SETTINGS.selection.pair_score.most_pairs
    told = [frozenset(owners[k] for k in b.columns) for b in found]
    assert len(set(told)) == SETTINGS.selection.pair_score.most_pairs
    assert all(len(p) == 2 for p in told)


def test_the_pair_score_leads_to_two_that_hide_each_other() -> None:
    """Friction and a co-moving mass that grows push against each other: alone the second gains hardly anything."""
    hidden = {"effects.guide-friction.force": 60.0, "effects.soil-added-mass-growth.rate": 20.0}
    problem = problem_of(
        recorded(hidden, 5, speeds=(1.5, 2.0, 2.5, 3.0), channels=(FORCE, DEPTH, ACCELERATION), rate=600.0, noise=0.02)
    )
    kinds = [candidate(problem, key) for key in ("guide-friction", "soil-added-mass-growth", "mass", "soil-stiffness")]
    base = problem.fit((), ())
    assert base is not None
    scored = score_test(problem, base, kinds)
    assert scored.scores["soil-added-mass-growth"] < 0.5 * scored.score
    (one, x), (other, y) = scored.both[0]
    assert {one, other} == {"guide-friction", "soil-added-mass-growth"}
    begun = {one: x, other: y}
    for c in kinds[:2]:
        told = c.values(begun[c.key])
        true = hidden[f"effects.{c.key}.{next(iter(c.search))}"]
        assert told[next(iter(c.search))] == pytest.approx(true, rel=0.15)  # by slopes beside none: 11 % short


def test_near_noise_slopes_suggest_pairs_but_no_any_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far off what scored is tried two by two; near, those that led, and what gains most together."""
    asked: list[Any] = []
    leading = fitted((MASS,), 2.0)
    first = Step(
        base=fitted((), 4.0), fitted=leading, p_value=0.0,
        rivals=(leading, fitted(GRADUAL[:1], 3.0), fitted(GRADUAL[1:], 3.5)),
        screened=tuple(screened(c) for c in (DAMPING, NOSE)),
    )  # fmt: skip
    both = ((("soil-viscous-damping", (0.7,)), ("mass", (0.2,))),)
    scored = ScoreTest(
        score=9.0, scores={"mass": 9.0, "soil-viscous-damping": 1.0}, null=np.zeros(9), detectable={}, both=both
    )
    asking = inquiry(asked)
    object.__setattr__(asking, "say", lambda _: None)
    object.__setattr__(asking, "candidates", [MASS, DAMPING, NOSE])
    monkeypatch.setattr(pairs, "_with_thresholds_scanned", lambda *_: [])
    monkeypatch.setattr(pairs, "_explains_little", lambda *_: True)
    for far in (False, True):
        asked.clear()
        monkeypatch.setattr(pairs, "is_far", lambda *_, far=far: far)
        assert pairs.best_pair(asking, [first], scored) is None
        tried = [(tuple(c.id for c in task.candidates), task.start) for task in asked if task.rounds == 2]
        names = {frozenset(ids) for ids, _ in tried}
        assert frozenset(("soil-layer", "soil-crust")) not in names
        assert frozenset(("mass", "soil-layer")) in names
        assert (frozenset(("mass", "structural-compliance")) in names) == far
        assert ((("soil-viscous-damping", "mass"), (0.7, 0.2)) in tried) == (not far)
