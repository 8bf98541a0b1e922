"""What decides whether there is anything where runs depend on chance: recordings at odds, looks before the impact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.noise.ensemble import HeavyTail
from rollover.diagnosis.selection import screening
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.selection.score_test import ScoreTest, _best_amplitude, _birge_ratio, _visible, score_test
from rollover.diagnosis.selection.screening import _begun_at, promising
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.recording import Recording
from tests.diagnosis import test_fits
from tests.diagnosis.drops import FORCE, recorded
from tests.diagnosis.test_fits import candidate

CHANNEL = "chassis/acceleration_y"
N, IMPACT = 80, 0.16
TIME = 0.004 * np.arange(N)


class Wave:
    """y = x sin before the impact; after it whatever the course says, times x."""

    effort = SETTINGS.forward.runs

    def __init__(self, after: float) -> None:
        self.after, self.runs = after, 0

    def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
        self.runs += 1
        x = changes.get("effects.slope.angle", 0.0)
        return {CHANNEL: x * np.where(TIME < IMPACT, np.sin(30.0 * TIME), self.after * np.cos(90.0 * TIME))}


SLOPE = Candidate(id="slope", kind="parameter", family="x", search={"angle": Search(-100.0, 100.0)}, null=(0.5,))


def problem_of(
    after: tuple[float, ...], amplitudes: tuple[float, ...], *, first_impact: float = IMPACT
) -> tuple[Problem, Fitted]:
    """Recordings with so much of the wave before the impact, and noise; and the base."""
    rng = np.random.default_rng(5)
    dataset = []
    for r, (a, much) in enumerate(zip(after, amplitudes, strict=True)):
        simulator: Any = Wave(a)
        values = much * np.where(TIME < IMPACT, np.sin(30.0 * TIME), 0.0) + rng.standard_normal(N)
        signal = Signal(channel=CHANNEL, rows=np.arange(N), values=values, sigma=1.0, noise=1.0, ar=(), span=10.0)
        recording = Recording(title="r", time=TIME, channels={CHANNEL: values})
        dataset.append(
            Dataset(
                name=f"r{r}",
                recording=recording,
                simulator=simulator,
                signals=(signal,),
                shift_prior=1e-3,
                condition="",
                perturbed=(0.1 * rng.standard_normal(N),),
                first_impact=first_impact,
            )
        )
    problem = Problem(dataset)
    blocks = tuple(
        ResidualBlock(residual=w, J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1e-3)
        for w in problem.measured
    )
    return problem, Fitted(candidates=(), x=(), blocks=blocks)


def test_agreeing_recordings_count_in_full_a_lone_one_hardly() -> None:
    rng = np.random.default_rng(0)
    d = rng.standard_normal((4, 50))
    D = (d / np.sqrt(np.sum(d * d))).reshape(-1, 1)
    agree = 30.0 * D[:, 0]
    alone = np.where(np.arange(200) < 50, 30.0 * D[:, 0], 0.0)
    assert _birge_ratio(agree, D, [50] * 4)[0] == 1.0
    a = np.array([30.0, 0.0, 0.0, 0.0])
    weight = np.sum(D.reshape(4, 50) ** 2, axis=1)
    wanted = np.sum(weight * (a - np.sum(weight * a)) ** 2) / 3.0
    assert _birge_ratio(alone, D, [50] * 4)[0] == pytest.approx(wanted, rel=1e-9)
    assert wanted > 10.0


def test_an_effect_of_all_beats_one_of_a_divergent_recording() -> None:
    problem, base = problem_of((0.0,) * 4, (2.0,) * 4)
    everywhere = score_test(problem, base, [SLOPE])
    problem, base = problem_of((0.0,) * 4, (4.0, 0.0, 0.0, 0.0))  # as much in all
    alone = score_test(problem, base, [SLOPE])
    assert everywhere.score > 100.0
    assert alone.score < 0.1 * everywhere.score


def test_an_effect_before_the_impact_is_screened_by_itself() -> None:
    """After the impact the run with the effect goes ten times as far the wrong way."""
    problem, base = problem_of((10.0,) * 4, (2.0,) * 4)
    with_ = score_test(problem, base, [SLOPE])
    blind, base = problem_of((10.0,) * 4, (2.0,) * 4, first_impact=np.inf)
    assert with_.score > 10.0 * score_test(blind, base, [SLOPE]).score
    assert with_.score > 100.0
    problem, base = problem_of((10.0,) * 4, (2.0,) * 4)
    faint = replace(
        SLOPE,
        search={
            "angle": Search(-0.2 * SETTINGS.selection.score_test.visible, 0.2 * SETTINGS.selection.score_test.visible)
        },
    )  # its step shows nothing by itself
    assert score_test(problem, base, [faint]).score < 0.1 * with_.score


def test_few_recordings_choose_who_is_looked_at_on_more(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, list[str]]] = []
    at: dict[str, Any] = {}
    begun = {
        SETTINGS.forward.runs.few: {"c3": ((0.3,),)},
        SETTINGS.forward.runs.looked_at: {"c3": ((0.4,),), "c4": ((0.6,),)},
    }

    def scored(_: Problem, base: Fitted, candidates: Any, only: Any, beside: Any) -> ScoreTest:
        asked.append((len(only), [c.key for c in candidates]))
        at.update({c.key: c.points for c in candidates})
        scores = {c.key: 90.0 - int(c.key[1:]) for c in candidates}
        return ScoreTest(
            score=max(scores.values()), scores=scores, null=np.full(10, float(len(only))), detectable=scores,
            points={"c2": ((0.7,), (0.1,))}, starts=begun[len(only)],
        )  # fmt: skip

    monkeypatch.setattr(screening, "score_test", scored)
    problem, base = problem_of((0.0,) * 5, (0.0,) * 5)
    every = [replace(SLOPE, id=f"c{k}") for k in range(30)] + [replace(SLOPE, id="c77", kind="sensor")]
    found = screening.score_candidates(problem, base, every, [[r] for r in range(5)])
    assert [n for n, _ in asked] == [SETTINGS.forward.runs.few, SETTINGS.forward.runs.looked_at]
    assert len(asked[0][1]) == 31
    assert asked[1][1] == [f"c{k}" for k in range(SETTINGS.forward.runs.shortlist)] + ["c77"]
    assert found.scores["c29"] == 0.0  # passed over
    assert found.detectable["c29"] == 61.0
    assert found.null[0] == SETTINGS.forward.runs.looked_at
    assert at["c2"] == ((0.7,), (0.1,))  # where it told most, not wherever it could act
    assert at["c5"] == ()
    assert found.starts == {"c3": ((0.4,), (0.3,)), "c4": ((0.6,),)}  # of more recordings first


def test_a_scan_says_where_an_effect_scored_most() -> None:
    """d = sin(30 t + 6 x) of place x, measured sin(30 t + 6 x0): the gain falls with |x - x0|, up to a quarter turn."""

    class Turned(Wave):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            x = changes.get("effects.slope.angle")
            return {CHANNEL: np.zeros(N) if x is None else 9.0 * np.sin(30.0 * TIME + 6.0 * x)}

    every = tuple((round(0.02 * k, 2),) for k in range(12))
    problem, base = problem_of((0.0, 0.0), (0.0, 0.0), first_impact=np.inf)
    simulator: Any = Turned(0.0)
    problem = Problem([replace(e, simulator=simulator) for e in problem.dataset])
    block = replace(base.blocks[0], residual=50.0 * np.sin(30.0 * TIME + 6.0 * 0.145))
    turned = replace(SLOPE, search={"angle": Search(0.0, 1.0)}, points=every)
    found = score_test(problem, replace(base, blocks=(block, block)), [turned])
    nearest = sorted(every, key=lambda x: abs(x[0] - 0.145))
    assert found.points[turned.key] == tuple(nearest[: SETTINGS.selection.score_test.close_points])


def test_the_best_two_scan_points_of_an_effect_start_fits() -> None:
    placed = replace(SLOPE, null=(None,))
    met = [(3.0, (0.1,)), (4.0, (0.9,)), (5.0, (0.5,)), (6.0, (0.3,))]
    assert _begun_at(placed, met) == ((0.1,), (0.9,))


@pytest.mark.parametrize(("heavy_tailed", "kept"), [(True, 5.0), (False, 40.0)])
def test_a_leader_on_few_recordings_is_tried_on_all(
    heavy_tailed: bool, kept: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """40 by two recordings, 5 by four: where each may take another course four tell more than two, else the better."""

    def scored(_: Problem, base: Fitted, candidates: Any, only: Any, beside: Any) -> ScoreTest:
        scores = {c.key: 40.0 if len(only) == SETTINGS.forward.runs.few else 5.0 for c in candidates}
        return ScoreTest(score=max(scores.values()), scores=scores, null=np.ones(10), detectable={})

    monkeypatch.setattr(screening, "score_test", scored)
    problem, base = problem_of((0.0,) * 4, (0.0,) * 4)
    problem.heavy_tailed = heavy_tailed
    found = screening.score_candidates(problem, base, [SLOPE], [[r] for r in range(4)])
    assert found.scores["slope"] == kept
    assert found.score == 5.0  # what is claimed is claimed by all


def test_the_leader_of_the_robust_screening_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """In full c0 to c9 score best in turn, forgiven c5 and then c7, and c8 by chance: these take turns."""
    asked: list[tuple[bool, set[str]]] = []

    def scored(problem: Problem, base: Fitted, candidates: Any, only: Any, beside: Any) -> ScoreTest:
        asked.append((problem.heavy_tailed, {c.key for c in candidates}))
        scores = {c.key: 90.0 - int(c.key[1:]) for c in candidates}
        if problem.heavy_tailed:
            scores = {c.key: {"c5": 70.0, "c7": 400.0, "c8": 0.1}.get(c.key, 0.0) for c in candidates}
        null = np.sort(np.random.default_rng(0).chisquare(1, 1000))
        return ScoreTest(score=max(scores.values()), scores=scores, null=null, detectable={})

    monkeypatch.setattr(screening, "score_test", scored)
    monkeypatch.setattr(screening, "strong_starts", lambda *_: {})
    problem, base = problem_of((0.0,) * 4, (0.0,) * 4)
    problem.heavy_tailed, problem.effort = False, replace(problem.effort, leaders=3)
    every = [replace(SLOPE, id=f"c{k}", kind="sensor" if k == 9 else "parameter") for k in range(10)]
    found = screening.score_candidates(problem, base, every, [[r] for r in range(4)])
    assert not problem.heavy_tailed
    assert found.leading == ("c7", "c5")
    assert [c.key for c in found.ranked(every)][:5] == ["c7", "c5", "c0", "c1", "c2"]  # c7 is first of both
    late = replace(found, scores={**found.scores, "c7": 1.0})
    assert [c.key for c in late.ranked(every)][:5] == ["c7", "c0", "c5", "c1", "c2"]
    assert (found.scores["c7"], found.scores["c0"]) == (400.0, 90.0)
    assert found.score == 90.0  # what is claimed is claimed in full
    assert all("c9" not in keys for heavy_tailed, keys in asked if heavy_tailed)
    problem.heavy_tailed = True
    asked.clear()
    assert screening.score_candidates(problem, base, every, [[r] for r in range(4)]).leading == ()
    assert len(asked) == 2


def test_some_that_move_the_vehicle_are_always_looked_at_closer() -> None:
    """Twenty sensors score more than what makes them all wrong at once."""
    every = [replace(SLOPE, id=f"c{k}", kind="sensor" if k < 20 else "parameter", channel=None) for k in range(30)]
    scores = {c.key: 90.0 - int(c.key[1:]) for c in every}
    found = promising(
        every, ScoreTest(score=90.0, scores=scores, null=np.zeros(10), detectable={}), SETTINGS.forward.runs
    )
    assert SETTINGS.forward.runs.scored is not None
    assert [c.key for c in found][: SETTINGS.forward.runs.scored] == [
        f"c{k}" for k in range(SETTINGS.forward.runs.scored)
    ]
    assert [c.key for c in found[SETTINGS.forward.runs.scored :]] == [
        f"c{k}" for k in range(20, 20 + SETTINGS.forward.runs.promising)
    ]


def test_directions_may_be_those_beside_another_fit() -> None:
    """The misfit of an explanation along what runs beside the base say, and no run is made but those that are known."""
    problem, base = problem_of((0.0,) * 4, (2.0,) * 4)
    wave = 2.0 * np.where(TIME < IMPACT, np.sin(30.0 * TIME), 0.0)
    left = tuple(replace(b, residual=b.residual - wave) for b in base.blocks)
    fitted = Fitted(candidates=(replace(SLOPE, id="other"),), x=(0.51,), blocks=left)
    known = score_test(problem, base, [SLOPE], (0, 1))
    made = sum(e.simulator.runs for e in problem.dataset if isinstance(e.simulator, Wave))
    found = score_test(problem, fitted, [SLOPE], known.only, base)
    assert known.only == (0, 1)
    assert sum(e.simulator.runs for e in problem.dataset if isinstance(e.simulator, Wave)) == made
    assert 0.0 < found.score < 0.1 * known.score  # most is explained


@pytest.mark.parametrize(("hint", "is_ensemble", "scores_made"), [(0.9, True, 1), (0.01, True, 2), (0.9, False, 1)])
def test_no_screening_beside_a_model_without_usable_runs(
    hint: float, is_ensemble: bool, scores_made: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Any, Any]] = []

    def scored(
        _: Problem,
        base: Fitted,
        candidates: Any,
        groups: Any,
        beside: Any = None,
        few: Any = (),
        parallel_map: Any = (),
    ) -> ScoreTest:
        asked.append((beside, few))
        null = np.sort(np.random.default_rng(0).chisquare(1, 1000))
        return ScoreTest(score=float(np.quantile(null, 1.0 - hint)), scores={}, null=null, detectable={})

    monkeypatch.setattr(screening, "score_candidates", scored)
    problem, base = problem_of((0.0,) * 4, (2.0,) * 4)
    problem.effort = replace(problem.effort, is_ensemble=is_ensemble)
    first = ScoreTest(score=0.0, scores={}, null=np.zeros(10), detectable={}, only=(0, 2))
    screening.rescored(problem, base, base, [SLOPE], [[r] for r in range(4)], first)
    assert len(asked) == scores_made
    assert asked[0] == ((base, (0, 2)) if is_ensemble else (None, ()))
    if scores_made == 2:
        assert asked[1] == (None, ())
    asked.clear()
    screening.rescored(problem, base, None, [SLOPE], [[r] for r in range(4)], first)  # where the rest is structured
    assert asked == [(None, ())]


def test_what_was_refuted_tells_nothing() -> None:
    problem, base = problem_of((0.0,) * 4, (2.0,) * 4)
    scored = score_test(problem, base, [SLOPE])
    before: Any = type("M", (), {"p_value": 0.3})()
    found = Explanation(base=base, fitted=base, parts=(), scored=scored, detectable={}, before=before, after=before)
    assert found.p_value < 1e-6
    assert replace(found, refuted=True).p_value == 0.3


@pytest.mark.parametrize("expected", [None, 1.0])
def test_the_smaller_of_two_split_p_values_is_uniform(
    expected: float | None,
) -> None:
    """Kolmogorov's statistic of 2000 draws of two uniform p-values, at most 1.63/sqrt(n) in 99 of 100 cases.

    Where runs scatter (an expected sum of squares is known) the look is nearly always 1, and then nothing is added.
    """
    rng, draws = np.random.default_rng(3), 2000
    base = problem_of((0.0,) * 4, (0.0,) * 4)[1]
    base = replace(base, blocks=tuple(replace(b, expected=expected) for b in base.blocks))

    def told(before: float, scan: float) -> float:
        one: Any = SimpleNamespace(p_value=before)
        other: Any = SimpleNamespace(p_value=lambda: scan)
        found = Explanation(base=base, fitted=base, parts=(), scored=other, detectable={}, before=one, after=one)
        return found.p_value

    p = np.sort([told(*pair) for pair in rng.random((draws, 2))])
    assert np.max(np.abs(p - (np.arange(draws) + 0.5) / draws)) < 1.63 / np.sqrt(draws)
    assert told(0.3, 1.0) == pytest.approx(0.51 if expected is None else 1.0 - 0.7 ** (1.0 / 0.95))
    assert told(1.0, 1e-9) < (2.1e-9 if expected is None else 2.1e-8)
    assert told(1.0, 1.0) == pytest.approx(1.0)
    assert told(0.0, 1.0) == 0.0


def test_a_limit_shows_up_to_the_largest_scan_point() -> None:
    """A force cell that ends at three quarters of its range shows, at more than the range it does not."""
    problem = test_fits.problem_of(recorded({}, noise=0.01, speeds=(1.5, 2.5)))
    base = problem.fit((), ())
    assert base is not None
    cell = candidate(problem, f"sensor-clipping:{FORCE}")
    strength = candidate(problem, "soil-viscous-damping")
    found = score_test(problem, base, [cell, strength]).detectable
    span = max(s.span for e in problem.dataset for s in e.signals if s.channel == FORCE)
    assert 0.4 * span < found[cell.key] < span
    assert 0.0 < found[strength.key] < 50.0
    assert _visible(cell, (0.5,), 0.9 * SETTINGS.selection.score_test.visible) is None
    assert _visible(cell, (0.5,), 1.1 * SETTINGS.selection.score_test.visible) == cell.values((0.5,))["limit"]
    no_jacobian = replace(candidate(problem, "co-moving-mass"), own={})
    assert "co-moving-mass" not in score_test(problem, base, [no_jacobian]).detectable
    known = score_test(problem, base, [replace(no_jacobian, own={"fraction": 0.1})]).detectable["co-moving-mass"]
    assert 0.0 < known < 0.1


def test_a_scan_goes_as_far_along_a_direction_as_gains_most() -> None:
    """One recording took another course, which a direction explains altogether; the other one has a little of it."""
    rng = np.random.default_rng(2)
    n, expected, beyond = 60, 30.0, 900.0
    slope = SETTINGS.noise.ensemble.state_size / (SETTINGS.noise.ensemble.state_size + beyond)
    late = np.arange(n) >= 30
    wave = np.where(late, np.sin(0.7 * np.arange(n)), 0.0)
    wave /= np.sqrt(wave @ wave)
    other = HeavyTail(samples=np.where(late, np.sqrt(slope), 1.0), share=0.1, more=0.0)
    left = np.where(late, np.sqrt(slope) * np.sqrt(expected + beyond) * wave, rng.standard_normal(n))
    as_seen = np.where(late, np.sqrt(slope), 1.0) * wave  # a direction counts as the samples do
    none: Any = {"J": np.zeros((n, 0)), "slope": np.zeros(n), "shift": 0.0, "prior": 1e-3}
    little = 0.05 * wave
    blocks = [
        ResidualBlock(residual=left, heavy_tail=other, **none),
        ResidualBlock(residual=30.0 * little + rng.normal(size=n), **none),
    ]
    D = np.concatenate([as_seen, little])[:, None]
    size = float(np.sqrt(D[:, 0] @ D[:, 0]))
    misfit = np.concatenate([b.residual for b in blocks])
    along, gains = _best_amplitude(misfit, D / size, blocks)

    def gain(a: float) -> float:
        """Fall of (D9) of the first, which leaves (E + x)(1 - a/sqrt(E + x))^2, and of squares of the second."""
        plain = (np.sqrt(expected + beyond) - a) ** 2
        x = plain - expected
        first = SETTINGS.noise.ensemble.state_size * np.log1p(beyond / SETTINGS.noise.ensemble.state_size) - (
            SETTINGS.noise.ensemble.state_size * np.log1p(x / SETTINGS.noise.ensemble.state_size) if x > 0.0 else x
        )
        w = blocks[1].residual
        return float(first + w @ w - (w - a * little) @ (w - a * little))

    best = max(gain(a) for a in np.linspace(0.0, 60.0, 6001))
    assert gains[0] == pytest.approx(gain(float(along[0]) / size), rel=1e-9)
    assert gains[0] > 0.9 * best
    assert gains[0] > 3.0 * float(misfit @ D[:, 0] / size) ** 2  # which the slopes alone would have said
