"""What is left decides whether effects are named, and more strictly where there are as many as may be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.time_shift import estimate_time_shifts
from rollover.diagnosis.inference.lack_of_fit import Cell, Mismatch
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.selection import decision, explanation, forward_step, pairs, stepwise
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.decision import by_first_effect, verdict_on
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded
from tests.diagnosis.test_fits import problem_of

IDS = ("soil-crust", "guide-friction", "mass")


def left(p_value: float, structure: float = 0.0) -> Mismatch:
    cell = Cell(
        recording=0, channel="c", phase="impact", start=0.0, end=1.0, rows=np.arange(0), p_value=p_value, excess=0.0,
        structured=structure + 12.0, waves=12, noise_power=0.0, noise=(12.0, 0.0),
    )  # fmt: skip
    return Mismatch(cells=(cell,), p_value=p_value, adjusted=())


def step(count: int) -> Step:
    candidates = [Candidate(id=i, kind="physics", family="", search={"a": Search(0, 1)}) for i in IDS[:count]]
    no_jacobian = Fitted(candidates=(), x=(), blocks=())
    return Step(base=no_jacobian, fitted=Fitted(candidates=tuple(candidates), x=(0.5,) * count, blocks=()), p_value=0.0)


def explanation_of(count: int, p_value: float) -> Explanation:
    parts = tuple(step(k + 1) for k in range(count))
    scored = ScoreTest(score=99.0, scores={}, null=np.zeros(10), detectable={})
    return Explanation(
        base=parts[0].base,
        fitted=parts[-1].fitted,
        parts=parts,
        scored=scored,
        detectable={},
        before=left(0.0, structure=1e5),
        after=left(p_value),
        first=parts[0],
    )


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Held-out misfit by label; everything that is left matters."""
    misfits = {"the scenario as it is": 20.0, "soil-crust": 3.5}
    monkeypatch.setattr(decision, "matters", lambda *_: True)
    monkeypatch.setattr(decision, "is_tolerated", lambda *_: False)
    monkeypatch.setattr(decision, "strongest", lambda *one: one[2].candidates[0])
    monkeypatch.setattr(decision, "held_out", lambda f, _: SimpleNamespace(total=misfits.get(f.label, 1.0)))
    monkeypatch.setattr(decision, "mismatch_of", lambda *_: left(1e-9))
    return misfits


@pytest.mark.parametrize(
    ("count", "p_value", "named"),
    [
        (1, 0.002, 1),
        (2, 0.002, 2),
        (2, 1e-4, 0),
        (SETTINGS.selection.flexibility.most_effects, 0.02, 0),
        (SETTINGS.selection.flexibility.most_effects, 0.2, SETTINGS.selection.flexibility.most_effects),
    ],
)
def test_as_many_effects_as_may_be_must_leave_what_chance_leaves(
    count: int, p_value: float, named: int, judged: dict[str, float]
) -> None:
    found, verdict = verdict_on(
        cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)),
        explanation_of(count, p_value),
        [],
        [],
    )
    assert len(found.parts) == named
    assert verdict == ("missing-physics" if named else "unexplained")


@pytest.mark.parametrize(("local", "named"), [(0.5, SETTINGS.selection.flexibility.most_effects), (1e-5, 0)])
def test_flexible_effects_must_leave_no_single_place(local: float, named: int, judged: dict[str, float]) -> None:
    """All places together hide one: chi-square of 960 takes no note of 50 beyond the 12 of one."""
    found = explanation_of(SETTINGS.selection.flexibility.most_effects, 0.4)
    found = replace(found, after=replace(found.after, adjusted=(0.9, local)))
    problem = cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops))
    assert len(verdict_on(problem, found, [], [])[0].parts) == named
    fewer = explanation_of(2, 0.4)
    assert len(verdict_on(problem, replace(fewer, after=found.after), [], [])[0].parts) == 2


@pytest.mark.parametrize(
    ("moved", "remaining", "verdict"),
    [(1e-4, 0.4, "no-mismatch"), (1e-4, 1e-9, "unexplained"), (0.1, 0.4, "unexplained")],
)
def test_what_a_slight_effect_explains_whole_is_no_mismatch(
    moved: float, remaining: float, verdict: str, judged: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(decision, "largest_change", lambda *_: moved)
    monkeypatch.setattr(decision, "mismatch_of", lambda *_: left(remaining))
    one = explanation_of(1, 1e-9)
    found = verdict_on(
        cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)),
        replace(one, parts=(), fitted=one.base),
        [],
        [],
    )
    assert (found[0].parts, found[1]) == ((), verdict)


