"""Of several effects each is taken out and looked for anew: what comes back, what comes instead, what any could do."""

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
from rollover.diagnosis.result import Interval
from rollover.diagnosis.selection import decision, ensemble_validation, explanation
from rollover.diagnosis.settings import SETTINGS
from rollover.diagnosis.settings.forward import Effort
from rollover.effects import Search


def of(*effects: tuple[str, tuple[str, ...]]) -> Fitted:
    """A fit of effects with these numbers."""
    kinds = [Candidate(id=i, kind="physics", family="", search=dict.fromkeys(own, Search(0, 1))) for i, own in effects]
    return Fitted(candidates=tuple(kinds), x=(0.5,) * sum(len(own) for _, own in effects), blocks=())


LAYER, CRUST, STIFFNESS = ("soil-layer", ("a", "b")), ("soil-crust", ("a", "b")), ("soil-stiffness", ("a",))
VARIANT = ("soil-layer", ("a", "b", "width"))


@pytest.mark.parametrize(
    ("beside", "held", "answers", "asked"),
    [
        (LAYER, LAYER, {"soil-layer": LAYER}, ["soil-layer"]),  # found beside just this layer
        # the layer is straight beside it
        (VARIANT, VARIANT, {"soil-layer": LAYER, "soil-crust": CRUST}, ["soil-layer", "soil-crust"]),
        (VARIANT, LAYER, {"soil-layer": LAYER, "soil-crust": CRUST}, ["soil-layer", "soil-crust"]),
        (VARIANT, LAYER, {"soil-layer": LAYER, "soil-crust": STIFFNESS, "soil-stiffness": STIFFNESS},
         ["soil-layer", "soil-crust", "soil-layer"]),
    ],
)  # fmt: skip
def test_the_last_effect_is_searched_anew_beside_variants(
    monkeypatch: pytest.MonkeyPatch, beside: Any, held: Any, answers: dict[str, Any], asked: list[str]
) -> None:
    """A layer that was bent to do a stiffness's work as well left little to it: a crust came, the layer is straight.

    What takes the place of the crust stands beside another: the layer is looked for once more, now beside that.
    """
    scored: list[str] = []

    def swapped(_: Any, current: Fitted) -> Step:
        first, *rest = current.candidates
        scored.append(first.id)
        kept = [(c.id, tuple(c.search)) for c in rest]
        found = of(*kept, answers[first.id])
        return Step(base=of(*kept), fitted=found, p_value=0.0, rivals=(found,))

    monkeypatch.setattr(decision, "with_first_replaced", swapped)
    monkeypatch.setattr(decision, "backward_elimination", lambda _, f, *__: f)
    problem = SimpleNamespace(again=lambda f: f, effort=SETTINGS.forward.drops)
    taken = [
        Step(base=of(), fitted=of(beside), p_value=0.0),
        Step(base=of(beside), fitted=of(held, CRUST), p_value=0.0),
    ]
    parts = decision._retained_steps(cast(Inquiry, SimpleNamespace(problem=problem)), taken)
    assert parts is not None
    assert scored == asked
    assert {c.id for c in parts[-1].fitted.candidates} == {"soil-layer", answers.get("soil-crust", CRUST)[0]}
    assert len(parts) == 2


@pytest.mark.parametrize(
    ("effort", "beside", "certain", "fitted_again"),
    [
        (SETTINGS.forward.runs, ("soil-layer", ("a",)), set(), [0]),
        (SETTINGS.forward.runs, LAYER, set(), [0, 1]),
        (SETTINGS.forward.runs, LAYER, {0}, [1]),
        (SETTINGS.forward.runs, LAYER, {0, 1}, []),
        (SETTINGS.forward.drops, ("soil-layer", ("a",)), {0, 1}, [0, 1]),
    ],
)
def test_full_runs_keep_sure_effects_and_reuse_the_last_fit(
    monkeypatch: pytest.MonkeyPatch, effort: Effort, beside: Any, certain: set[int], fitted_again: list[int]
) -> None:
    """Without either 9 per sample more is left: both are needed."""
    asked: list[int] = []

    def without(_: Any, fitted: Fitted, k: int, *, no_jacobian: bool = False) -> Fitted:
        asked.append(k)
        assert no_jacobian == effort.is_ensemble
        return left(of(CRUST), 9.0 - k)

    monkeypatch.setattr(decision, "without_effect", without)
    monkeypatch.setattr(decision, "significant_by_wald", lambda *_: certain)
    base, held = left(of(beside), 8.0), left(of(("soil-layer", ("a",)), CRUST), 1.0)
    problem = cast(Any, SimpleNamespace(again=lambda f: f, effort=effort))
    assert decision.backward_elimination(problem, held, base) is held
    assert asked == fitted_again


