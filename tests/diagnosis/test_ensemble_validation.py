"""What is believed of an effect where runs scatter: bases, rivals, gains that outlast chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.fit.cross_validation import cross_validated, held_out
from rollover.diagnosis.fit.ensemble_mean import ensemble_mean_misfit
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Screened, Step
from rollover.diagnosis.fit.time_shift import with_shifts_near_prior
from rollover.diagnosis.noise.ensemble import HeavyTail
from rollover.diagnosis.result import Interval
from rollover.diagnosis.selection import ensemble_validation as believed
from rollover.diagnosis.selection import stepwise
from rollover.diagnosis.selection.ensemble_validation import (
    counted_in_full,
    ensemble_validated,
    is_shared,
    is_there,
    is_validated,
    judged_before_impact,
    restarted_base,
    with_full_weights,
    without_unsupported_rivals,
)
from rollover.diagnosis.selection.forward_step import _chosen
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.selection.screening import of_same_family
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.effects import Search
from tests.diagnosis.test_medoid import CHANNEL, SLOPE, TIME, N, Rough, candidate, dataset


def in_four(rng: np.random.Generator, sizes: Sequence[float]) -> Step:
    """Four recordings with an effect of so many noise units along J in each, fitted to all."""
    J = [rng.standard_normal((N, 1)) for _ in range(4)]
    w = [size * j[:, 0] + rng.standard_normal(N) for size, j in zip(sizes, J, strict=True)]
    dx = sum(float(j[:, 0] @ y) for j, y in zip(J, w, strict=True)) / sum(float(j[:, 0] @ j[:, 0]) for j in J)
    base = [ResidualBlock(residual=y, J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1.0) for y in w]
    ends = [replace(b, residual=y - j[:, 0] * dx, J=j) for b, y, j in zip(base, w, J, strict=True)]
    as_it_is = Fitted(candidates=(), x=(), blocks=tuple(base))
    return Step(base=as_it_is, fitted=Fitted(candidates=(SLOPE,), x=(0.5,), blocks=tuple(ends)), p_value=0.0)


def test_a_chance_gain_on_held_out_data_is_not_taken() -> None:
    rng, groups = np.random.default_rng(2), [[k] for k in range(4)]
    assert not any(is_validated(in_four(rng, 4 * [0.0]), groups) for _ in range(50))
    assert all(is_validated(in_four(rng, 4 * [0.6]), groups) for _ in range(50))


def test_one_recordings_demand_may_be_its_runs_divergence() -> None:
    """An effect of 3 noise units in one of four, predicted by a fit to all of them, or in each."""
    rng, groups = np.random.default_rng(4), [[k] for k in range(4)]

    def told(sizes: Sequence[float]) -> Step:
        found = in_four(rng, sizes)
        left = tuple(float(b.residual @ b.residual) for b in found.fitted.blocks)
        return replace(found, fitted=replace(found.fitted, cross_validated=left))

    alone = [told([3.0, 0.0, 0.0, 0.0]) for _ in range(50)]
    assert all(is_validated(s, groups) and not is_shared(s, groups) for s in alone)
    assert all(is_shared(told(4 * [0.6]), groups) for _ in range(50))
    assert all(is_shared(told([1.2, 0.6, 0.6, 0.6]), groups) for _ in range(50))
    one = told([3.0, 0.0, 0.0, 0.0])
    single = replace(one, base=_first(one.base), fitted=_first(one.fitted))
    assert is_shared(single, [[0]])


def _first(fitted: Fitted) -> Fitted:
    return replace(
        fitted,
        blocks=fitted.blocks[:1],
        cross_validated=None if fitted.cross_validated is None else fitted.cross_validated[:1],
    )


def test_runs_predict_held_out_data_where_slopes_hold_nearby() -> None:
    """Four recordings, all w = J d off the fit by one step d; the fourth's slopes are eight times too steep.

    Without it the others ask for d, or, as runs scatter, for a d: of what J d explains its slopes foretell (1 - 8 a)^2
    times as much, some 49 times, its run nothing but noise.
    """
    problem, groups = Problem([dataset(r, 0.1, 8.0 * np.sin(30.0 * TIME)) for r in range(4)]), [[k] for k in range(4)]
    right = problem.fit((SLOPE,), (0.3,))
    assert right is not None
    off = problem.fit((SLOPE,), (right.x[0] + 0.05,), rounds=0)
    assert off is not None
    steep = replace(off, blocks=(*off.blocks[:3], replace(off.blocks[3], J=8.0 * off.blocks[3].J)))
    told, run = held_out(steep, groups), held_out(cross_validated(problem, steep, groups), groups)
    noise, w = right.blocks[3].normal()[2], off.blocks[3].normal()[2]
    A, b = (np.array([block.normal()[k].item() for block in off.blocks]) for k in (0, 1))
    own, asked = b[3] / A[3], b[:3].sum() / A[:3].sum()
    explained = A[3] * own**2
    assert told.chi2[3] == pytest.approx((1.0 - 8.0 * asked / own) ** 2 * explained + w - explained, rel=1e-6)
    assert told.chi2[3] > 40.0 * w
    assert run.chi2[3] < 2.0 * noise < 0.5 * w
    base = problem.fit((), ())
    assert base is not None
    assert cross_validated(problem, base, groups) is base


def test_where_the_first_does_not_last_the_next_one_is_taken() -> None:
    """A step whose best fit gains nothing under the scatter of its runs, and whose second does."""
    every = [dataset(r, 0.1, 8.0 * np.sin(30.0 * TIME)) for r in range(4)]
    problem = Problem(every)
    base, right = problem.fit((), ()), problem.fit((SLOPE,), (0.3,))
    assert base is not None
    assert right is not None
    before = problem.dataset
    wrong = problem.fit((candidate("inertia", "parameter", "scale"),), (0.5,))  # moves nothing
    assert wrong is not None
    step = Step(base=base, fitted=wrong, p_value=0.0, rivals=(wrong, right))
    groups = [[k] for k in range(4)]
    found = ensemble_validated(problem, step, groups)
    assert found is not None
    assert found.fitted.candidates[-1].key == "slope"
    assert found.fitted.x[0] == pytest.approx(0.4, abs=0.02)
    assert problem.dataset is not before
    kept = problem.dataset
    assert ensemble_validated(problem, replace(step, rivals=(wrong,)), groups) is None
    assert problem.dataset == kept


@pytest.mark.parametrize(
    ("missing", "p", "effort", "goes_on"),
    [
        (8.0, 0.05, SETTINGS.forward.runs, True),
        (8.0, 0.2, SETTINGS.forward.runs, False),
        (0.0, 0.05, SETTINGS.forward.runs, False),
        (0.0, 0.001, SETTINGS.forward.runs, True),
        (8.0, 0.05, SETTINGS.forward.drops, False),
    ],
)
def test_a_sure_mismatch_is_searched_though_slopes_scatter(
    missing: float, p: float, effort: Effort, goes_on: bool
) -> None:
    rng = np.random.default_rng(3)
    sine = missing * np.sin(30.0 * TIME)
    problem = Problem([dataset(r, 0.0, sine + 0.1 * rng.standard_normal(N), effort) for r in range(4)])
    base, fitted = problem.fit((), ()), problem.fit((SLOPE,), (0.4,), rounds=0)
    assert base is not None
    assert fitted is not None
    found = Step(base=base, fitted=fitted, p_value=p, rivals=(fitted,))
    assert stepwise.is_beyond_chance(found, problem, 4 * [[(0.0, "rest")]]) is goes_on


@pytest.mark.parametrize(("others", "in_full"), [(0, False), (1, False), (2, False), (3, True), (4, True)])
def test_what_all_recordings_do_after_an_impact_is_no_chance(others: int, in_full: bool) -> None:
    """Of four that may each take another course in 15 % of cases: three or more do in 1.2 %, two or more in 11 %."""
    far = HeavyTail(samples=np.full(N, 0.1), share=0.2, more=1.0)
    no_jacobian = ResidualBlock(residual=np.ones(N), J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1.0)

    def again(f: Fitted) -> Fitted:
        of = [far if problem.heavy_tailed and k < others else None for k in range(4)]
        return replace(f, blocks=tuple(replace(no_jacobian, heavy_tail=heavy_tail) for heavy_tail in of))

    problem: Any = SimpleNamespace(heavy_tailed=False, again=again)
    found = with_full_weights(problem, Fitted(candidates=(), x=(), blocks=(no_jacobian,) * 4))
    assert problem.heavy_tailed is not in_full
    assert sum(b.heavy_tail is not None for b in found.blocks) == (0 if in_full else others)
    held = counted_in_full(problem, Fitted(candidates=(), x=(), blocks=(no_jacobian,) * 4))
    assert problem.heavy_tailed  # for what explains it
    assert sum(b.heavy_tail is not None for b in held.blocks) == (0 if in_full else others)


def test_with_what_leads_its_family_gets_a_first_fit() -> None:
    """Six of the ground, three sensors; the last one of the ground is akin to the best one."""
    kinds = [("a", "depth"), ("b", "x"), ("c", "y"), ("d", "z"), ("e", "u"), ("f", "depth")]
    two = {"depth": Search(0, 1), "ratio": Search(0, 1)}
    every = [Candidate(id=i, kind="physics", family=f, search=two, null=(None, 0.5)) for i, f in kinds]
    every += [Candidate(id=i, kind="sensor", family="depth", search={}) for i in ("g", "h", "i")]
    screened = [Screened(candidate=c, starts=(), chi2=float(k), potential=0.0) for k, c in enumerate(every)]
    scored = ScoreTest(score=9.0, scores={c.key: 9.0 - k for k, c in enumerate(every)}, null=np.zeros(9), detectable={})
    chosen = {s.candidate.key for s in _chosen(screened, SETTINGS.forward.runs, scored)}
    assert chosen == {"a", "b", "c", "d", "f", "g", "h", "i"}
    hopeless = replace(scored, scores={**scored.scores, "c": 0.4, "f": 0.4})  # of 9; one is akin to the best
    assert "c" not in (rest := {s.candidate.key for s in _chosen(screened, SETTINGS.forward.runs, hopeless)})
    assert {"a", "b", "f"} < rest
    loud = replace(scored, scores={**scored.scores, "g": 500.0})  # a sensor: those that move the vehicle stay
    assert {s.candidate.key for s in _chosen(screened, SETTINGS.forward.runs, loud)} == {"a", "b", "c", "d", "f", "g"}
    masked = replace(hopeless, leading=("c",))
    assert "c" in {s.candidate.key for s in _chosen(screened, SETTINGS.forward.runs, masked)}
    every[0] = replace(every[0], null=(0.5, 0.5))  # it acts everywhere
    assert of_same_family(every, 4, 2) == []


@pytest.mark.parametrize(("p", "kept"), [(0.004, 0), (0.06, 1), (0.004, 1)])
def test_what_admits_a_step_speaks_for_its_best(monkeypatch: pytest.MonkeyPatch, p: float, kept: int) -> None:
    """p of a best score of 7.5 is 0.06: what is missing for sure lets the step in, and its best is judged by its runs.

    In a step that another one led it is none of the rivals.
    """
    seen: list[int] = []
    monkeypatch.setattr(stepwise, "ensemble_validated", lambda _problem, found, _groups: seen.append(len(found.rivals)))
    null = np.sort(np.random.default_rng(0).standard_normal((4000, 10)).max(axis=1) ** 2)
    score = float(np.quantile(null, 1.0 - (0.06 if p > 0.005 or not kept else p)))
    one = Fitted(candidates=(candidate("slope", "physics", "a"),), x=(0.5,), blocks=())
    scored = ScoreTest(score=score, scores={"slope": score}, null=null, detectable={})
    inquiry: Any = SimpleNamespace(problem=SimpleNamespace(effort=SETTINGS.forward.runs), groups=[])
    stepwise.validated_step(inquiry, Step(base=one, fitted=one, p_value=p, rivals=(one,)), scored)
    assert seen == [kept]


def test_a_rival_that_nothing_spoke_for_is_none() -> None:
    fits = [
        Fitted(candidates=(candidate(k, "physics", "a"),), x=(0.5,), blocks=()) for k in ("slope", "mass", "inertia")
    ]
    null = np.sort(np.random.default_rng(0).standard_normal((4000, 20)).max(axis=1) ** 2)
    scored = ScoreTest(score=60.0, scores={"slope": 60.0, "mass": 4.0}, null=null, detectable={})
    step = Step(base=fits[0], fitted=fits[1], p_value=0.0, rivals=tuple(fits))
    assert without_unsupported_rivals(step, scored).rivals == (fits[0],)
    far = replace(scored, far={"inertia": ((0.9,),)})  # its runs did
    assert without_unsupported_rivals(step, far).rivals == (fits[0], fits[2])
    two = {"depth": Search(0, 1), "ratio": Search(0, 1)}
    placed = [Candidate(id=i, kind="physics", family="f", search=two, null=(None, 0.5)) for i in ("slope", "mass")]
    same_family = [Fitted(candidates=(c,), x=(0.5, 0.5), blocks=()) for c in placed]
    others = replace(step, rivals=(*same_family, fits[2]))
    assert without_unsupported_rivals(others, scored).rivals == tuple(same_family)


def test_a_gain_before_the_impact_alone_is_validated() -> None:
    """An effect that is sure while a body tips, and runs that go elsewhere after the impact."""
    rng = np.random.default_rng(3)
    every = [replace(dataset(r, 0.1), first_impact=TIME[N // 2]) for r in range(4)]
    early = TIME[N // 2] > TIME
    J = [rng.standard_normal((N, 1)) for _ in range(4)]
    w = [np.where(early, 0.6, rng.uniform(-30.0, 30.0)) * j[:, 0] + rng.standard_normal(N) for j in J]
    base = [ResidualBlock(residual=y, J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1.0) for y in w]
    ends = [replace(b, residual=y - 0.6 * j[:, 0], J=j) for b, y, j in zip(base, w, J, strict=True)]
    whole = Step(
        base=Fitted(candidates=(), x=(), blocks=tuple(base)),
        fitted=Fitted(candidates=(SLOPE,), x=(0.5,), blocks=tuple(ends)),
        p_value=0.0,
    )
    groups = [[k] for k in range(4)]
    assert not is_validated(whole, groups)
    assert is_validated(judged_before_impact(Problem(every), whole), groups)


def test_a_base_is_begun_where_its_rivals_are() -> None:
    """A base whose clock was bent far off, and leaves more there than where the clock says."""
    rng = np.random.default_rng(5)
    problem = Problem([dataset(0, 0.0, 0.1 * rng.standard_normal(N))])
    curved = problem.block(0, (), (), 3.0 * problem.dataset[0].shift_prior, problem.effort.fine)
    assert curved is not None
    base = Fitted(candidates=(), x=(), blocks=(curved,))
    assert restarted_base(problem, base).blocks[0].shift == 0.0
    assert with_shifts_near_prior(problem, base).blocks[0].shift == problem.dataset[0].shift_prior
    good = restarted_base(problem, base)
    assert restarted_base(problem, good).blocks[0].total <= good.blocks[0].total


def test_rivals_are_judged_by_the_mean_of_their_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """One rival's run meets the recordings by chance while its neighbours do not, the other's all do but itself."""

    class Chance(Rough):
        def predict(self, changes: Mapping[str, Any], shift: float) -> dict[str, np.ndarray]:
            slope, scale = changes.get("effects.slope.angle", 0.0), changes.get("effects.inertia.scale", 0.0)
            lucky = bool(scale) and not changes.get("neighbour", 0)
            off = 0.4 * bool(slope) * (not changes.get("neighbour", 0)) * np.cos(20.0 * TIME)
            weak = 0.3 * bool(changes.get("effects.mass.share", 0.0))
            return {CHANNEL: 20.0 * (slope or weak or 0.4 * lucky) * np.sin(30.0 * TIME) + off}

    rng = np.random.default_rng(4)
    every = []
    for r in range(4):
        one = dataset(r, 0.1, 8.0 * np.sin(30.0 * TIME) + 0.1 * rng.standard_normal(N))
        every.append(replace(one, simulator=cast(Any, Chance(r, 0.1))))
    problem = Problem(every)
    base, right = problem.fit((), ()), problem.fit((SLOPE,), (0.4,), rounds=0)
    lucky = problem.fit((candidate("inertia", "parameter", "scale"),), (0.5,), rounds=0)
    assert base is not None
    assert right is not None
    assert lucky is not None
    assert lucky.chi2 < right.chi2
    assert ensemble_mean_misfit(problem, right)[0] < 0.5 * right.chi2
    assert ensemble_mean_misfit(problem, lucky)[0] > 10.0 * ensemble_mean_misfit(problem, right)[0]
    early = [replace(e, first_impact=TIME[20]) for e in every]
    problem.with_noise_model(early)
    part = sum(float(b.residual[:20] @ b.residual[:20]) + (b.shift / b.prior) ** 2 for b in base.blocks)
    assert ensemble_mean_misfit(problem, base)[1] == pytest.approx(part, rel=0.01)
    problem.with_noise_model(every)
    found = ensemble_validated(
        problem, Step(base=base, fitted=lucky, p_value=0.0, rivals=(lucky, right)), [[k] for k in range(4)]
    )
    assert found is not None
    assert [f.candidates[-1].key for f in found.rivals] == ["slope"]
    monkeypatch.setattr(believed, "is_shared", lambda *_: False)
    monkeypatch.setattr(believed, "judged_before_impact", lambda _, s: replace(s, fitted=s.base))
    problem.with_noise_model(every)
    step = Step(base=base, fitted=lucky, p_value=0.0, rivals=(lucky, right))
    assert ensemble_validated(problem, step, [[k] for k in range(4)]) is None
    monkeypatch.undo()
    problem.with_noise_model(every)
    weaker = problem.fit((candidate("mass", "parameter", "share"),), (0.5,), rounds=0)
    assert weaker is not None
    monkeypatch.setattr(believed, "is_there", lambda *_: True)
    step = Step(base=base, fitted=weaker, p_value=0.0, rivals=(weaker, right))
    found = ensemble_validated(problem, step, [[k] for k in range(4)])
    assert found is not None
    assert found.fitted.candidates[-1].key == "slope"
    assert len(found.rivals) == 2


def test_a_strength_whose_interval_holds_null_is_no_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, asked = Problem([dataset(0, 0.1, np.zeros(N))]), list[Any]()
    layer = replace(
        candidate("soil-layer", "physics", "depth"),
        search={"depth": Search(0.0, 0.1), "stiffness_ratio": Search(0.1, 9.0, "log")},
    )
    fitted = Fitted(candidates=(layer,), x=(0.5, 0.5), blocks=())

    def told(low: float, high: float) -> bool:
        found = [{"depth": Interval(value=0.02, low=0.01, high=0.03, unit="m"), "stiffness_ratio": _from(low, high)}]
        monkeypatch.setattr(believed, "intervals", lambda *given: asked.append(given[2]) or found)
        return is_there(problem, fitted)

    assert not told(0.73, 1.37)
    assert told(1.1, 1.4)
    assert told(0.5, 0.9)
    assert asked == [{}, {}, {1: (1.0,)}, {}, {1: (1.0,)}]  # by slopes, and towards none by runs
    asked.clear()
    assert told(7.9, 8.1)
    assert asked == [{}]  # beyond doubt
    own = replace(candidate("ground-friction", "physics", "coefficient"), null=(0.5,))  # the scenario's is 0.5
    fitted = Fitted(candidates=(own,), x=(0.6,), blocks=())
    for low, high, there in ((0.4, 0.6, False), (0.55, 0.7, True)):
        alone = [{"coefficient": _from(low, high)}]
        monkeypatch.setattr(believed, "intervals", lambda *_, alone=alone: alone)
        assert is_there(problem, fitted) is there


def _from(low: float, high: float) -> Interval:
    return Interval(value=0.5 * (low + high), low=low, high=high, unit="1")


@pytest.mark.parametrize(
    ("heavy_tailed", "others", "lasts"),
    [(True, 1, True), (True, 2, True), (True, 2, False), (False, 0, True), (False, 0, False)],
)
def test_diverged_runs_count_otherwise_where_no_gain_is_valid(
    heavy_tailed: bool, others: int, lasts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One may be chance's; of two it is asked what could have sent them there, and they are forgiven if nothing has.

    Those that count in full are forgiven: what shows before the impact is little beside where they went.
    """
    far = HeavyTail(samples=np.full(N, 0.1), share=0.2, more=1.0)
    no_jacobian = ResidualBlock(residual=np.ones(N), J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1.0)
    current = Fitted(
        candidates=(),
        x=(),
        blocks=tuple(replace(no_jacobian, heavy_tail=far if k < others else None) for k in range(4)),
    )
    seen: list[bool] = []
    problem: Any = SimpleNamespace(heavy_tailed=heavy_tailed, again=lambda f: f, effort=SETTINGS.forward.runs)
    scored = ScoreTest(score=0.0, scores={}, null=np.zeros(9), detectable={})
    made = Step(base=current, fitted=current, p_value=0.0)

    def parallel_map(problem: Any, *_: Any) -> ScoreTest:
        seen.append(problem.heavy_tailed)
        return scored

    monkeypatch.setattr(stepwise, "score_candidates", parallel_map)
    monkeypatch.setattr(stepwise, "step", lambda *_: made)
    monkeypatch.setattr(stepwise, "ensemble_validated", lambda *_: made if lasts else None)
    monkeypatch.setattr(stepwise, "largest_change", lambda *_: 1.0)
    inquiry = Inquiry(problem=problem, candidates=[], groups=[], phases=[], say=print, executor=cast(Any, None))
    found = stepwise.with_other_weighting(inquiry, current)
    able = others > 1 or not heavy_tailed
    assert seen == [not heavy_tailed] * able
    assert (found is not None) == (able and lasts)
    assert problem.heavy_tailed is (heavy_tailed if found is None else not heavy_tailed)


@pytest.mark.parametrize(("heavy_tailed", "masked"), [(True, True), (False, True), (False, False)])
def test_a_strength_is_judged_as_it_is_held(heavy_tailed: bool, masked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Found in full, one recording on another course asks for another strength; all samples count again afterwards."""
    problem = Problem([])
    problem.heavy_tailed = heavy_tailed

    def with_full_weights(problem: Any, fitted: Fitted) -> Fitted:
        problem.heavy_tailed = masked
        return fitted

    monkeypatch.setattr(believed, "with_full_weights", with_full_weights)
    monkeypatch.setattr(believed, "is_there", lambda problem, _: problem.heavy_tailed)
    assert believed.is_significant_as_held(problem, Fitted(candidates=(), x=(), blocks=())) is masked
    assert problem.heavy_tailed is heavy_tailed