def test_the_gain_of_an_effect_that_may_be_null_tells_nothing() -> None:
    """The p-value is that of the misfit then; of several, others may have gained what it seemed to."""
    problem = cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops))
    one, two = (replace(explanation_of(count, 0.4), before=left(0.2)) for count in (1, 2))
    assert one.p_value < 1e-6  # of 99 that the best candidate scores
    refused = by_first_effect(problem, one, {IDS[0]}, [])
    assert (refused.parts, refused.fitted, refused.p_value) == ((), one.base, 0.2)
    assert by_first_effect(problem, two, {IDS[0]}, []).p_value == two.p_value


@pytest.mark.parametrize(("second_order", "offset", "done"), [(0.0, -4e-4, False), (0.25, 0.0, True)])
def test_a_maybe_null_effect_is_dropped_if_another_does_its_work(
    second_order: float, offset: float, done: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sensor of second order comes late, as one of first does whose clock is off.

    Where a tolerance prevails all samples of a signal share one error, and what they lose together counts for one.
    """
    lag = {"channel": ACCELERATION, "time": 3e-3, "second_order": second_order}
    clock = {"channel": ACCELERATION, "offset": offset}
    changes = {f"effects.sensor-lag.{k}": v for k, v in lag.items()}
    changes |= {f"effects.sensor-clock-offset.{k}": v for k, v in clock.items()} if offset else {}
    problem = problem_of(recorded(changes, speeds=(1.5, 2.5), channels=(FORCE, DEPTH, ACCELERATION), noise=0.001))
    estimate_time_shifts(problem)
    able = candidates_of(problem.dataset, (), "drop")
    both = [
        next(c for c in able if (c.id, c.channel) == (id, ACCELERATION)) for id in ("sensor-lag", "sensor-clock-offset")
    ]
    fitted = problem.fit(both, (*both[0].starts()[0], 0.5))
    assert fitted is not None
    problem.with_noise_model(
        autoregression.with_noise_of_residuals(problem.dataset, problem.residuals(fitted))
    )  # by what is left, as a step is
    found: Any = SimpleNamespace(fitted=problem.again(fitted))
    doubtful = {"sensor-clock-offset"}
    assert decision.redundant_effects(problem, found, doubtful) == (doubtful if done else set())
    assert decision.redundant_effects(problem, found, set()) == set()
    monkeypatch.setattr(Problem, "samples_per_error", 1e6)
    assert decision.redundant_effects(problem, found, doubtful) == doubtful


@pytest.mark.parametrize(("channels", "named"), [(("a", "a"), 0), (("a", "b"), 2), ((None, None), 2), ((None, "a"), 2)])
def test_two_of_one_sensor_must_leave_what_chance_leaves(
    channels: tuple[str | None, ...], named: int, judged: dict[str, float]
) -> None:
    found = explanation_of(2, 0.002)
    candidates = tuple(replace(c, channel=k) for c, k in zip(found.fitted.candidates, channels, strict=True))
    found = replace(found, fitted=replace(found.fitted, candidates=candidates))
    problem: Any = SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)
    assert len(verdict_on(problem, found, [], [])[0].parts) == named


@pytest.mark.parametrize(
    ("misfit", "structure", "named"), [(1.5, 100.0, True), (1.5, 2000.0, False), (2.5, 100.0, False)]
)
def test_an_effect_that_takes_nearly_all_is_named(
    misfit: float, structure: float, named: bool, judged: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """20 times the noise before: of the excess 0.3 or 1.3 % is left, of what is structured 0.1 or 2 %."""
    judged["soil-crust"] = misfit
    monkeypatch.setattr(decision, "mismatch_of", lambda *_: left(1e-9, structure))
    problem: Any = SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)
    found, verdict = verdict_on(problem, explanation_of(2, 1e-4), [], [])
    assert verdict == ("missing-physics" if named else "unexplained")
    if named:
        assert found.fitted.label == "soil-crust"
        assert found.after.p_value == 1e-9  # and not that of both


@pytest.mark.parametrize(
    ("start", "ahead", "named"),
    [
        (20.0, 1.0, 1),
        (20.0, 18.9, 1),
        (20.0, 19.1, 0),  # takes 9 % of the excess, and leaves far more than noise: spikes, or another noise
        (20.0, 20.0, 0),
        (20.0, 30.0, 0),
        (1.25, 1.24, 1),  # far more than noise is left nowhere
        (1.25, 1.26, 0),
    ],
)
def test_an_effect_that_hardly_predicts_better_is_not_named(
    start: float, ahead: float, named: int, judged: dict[str, float]
) -> None:
    """Whatever it leaves of those that it was fitted to."""
    judged |= {"the scenario as it is": start, "soil-crust": ahead}
    found, verdict = verdict_on(
        cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)), explanation_of(1, 0.4), [], []
    )
    assert (len(found.parts), verdict) == (named, "missing-physics" if named else "unexplained")


def test_what_leaves_no_more_than_is_tolerated_is_named(
    judged: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Errors of a model are smooth, and so has structure what lies within them."""
    monkeypatch.setattr(decision, "is_tolerated", lambda _, f: f.label == "soil-crust")
    for held_out, named, expected in ((1.1, 1, "missing-physics"), (3.5, 0, "unexplained")):
        judged["soil-crust"] = held_out
        found, verdict = verdict_on(
            cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)), explanation_of(1, 1e-9), [], []
        )
        assert (len(found.parts), verdict) == (named, expected)