def left(fitted: Fitted, much: float) -> Fitted:
    """A fit that leaves so much of each of four samples."""
    block = ResidualBlock(residual=np.full(4, much), J=np.zeros((4, 0)), slope=np.zeros(4), shift=0.0, prior=1.0)
    return replace(fitted, blocks=(block,))


@pytest.mark.parametrize("effort", [SETTINGS.forward.runs, SETTINGS.forward.drops])
def test_the_strongest_is_that_without_which_most_is_left(monkeypatch: pytest.MonkeyPatch, effort: Effort) -> None:
    """Of drops with the other fitted again, of full runs as it stands."""
    asked: list[tuple[list[str], list[float]]] = []

    def chi2_at(_: Any, candidates: Any, x: Any, shifts: Any) -> float | None:
        asked.append(([c.id for c in candidates], x))
        assert shifts == [0.0]
        return {"soil-layer": 3.0, "soil-crust": None}[candidates[0].id]  # without the layer no run is to be had

    monkeypatch.setattr(explanation, "chi2_at", chi2_at)
    monkeypatch.setattr(explanation, "without_effect", lambda _, f, k, rounds: left(of(CRUST), 2.0 - k))
    problem = cast(Any, SimpleNamespace(effort=effort))
    held = replace(left(of(LAYER, CRUST), 1.0), x=(0.1, 0.2, 0.3, 0.4))
    assert explanation.strongest(problem, left(of(), 9.0), held).id == "soil-layer"
    assert asked == ([(["soil-crust"], [0.3, 0.4]), (["soil-layer"], [0.1, 0.2])] if effort.is_ensemble else [])


def test_what_is_not_retained_goes_and_slopes_are_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    rest, again = left(of(LAYER), 1.0), left(of(LAYER), 1.0)
    monkeypatch.setattr(decision, "without_effect", lambda *_, **__: rest)
    monkeypatch.setattr(decision, "significant_by_wald", lambda *_: {0})
    for effort, found in ((SETTINGS.forward.runs, again), (SETTINGS.forward.drops, rest)):
        problem = cast(Any, SimpleNamespace(again=lambda f: again if f is rest else f, effort=effort))
        assert decision.backward_elimination(problem, left(of(LAYER, CRUST), 1.0)) is found


MASS, SPEED, RATE, DRAG = ((i, ("a",)) for i in ("mass", "impact-speed", "soil-rate-hardening", "soil-inertial-drag"))


@pytest.mark.parametrize(
    ("answers", "surplus", "asked", "found"),
    [
        # each comes back
        ([LAYER, CRUST], "", ["soil-layer", "soil-crust"], {"soil-layer", "soil-crust", "mass"}),
        # one exchange mends what the first step took
        ([SPEED, CRUST, MASS, SPEED], "", ["soil-layer", "soil-crust", "mass"], {"impact-speed", "soil-crust", "mass"}),
        # again and again: any will do
        ([SPEED, RATE, DRAG], "", ["soil-layer", "soil-crust"], None),
        # beside the better ones the mass is not needed any more: two that are these
        ([SPEED, RATE, SPEED, RATE], "mass", ["soil-layer", "soil-crust", "impact-speed", "soil-rate-hardening"],
         {"impact-speed", "soil-rate-hardening"}),
    ],
)  # fmt: skip
def test_a_full_set_swapped_again_and_again_is_no_answer(
    monkeypatch: pytest.MonkeyPatch, answers: list[Any], surplus: str, asked: list[str], found: set[str] | None
) -> None:
    scored: list[str] = []

    def swapped(_: Any, current: Fitted) -> Step:
        first, *rest = current.candidates
        kept = [(c.id, tuple(c.search)) for c in rest]
        new = of(*kept, answers[len(scored)])
        scored.append(first.id)
        return Step(base=of(*kept), fitted=new, p_value=0.0, rivals=(new,))

    def backward_elimination(_: Any, f: Fitted, *__: Any) -> Fitted:
        left = [(c.id, tuple(c.search)) for c in f.candidates if len(scored) < 2 or c.id != surplus]
        return of(*left)

    monkeypatch.setattr(decision, "with_first_replaced", swapped)
    monkeypatch.setattr(decision, "backward_elimination", backward_elimination)
    problem = SimpleNamespace(again=lambda f: f, effort=SETTINGS.forward.drops)
    order = (LAYER, CRUST, MASS)
    taken = [
        Step(base=of(*order[:k]), fitted=of(*order[: k + 1]), p_value=0.0)
        for k in range(SETTINGS.selection.flexibility.most_effects)
    ]
    parts = decision._retained_steps(cast(Inquiry, SimpleNamespace(problem=problem)), taken)
    assert scored == asked
    assert (None if parts is None else {c.id for c in parts[-1].fitted.candidates}) == found


