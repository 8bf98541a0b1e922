"""One effect beside an estimated discrepancy: when it is named, when the discrepancy forgives, what is alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis import alone
from rollover.diagnosis.alone import alike_beside, best_predictor, times_shown, verdict_on_single_effect
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.invariants import rejected_effects
from rollover.diagnosis.reported import hint as hint_of
from rollover.diagnosis.result import Interval, Named, Share
from rollover.diagnosis.selection.explanation import Explanation
from rollover.diagnosis.selection.forward_step import by_chance, confusion_set
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.statements import usual_model_error_sentence
from rollover.effects import EFFECTS, Search

DROPS, SAMPLES = 6, 40
GROUPS = [[r] for r in range(DROPS)]
# noise is a tenth of what is tolerated of each sample, so that next to nothing of the squares is noise
SIGNAL = SimpleNamespace(rows=np.arange(SAMPLES), noise=0.1, sigma=1.0, channel="ground/force_normal")
PROBLEM = cast(
    Problem,
    SimpleNamespace(
        dataset=[SimpleNamespace(signals=[SIGNAL], model_error_dominates=lambda s: True, discrepancy={}, memory={})]
        * DROPS,
        samples_per_error=10.0,
        samples_per_draw=10.0 * DROPS,
        effort=SimpleNamespace(is_ensemble=False),
    ),
)


def fitted(id: str, left: Sequence[float], numbers: int = 1, x: float = 0.5) -> Fitted:
    """A fit that leaves these mean squares of each drop, held out as well; other ids leave it in other samples."""
    rng = np.random.default_rng(sum(id.encode()))
    blocks = []
    for mean_square in left:
        w = rng.standard_normal(SAMPLES)
        w *= np.sqrt(mean_square * SAMPLES / (w @ w))
        blocks.append(
            ResidualBlock(residual=w, J=np.zeros((SAMPLES, numbers)), slope=np.zeros(SAMPLES), shift=0.0, prior=1.0)
        )
    names = [*EFFECTS[id].search, "n1", "n2"][:numbers]
    search = {name: Search(0.0, 1.0) for name in names}
    candidate = Candidate(id=id, kind=EFFECTS[id].kind, family=EFFECTS[id].family, search=search, fixed={})
    return Fitted(
        candidates=(candidate,),
        x=(x,) * numbers,
        blocks=tuple(blocks),
        cross_validated=tuple(SAMPLES * v for v in left),
    )


def nothing(left: Sequence[float]) -> Fitted:
    found = fitted("mass", left)
    return Fitted(candidates=(), x=(), blocks=found.blocks, cross_validated=found.cross_validated)


def explanation(base: Sequence[float], best: Fitted, *rivals: Fitted, p_value: float = 1e-9) -> Explanation:
    one = Step(base=nothing(base), fitted=best, p_value=p_value, rivals=(best, *rivals))
    empty: Any = None
    scored = ScoreTest(score=0.0, scores={}, null=np.zeros(1), detectable={})
    return Explanation(
        base=one.base, fitted=best, parts=(one,), scored=scored, detectable={}, before=empty, after=empty, first=one
    )


SOME = (0.8, 0.9, 1.0, 0.9, 1.0, 0.8)  # of which a discrepancy of unit size leaves as much


@pytest.mark.parametrize(
    ("base", "left", "p_value", "verdict"),
    [
        (SOME, (0.2, 0.2, 0.3, 0.2, 0.3, 0.2), 1e-9, "missing-physics"),  # three quarters, of each drop
        (SOME, (0.5, 0.5, 0.6, 0.5, 0.6, 0.5), 1e-9, "unexplained"),  # surely some, and less than half: without a name
        (SOME, (0.3, 0.8, 1.1, 0.9, 0.6, 0.8), 1e-9, "no-mismatch"),  # some, maybe none: what drops have in common
        (SOME, (0.01, 1.2, 0.01, 1.3, 0.01, 0.01), 1e-9, "no-mismatch"),  # half, of some drops alone: maybe none
        (SOME, (0.05, 0.9, 0.1, 1.0, 0.1, 0.05), 1e-9, "missing-physics"),  # three fifths, and surely some of it
        (SOME, (0.05, 0.9, 0.1, 1.0, 0.1, 0.05), 0.2, "no-mismatch"),  # the best of all does as much by chance
        (SOME, (0.2, 0.2, 0.3, 0.2, 0.3, 0.2), 0.2, "missing-physics"),  # surely half: no chance does that drop by drop
        ((9.0, 8.0, 9.0, 8.0, 9.0, 8.0), (0.5,) * 6, 1e-9, "missing-physics"),
        ((9.0, 8.0, 9.0, 8.0, 9.0, 8.0), (5.0,) * 6, 1e-9, "unexplained"),
        ((9.0, 8.0, 9.0, 8.0, 9.0, 8.0), (3.0,) * DROPS, 1e-9, "missing-physics"),  # leaves more, and is surely half
        ((9.0, 8.0, 9.0, 8.0, 9.0, 8.0), (3.0, 3.0, 3.0, 5.0, 6.0, 3.0), 1e-9, "missing-physics"),  # surely a third
        ((9.0, 8.0, 9.0, 8.0, 9.0, 8.0), (3.0, 3.0, 3.0, 7.0, 7.0, 3.0), 1e-9, "unexplained"),
    ],
)
def test_an_effect_is_named_where_it_predicts_half(
    base: tuple[float, ...], left: tuple[float, ...], p_value: float, verdict: str
) -> None:
    found, said = verdict_on_single_effect(
        PROBLEM, explanation(base, fitted("soil-layer", left), p_value=p_value), GROUPS
    )
    assert said == verdict
    assert bool(found.parts) == (verdict == "missing-physics")


def shown(times: Sequence[float], held: Sequence[float], numbers: int = 1) -> tuple[Fitted, Fitted]:
    """What leaves unit squares of each recording, and a fit whose course of a fifth of these they show so many times.

    `held` are the mean squares that the fit leaves of each held out, of which the other leaves 1.
    """
    base, best = nothing((1.0,) * len(times)), fitted("soil-layer", held, numbers)
    blocks = []
    for k, (block, often) in enumerate(zip(base.blocks, times, strict=True)):
        D = np.sqrt(0.2) * np.ones(SAMPLES)
        rest = block.residual - np.mean(block.residual)
        left = often * D + rest * np.sqrt(max(1.0 - 0.2 * often**2, 0.0) * SAMPLES / (rest @ rest))
        blocks.append((replace(block, residual=left), replace(best.blocks[k], residual=left - D)))
    base, best = (replace(f, blocks=tuple(b[k] for b in blocks)) for k, f in enumerate((base, best)))
    return base, best


EACH, ONE = (1.0, 0.6, 1.3, 1.1, 0.9, 1.1), (0.3, 0.1, 5.2, 0.0, 0.2, 0.2)  # how many times drops show an effect
LESS, MORE = (0.8, 0.97, 0.7, 0.8, 0.8, 0.8), (0.8, 1.3, 0.9, 1.2, 1.1, 1.1)  # what is left of them held out


@pytest.mark.parametrize(
    ("times", "held", "p_value", "is_named"),
    [
        (EACH, LESS, 1e-9, True),  # a fifth, of each recording
        (EACH, (0.6, 1.05, 0.7, 0.9, 1.0, 0.7), 1e-9, True),  # predicted worse in one, though it is shown by it too
        (ONE, LESS, 1e-9, False),  # by one alone: maybe none
        (EACH, MORE, 1e-9, False),  # nothing does better
        (EACH, LESS, 0.01, False),  # the best of all gains as much by chance
    ],
)
def test_beside_what_references_taught_what_each_shows_is_named(
    times: tuple[float, ...], held: tuple[float, ...], p_value: float, is_named: bool
) -> None:
    base, best = shown(times, held)
    one = replace(explanation(SOME, best, p_value=p_value), base=base)
    one = replace(one, parts=(replace(one.parts[0], base=base),))
    assert verdict_on_single_effect(PROBLEM, one, GROUPS)[1] in ("unexplained", "no-mismatch")
    found, said = verdict_on_single_effect(PROBLEM, one, GROUPS, is_taught=True)
    assert (bool(found.parts), said == "missing-physics") == (is_named, is_named)


def test_an_effect_of_chance_is_rarely_shown_by_all() -> None:
    """Of numbers drawn about none their mean is outside a t interval in a twentieth; each number takes a degree."""
    rng, trials, m = np.random.default_rng(5), 1500, 4
    for numbers, most in ((1, 0.05), (2, 0.03)):
        hits = 0
        for _ in range(trials):
            true = rng.standard_normal((m, numbers))
            mean = true.mean(axis=0)
            blocks = [
                [
                    ResidualBlock(residual=v, J=np.zeros((numbers, 0)), slope=np.zeros(numbers), shift=0.0, prior=1.0)
                    for v in (w, w - mean)
                ]
                for w in true
            ]
            base, best = nothing((1.0,) * m), fitted("soil-layer", (1.0,) * m, numbers)
            base, best = (replace(f, blocks=tuple(b[k] for b in blocks)) for k, f in enumerate((base, best)))
            hits += times_shown(base, best, [[r] for r in range(m)]).low > 0.0
        assert hits / trials == pytest.approx(most, abs=4.0 * np.sqrt(most / trials))
    assert times_shown(base, best, [[0, 1], [2, 3]]).low == -np.inf  # two numbers of two conditions: nothing is known


def test_a_gain_is_one_draw_however_many_recordings_repeat_it() -> None:
    """Of errors that come anew 240 samples of six drops tell 24, of those that a rig repeats 4."""
    base, best = nothing((2.0,) * DROPS), fitted("soil-layer", (1.0,) * DROPS)
    rng = np.random.default_rng(1)
    scored = ScoreTest(score=0.0, scores={}, null=np.sort(rng.chisquare(1, (2000, 20)).max(axis=1)), detectable={})
    anew, repeated = (by_chance(base, [best], scored, shared) for shared in (10.0, 10.0 * DROPS))
    assert anew < 1e-3
    assert repeated > 0.3
    assert by_chance(base, [fitted("soil-layer", (1.9,) * DROPS)], scored, 10.0) > anew


CERTAIN, MAYBE = (0.20, 0.22, 0.19, 0.21, 0.20, 0.18), (0.10, 0.50, 0.15, 0.45, 0.05, 0.30)


@pytest.mark.parametrize(
    ("left", "x", "lag_is_probable", "leads"),
    [
        (CERTAIN, 0.5, False, "sensor-lag"),  # a tenth more, in each drop
        (CERTAIN, 1.0, True, "sensor-clock-offset"),  # at an end of its range
        (MAYBE, 0.5, False, "sensor-clock-offset"),  # more, maybe by chance of the drops: what is left tells
        (MAYBE, 0.5, True, "sensor-lag"),
        ((0.9, 0.9, 0.9, 0.9, 0.9, 0.9), 0.5, True, "sensor-clock-offset"),  # surely less, whatever is left
    ],
)
def test_conditions_tell_what_leads_then_what_is_left(
    left: tuple[float, ...], x: float, lag_is_probable: bool, leads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    probable = "sensor-lag" if lag_is_probable else "sensor-clock-offset"
    monkeypatch.setattr(alone, "log_evidence", lambda _, f: float(f.candidates[-1].id == probable))
    simple = fitted("sensor-clock-offset", (0.30, 0.31, 0.29, 0.32, 0.30, 0.28))
    one = explanation(SOME, simple, fitted("sensor-lag", left, x=x)).parts[0]
    assert best_predictor(PROBLEM, one, GROUPS).candidates[-1].id == leads


@pytest.mark.parametrize(
    ("left", "leads"),
    [
        (1.9, "sensor-clock-offset"),  # no more than six signals leave by chance, 2.15
        (2.9, "sensor-lag"),  # the discrepancy refutes both
    ],
)
def test_what_the_discrepancy_refutes_does_not_lead(left: float, leads: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alone, "log_evidence", lambda _, f: float(f.candidates[-1].id == "sensor-lag"))
    lag = fitted("sensor-lag", (0.5, 5.5, 0.6, 5.6, 0.4, 5.4))  # no drop foretells which: three better, three worse
    one = explanation((30.0,) * DROPS, fitted("sensor-clock-offset", (left,) * DROPS), lag).parts[0]
    assert best_predictor(PROBLEM, one, GROUPS).candidates[-1].id == leads


def test_rivals_of_a_family_or_within_the_discrepancy_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alone, "credible", lambda _, fits: list(fits[:1]))
    best = fitted("soil-layer", (0.5,) * DROPS)
    rivals = {
        "soil-crust": (4.5,) * DROPS,  # of the same family, and explains nearly all
        "soil-stiffness": (2.0,) * DROPS,  # leaves what the discrepancy leaves
        "soil-viscous-damping": (4.5,) * DROPS,  # leaves more, and is of another family
        "guide-friction": (40.0,) * DROPS,
    }
    fits = [fitted(id, left) for id, left in rivals.items()]
    step = explanation((100.0,) * DROPS, best, *fits).parts[0]
    assert [f.candidates[-1].id for f in alike_beside(PROBLEM, step, GROUPS)] == [
        "soil-layer",
        "soil-crust",
        "soil-stiffness",
    ]
    # and what may as well be the right one by what it leaves, if it explains half as much as the best
    with monkeypatch.context() as patch:
        patch.setattr(alone, "credible", lambda _, fits: list(fits))
        level = [fitted("soil-viscous-damping", (0.2, 9.0) * 3), fitted("guide-friction", (0.2, 80.0) * 3)]
        likely = explanation((100.0,) * DROPS, best, *level).parts[0]  # some conditions are predicted better by these
        offered = [f.candidates[-1].id for f in alike_beside(PROBLEM, likely, GROUPS)]
        assert offered == ["soil-layer", "soil-viscous-damping", "guide-friction"]
        half = [fitted("guide-friction", (0.2, 101.8) * 3), fitted("soil-crust", (0.2, 101.8) * 3)]
        less = explanation((100.0,) * DROPS, best, *half).parts[0]  # its kin are offered all the same
        assert [f.candidates[-1].id for f in alike_beside(PROBLEM, less, GROUPS)] == ["soil-layer", "soil-crust"]
        # not what the best surely predicts more than, kin or not, unless it explains nearly all
        behind = [fitted(id, (40.0, 41.0) * 3) for id in ("guide-friction", "soil-crust")]
        sure = explanation((100.0,) * DROPS, best, *behind, fits[1]).parts[0]
        assert [f.candidates[-1].id for f in alike_beside(PROBLEM, sure, GROUPS)] == ["soil-layer", "soil-stiffness"]
    # one that becomes the best at the end of its range is the best itself
    ends = [fitted(id, (0.6,) * DROPS, numbers=2, x=1.0) for id in ("soil-crust", "soil-rate-hardening")]
    step = explanation((100.0,) * DROPS, fitted("soil-stiffness", (0.5,) * DROPS), *ends).parts[0]
    offered = [f.candidates[-1].id for f in alike_beside(PROBLEM, step, GROUPS)]
    assert offered == ["soil-stiffness", "soil-rate-hardening"]  # whose slowest speed is no stiffness
    # where there is little to explain, one that explains less of it is excluded though it leaves little
    step = explanation(SOME, fitted("soil-layer", (0.2,) * DROPS), fitted("guide-friction", (0.7,) * DROPS)).parts[0]
    assert [f.candidates[-1].id for f in alike_beside(PROBLEM, step, GROUPS)] == ["soil-layer"]


def test_rivals_of_a_family_whose_form_is_refuted() -> None:
    """Who leaves a seventh of what another does is the likelier one, unless neither form is the right one."""
    best, other = fitted("soil-viscous-damping", (3.0,) * DROPS), fitted("soil-inertial-drag", (20.0,) * DROPS)
    others = [fitted("soil-stiffness", (20.0,) * DROPS), fitted("soil-rate-hardening", (200.0,) * DROPS)]
    one = explanation((3000.0,) * DROPS, best, other, *others).parts[0]
    assert confusion_set(one, GROUPS) == [best]
    assert confusion_set(one, GROUPS, is_refuted=True) == [best, other]


def test_many_scales_are_stated_by_the_least_and_the_most() -> None:
    scales = {f"c{k}": 0.01 * (k + 1) for k in range(9)}
    said = usual_model_error_sentence(scales, 1e-9, 4, taught=True)
    assert "agree but for a background (standard deviation as a share of the range: 1.0% of c0 to 9.0% of c8)" in said
    assert "c4" not in said
    assert "no more than the references show" in said


@pytest.mark.parametrize(("low", "is_estimated"), [(0.12, True), (-0.05, False)])
def test_a_part_surely_predicted_is_named_within_the_tolerance(low: float, is_estimated: bool) -> None:
    candidate = fitted("sensor-bias", SOME).candidates[-1]
    best = (candidate, Share(share=0.35, low=low, high=0.58))
    said = usual_model_error_sentence({"ground/sinkage": 0.021}, 1e-9, 6, best)
    assert "2.1% of ground/sinkage" in said
    assert ("predicted by sensor-bias: 35% (12% to 58%)" in said) is is_estimated


@pytest.mark.parametrize(
    ("x", "rival", "rejected"),
    [
        ((0.5, 0.99999), 0.9, {"sensor-clock-drift"}),  # a search that is led to a bound stops some 1e-5 before it
        ((0.5, 0.9), 0.9, set()),
        ((1.0, 0.9), 0.9, set()),  # the first, and nothing is better
        ((1.0, 0.9), 0.1, {"soil-layer"}),
        ((1.0,), 0.9, set()),
    ],
)
def test_beside_the_first_no_effect_may_stand_at_a_bound(
    x: tuple[float, ...], rival: float, rejected: set[str]
) -> None:
    layer, drift = fitted("soil-layer", (0.2,) * DROPS), fitted("sensor-clock-drift", (0.2,) * DROPS)
    found = explanation(SOME, layer, fitted("guide-friction", (rival,) * DROPS))
    candidates = (*layer.candidates, *drift.candidates)[: len(x)]
    found = replace(found, fitted=replace(layer, candidates=candidates, x=x))
    effects = [
        Named(
            id=c.id, kind="physics", channel=None, statement="", p_value=0.0, indistinguishable_from=(), settings={},
            discriminating_test="",
            parameters={"strength": Interval(value=1.0, low=0.9, high=1.1, unit="1", at_bound=at == 1.0)},
        )
        for c, at in zip(candidates, x, strict=True)
    ]  # fmt: skip
    assert rejected_effects(PROBLEM, found, effects, GROUPS, in_doubt=False) == rejected


@pytest.mark.parametrize(
    ("grade", "ids", "left", "hint"),
    [
        (
            "part",
            ("soil-layer", "mass", "soil-crust"),
            (0.15, 0.16, 0.14) * 2,
            "Beside it mass and soil-crust together",
        ),
        ("part", ("soil-layer", "mass"), (0.15, 0.16, 0.14) * 2, "Beside it mass predicts 91%"),
        ("part", ("soil-layer", "mass"), (0.9, 0.05, 0.95) * 2, ""),  # half, not surely
        ("part", ("soil-layer",), (0.15, 0.16, 0.14) * 2, ""),  # nothing else was tried
        ("whole", ("soil-layer", "mass"), (0.15, 0.16, 0.14) * 2, ""),
    ],
)
def test_what_would_meet_the_rest_is_a_hint(
    grade: str, ids: tuple[str, ...], left: tuple[float, ...], hint: str
) -> None:
    found = explanation((100.0,) * DROPS, fitted("soil-layer", (1.5,) * DROPS))
    several = replace(fitted("mass", left), candidates=tuple(fitted(id, left).candidates[0] for id in ids))
    problem = SimpleNamespace(**vars(PROBLEM), again=lambda f: f)
    told: Any = SimpleNamespace(
        explanation=found, tried=replace(found, fitted=several), grade=grade, problem=problem, groups=GROUPS
    )
    said = hint_of(told)
    assert said.strip().startswith(hint) if hint else said == ""
    assert ("a hint, no finding" in said) == bool(hint)


def test_an_effect_without_which_more_is_predicted_goes() -> None:
    """A crust leaves 0.4 of what nothing does; a mass beside it 0.3, or 0.5."""
    crust, mass = fitted("soil-crust", (0.4,) * DROPS), fitted("mass", (0.9,) * DROPS)
    named = [
        Named(
            id=id, kind="physics", channel=None, statement="", parameters={}, p_value=0.0, settings={},
            indistinguishable_from=(), discriminating_test="",
        )
        for id in ("soil-crust", "mass")
    ]  # fmt: skip
    for left, rejected in ((0.3, set()), (0.5, {"mass"})):
        both = replace(fitted("mass", (left,) * DROPS), candidates=(*crust.candidates, *mass.candidates), x=(0.5, 0.5))
        turned = replace(both, candidates=both.candidates[::-1])
        steps = Step(base=mass, fitted=turned, p_value=0.0), Step(base=crust, fitted=both, p_value=0.0)
        found = replace(explanation((1.0,) * DROPS, crust), fitted=both, parts=steps)
        assert rejected_effects(PROBLEM, found, named, GROUPS, in_doubt=False) == rejected