@pytest.mark.parametrize(("more", "numbers", "named"), [(3.0, 1, True), (3.0, 3, False), (5.0, 1, False)])
def test_a_simpler_rival_that_fits_as_well_is_named_beside(
    more: float, numbers: int, named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held out it does worse by far; to all recordings it leaves 3 (or 5) more than the best's 100, of 1000."""
    monkeypatch.setattr(forward_step, "held_out_disadvantage", lambda *_: (9.0, 9.0))

    def fitted(id: str, left: float, many: int) -> Fitted:
        search = {f"a{k}": Search(0, 1) for k in range(many)}
        candidate = Candidate(id=id, kind="physics", family="", search=search)
        block = ResidualBlock(
            residual=np.array([np.sqrt(left)]), J=np.zeros((1, many)), slope=np.zeros(1), shift=0.0, prior=1.0
        )
        return Fitted(candidates=(candidate,), x=(0.5,) * many, blocks=(block,))

    base, best = fitted("none", 1000.0, 0), fitted("soil-viscous-damping", 100.0, 2)
    rival = fitted("soil-inertial-drag", 100.0 + more, numbers)
    found = forward_step.confusion_set(Step(base=base, fitted=best, p_value=0.0, rivals=(best, rival)), [])
    assert found == ([best, rival] if named else [best])


@pytest.mark.parametrize(("beside", "taken"), [(0.4, True), (1e-9, False)])
def test_condition_errors_count_where_they_leave_chance_alone(
    beside: float, taken: bool, judged: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wrong effect would bend them too: then they stay as they act on the scenario as it is."""
    reweighted: list[str] = []
    found, again = step(1), step(2).fitted
    problem = cast(Problem, SimpleNamespace(dataset="as it is", with_noise_model=reweighted.append))
    monkeypatch.setattr(explanation, "has_uncertain_conditions", lambda _: True)
    monkeypatch.setattr(explanation, "is_enough", lambda _problem, _fit, what: what.p_value > 0.001)
    monkeypatch.setattr(explanation, "refitted_with_conditions", lambda *_: again)
    monkeypatch.setattr(explanation, "mismatch_of", lambda *_: left(beside))
    after, remaining = explanation.with_conditions_refitted(problem, found, left(1e-9), [])
    assert (after.fitted is again) == taken
    assert remaining.p_value == (beside if taken else 1e-9)
    assert reweighted == ([] if taken else ["as it is"])
    same, _ = explanation.with_conditions_refitted(problem, found, left(0.4), [])
    assert same is found, "nothing is left to be eased"


@pytest.mark.parametrize(
    ("other", "p_value", "exchanged"), [(50.0, 1e-9, True), (90.0, 1e-9, False), (50.0, 0.5, False)]
)
def test_beside_a_resonance_the_other_of_a_pair_is_refitted(
    monkeypatch: pytest.MonkeyPatch, other: float, p_value: float, exchanged: bool
) -> None:
    """With a wrong share of the nose all that stands beside it is met as badly: the second was chosen in the dark."""

    def pair(last: str, left: float) -> Fitted:
        searches = {"structural-compliance": ("stiffness", "damping"), last: ("a",)}
        candidates = tuple(
            Candidate(id=i, kind="physics", family="", search=dict.fromkeys(own, Search(0, 1)))
            for i, own in searches.items()
        )
        zero = np.zeros(4)
        block = ResidualBlock(residual=zero + np.sqrt(left / 4.0), J=np.zeros((4, 3)), slope=zero, shift=0.0, prior=1.0)
        return Fitted(candidates=candidates, x=(0.1, 0.2, 0.3), blocks=(block,))

    def stepped(fit: Fitted) -> Step:
        return Step(base=fit, fitted=fit, p_value=0.0, rivals=(fit,))

    asked: list[str] = []

    def swapped(_: Any, current: Fitted) -> Step:
        asked.append(current.candidates[-1].id)
        return stepped(pair("mass", other))

    found = stepped(pair("soil-layer", 80.0))
    problem = SimpleNamespace(again=lambda f: f, dataset=())
    monkeypatch.setattr(pairs, "best_pair", lambda *_: found)
    monkeypatch.setattr(pairs, "followed", lambda _, one: (one, left(p_value)))
    monkeypatch.setattr(pairs, "is_enough", lambda _problem, _fit, what: what.p_value > 0.001)
    monkeypatch.setattr(pairs, "with_first_replaced", swapped)
    monkeypatch.setattr(pairs, "with_noise_of_fit", lambda *_: False)
    asking = cast(Inquiry, SimpleNamespace(problem=problem, phases=()))
    both = pairs.best_subsets(asking, [found], cast(ScoreTest, None), pair("mass", 1e4))
    assert both is not None
    assert both[0][-1].fitted.candidates[-1].id == ("mass" if exchanged else "soil-layer")
    assert asked == ([] if p_value > 0.001 else ["structural-compliance"])


def test_effects_that_may_be_any_others_are_not_named(judged: dict[str, float]) -> None:
    problem = cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops))
    found = explanation_of(SETTINGS.selection.flexibility.most_effects, 0.4)
    assert len(verdict_on(problem, found, [], [])[0].parts) == SETTINGS.selection.flexibility.most_effects
    refused, verdict = verdict_on(problem, replace(found, is_unique=False), [], [])
    assert (refused.parts, verdict) == ((), "unexplained")


@pytest.mark.parametrize(("alone", "named"), [(3.5, []), (1.5, ["soil-crust"])])
def test_effects_beside_a_curved_sensor_are_not_named_together(
    alone: float, named: list[str], judged: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They leave no more than chance over all, and what is looked for itself: one that takes nearly all is named."""
    monkeypatch.setattr(decision, "is_a_curve", lambda *_: True)
    judged["soil-crust"] = alone
    found, verdict = verdict_on(
        cast(Problem, SimpleNamespace(dataset=(), effort=SETTINGS.forward.drops)), explanation_of(2, 0.4), [], []
    )
    assert [s.fitted.candidates[-1].id for s in found.parts] == named
    assert verdict == ("missing-physics" if named else "unexplained")


@pytest.mark.parametrize(
    ("before", "after", "unlikely"),
    [
        (400.0, 300.0, False),  # of 40 samples: the second took 100, a third would have to take 260
        (370.0, 300.0, True),  # 70, and 260
        (320.0, 300.0, True),  # 20, and 260
        (300.0, 305.0, True),  # under another noise it took nothing
        (100.0, 50.0, False),
    ],
)
def test_no_third_effect_that_must_take_far_more_than_the_second(before: float, after: float, unlikely: bool) -> None:
    base, current = leaving(before), leaving(after)
    last = forward_step.Step(base=base, fitted=current, p_value=0.0)
    problem = cast(Problem, SimpleNamespace(effort=SimpleNamespace(is_ensemble=False)))
    assert stepwise.is_third_unlikely(problem, last, current) is unlikely
    # a full run costs much, and a third is rare there
    assert not stepwise.is_third_unlikely(
        cast(Problem, SimpleNamespace(effort=SimpleNamespace(is_ensemble=True))), last, current
    )


@pytest.mark.parametrize(
    ("before", "after", "is_ensemble", "hopeless"),
    [
        (2040.0, 300.0, False, True),  # of 40 samples, 2.7 times the noise: 260 of 2000 are left
        (3040.0, 300.0, False, False),  # of 3000 that is little: a third effect of three may be no more
        (3040.0, 300.0, True, True),  # full runs are dear
        (1040.0, 150.0, False, False),  # less than twice the noise, though 110 of 1000 are left
    ],
)
def test_two_that_leave_a_small_part_may_have_a_third(
    before: float, after: float, is_ensemble: bool, hopeless: bool
) -> None:
    problem = cast(Problem, SimpleNamespace(effort=SimpleNamespace(is_ensemble=is_ensemble)))
    assert stepwise.is_hopeless(problem, leaving(before), leaving(after)) is hopeless


def leaving(squares: float) -> Fitted:
    """A fit of nothing to 40 samples that leaves so much."""
    residual = np.full(40, np.sqrt(squares / 40.0))
    block = ResidualBlock(residual=residual, J=np.zeros((40, 0)), slope=np.zeros(40), shift=0.0, prior=1.0)
    return Fitted(candidates=(), x=(), blocks=(block,))