@pytest.mark.parametrize(
    ("count", "p_value", "matters", "surplus", "is_open"),
    [
        (3, 0.2, True, False, True),
        (3, 0.01, True, False, False),  # three that are bent to much must leave more than chance leaves once in twenty
        (3, 0.01, False, False, True),
        (3, 0.01, True, True, True),  # two of them may do
        (2, 0.01, True, False, True),
    ],
)
def test_effects_that_will_be_refused_are_not_looked_for_anew(
    monkeypatch: pytest.MonkeyPatch, count: int, p_value: float, matters: bool, surplus: bool, is_open: bool
) -> None:
    held = of(LAYER, CRUST, MASS)
    fitted = of(*(LAYER, CRUST, MASS)[:count])
    monkeypatch.setattr(decision, "matters", lambda *_: matters)
    monkeypatch.setattr(decision, "is_tolerated", lambda *_: False)
    monkeypatch.setattr(decision, "backward_elimination", lambda *_: of(LAYER, CRUST) if surplus else held)
    problem = cast(Any, SimpleNamespace(again=lambda f: f, effort=SETTINGS.forward.drops))
    left = cast(Any, SimpleNamespace(p_value=p_value))
    assert decision.may_be_named(problem, fitted, left) == is_open


@pytest.mark.parametrize(
    ("back", "rivals"),
    [
        (LAYER, ["soil-layer"]),  # it comes back, with what competed there
        (CRUST, ["soil-layer", "soil-crust"]),  # a better one does: it stays, with that for a rival
        (None, ["soil-layer"]),  # nothing can be simulated without it
    ],
)
def test_a_set_that_was_swapped_has_a_step_for_each_member(
    monkeypatch: pytest.MonkeyPatch, back: Any, rivals: list[str]
) -> None:
    """A crust with a layer on it is followed to a layer on another stiffness: none of the steps was the layer's."""
    scored: list[str] = []

    def swapped(_: Any, current: Fitted) -> Step | None:
        scored.append(current.candidates[0].id)
        found = None if back is None else of(STIFFNESS, back)
        return None if found is None else Step(base=of(STIFFNESS), fitted=found, p_value=0.0, rivals=(found,))

    crust, both = of(LAYER, CRUST), of(LAYER, STIFFNESS)
    retained = [
        Step(base=of(LAYER), fitted=crust, p_value=0.0),
        Step(base=of(CRUST), fitted=of(CRUST, LAYER), p_value=0.0),
    ]
    ended = Step(base=of(LAYER), fitted=both, p_value=0.0, rivals=(both,))
    monkeypatch.setattr(decision, "with_first_replaced", swapped)
    monkeypatch.setattr(decision, "_retained_steps", lambda *_: retained)
    monkeypatch.setattr(decision, "followed", lambda *_: (ended, None))
    problem = SimpleNamespace(again=lambda f: f, effort=SETTINGS.forward.drops)
    parts = decision._fully_fitted_steps(cast(Inquiry, SimpleNamespace(problem=problem)), retained)
    assert parts is not None
    assert [s.fitted.candidates[-1].id for s in parts] == ["soil-layer", "soil-stiffness"]
    assert parts[-1].fitted is both
    assert {c.id for c in parts[0].fitted.candidates} == {"soil-layer", "soil-stiffness"}
    assert [f.candidates[-1].id for f in parts[0].rivals] == rivals
    assert scored == ["soil-layer"]


def test_a_sure_effect_lies_ten_intervals_from_its_null(monkeypatch: pytest.MonkeyPatch) -> None:
    """2 +- 0.05 is 20 half intervals away from 1; what has no number for none is not told without a run."""
    layer = of(("soil-layer", ("stiffness_ratio",))).candidates[0]
    friction = of(("ground-friction", ("coefficient",))).candidates[0]  # what the scenario has is not said
    fitted = Fitted(candidates=(layer, friction, layer), x=(0.5, 0.5, 0.5), blocks=())
    found = [{"stiffness_ratio": within(1.95, 2.05)}, {"coefficient": within(1.95, 2.05)}]
    found.append({"stiffness_ratio": within(1.8, 2.2)})
    monkeypatch.setattr(
        ensemble_validation, "intervals", lambda _, f, sides: found if f is fitted and sides == {} else None
    )
    assert ensemble_validation.significant_by_wald(Problem([]), fitted) == {0}


def within(low: float, high: float) -> Interval:
    return Interval(value=0.5 * (low + high), low=low, high=high, unit="1")
