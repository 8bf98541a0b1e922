"""Fits followed to their end: rivals begun anew beside them, and what has fewer numbers where one tells nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import Task
from rollover.diagnosis.selection import simplification
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search

FIRST = "soil-viscous-damping"


def fitted(last: str, left: float, x: tuple[float, ...]) -> Fitted:
    """A fit of a first effect and a last one, which has all numbers but one."""
    own = {name: Search(0, 1) for name in "abc"[: len(x) - 1]}
    first = Candidate(id=FIRST, kind="physics", family="", search={"a": Search(0, 1)})
    candidates = (first, Candidate(id=last, kind="physics", family="", search=own))
    zero = np.zeros(4)
    block = ResidualBlock(
        residual=zero + np.sqrt(left / 4.0), J=np.zeros((4, len(x))), slope=zero, shift=0.0, prior=1.0
    )
    return Fitted(candidates=candidates, x=x, blocks=(block,))


def step(best: Fitted, *rivals: Fitted) -> Step:
    """A step to the best from a base that leaves 400."""
    base = fitted("mass", 400.0, (0.2, 0.3))
    base = Fitted(candidates=base.candidates[:1], x=(0.2,), blocks=base.blocks)
    return Step(base=base, fitted=best, p_value=0.0, rivals=(best, *rivals))


def test_rivals_restart_beside_where_the_best_fit_ended() -> None:
    """A threshold that was followed beside the best alone leaves its rivals where they were."""
    asked: list[tuple[str, tuple[float, ...]]] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend((task.candidates[-1].id, task.start) for task in tasks)
        return [fitted(task.candidates[-1].id, 4.0, task.start) for task in tasks]

    best, rival = fitted("mass", 1.0, (0.7, 0.3)), fitted("guide-friction", 9.0, (0.2, 0.4))
    after = simplification._with_rivals(cast(Inquiry, SimpleNamespace(fits=fits)), step(best, rival))
    assert asked == [("guide-friction", (0.7, 0.4))]
    assert [f.chi2 for f in after.rivals] == [1.0, 4.0]


def test_rivals_restart_beside_the_best_models_variant() -> None:
    """A damping that stood in two numbers beside its rivals was straightened beside the best."""
    asked: list[tuple[int, tuple[float, ...]]] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend((sum(len(c.search) for c in task.candidates), task.start) for task in tasks)
        return [fitted(task.candidates[-1].id, 4.0, task.start) for task in tasks]

    best, rival = fitted("soil-layer", 1.0, (0.7, 0.0, 0.3)), fitted("guide-friction", 9.0, (0.2, 0.4))
    curved = replace(rival.candidates[0], search={"a": Search(0, 1), "b": Search(0, 1)})
    stood = replace(rival, candidates=(curved, rival.candidates[1]), x=(0.2, 0.5, 0.4))
    found = step(best, stood)
    found = replace(found, base=replace(found.base, candidates=(curved,), x=(0.2, 0.5)))
    there = cast(Inquiry, SimpleNamespace(fits=fits, candidates=[]))
    simplification._with_rivals(there, found)
    simplification.simpler(there, found)
    assert asked == [(2, (0.7, 0.4)), (2, (0.7, 0.4))]


@pytest.mark.parametrize(
    ("depth", "leaves", "taken"), [(0.0, 5.0, True), (0.0, 12.0, True), (0.0, 20.0, False), (0.5, 5.0, False)]
)
def test_a_layer_from_the_surface_on_is_a_stiffness(depth: float, leaves: float, taken: bool) -> None:
    """At an end of its range a number tells nothing; what has none is begun beside what stands beside the layer."""
    asked: list[tuple[float, ...]] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend(task.start for task in tasks)
        return [fitted(task.candidates[-1].id, leaves, task.start) for task in tasks]

    layer, stuck = fitted("soil-layer", 4.0, (0.7, depth, 0.3)), fitted("soil-stiffness", 90.0, (0.2, 0.4))
    as_many, far = fitted("soil-crust", 50.0, (0.2, 0.4, 0.4)), fitted("mass", 500.0, (0.2, 0.4))
    found = step(layer, as_many, stuck, far)
    after = simplification.simpler(cast(Inquiry, SimpleNamespace(fits=fits, candidates=[])), found)
    assert asked == ([(0.7, 0.4)] if depth == 0.0 else [])
    assert (after is not None) == taken
    if after is not None:
        assert after.fitted.candidates[-1].id == "soil-stiffness"
        assert [f.candidates[-1].id for f in after.rivals] == ["soil-stiffness", "soil-crust", "mass"]


@pytest.mark.parametrize(("leaves", "taken"), [(12.0, True), (20.0, False)])
@pytest.mark.parametrize("is_held", [False, True])
def test_a_layer_is_tried_as_the_stiffness_that_it_becomes(leaves: float, taken: bool, is_held: bool) -> None:
    """A ratio of 0.5 + 0.2 (2 - 0.5) = 0.8 is a scale of 0.8, at 0.4 from 0 to 2, unless that is held beside it."""
    asked: list[tuple[float, ...]] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend(task.start for task in tasks)
        return [replace(best, candidates=task.candidates, x=task.start, blocks=(left(leaves, 2),)) for task in tasks]

    def left(much: float, p: int) -> ResidualBlock:
        zero = np.zeros(4)
        return ResidualBlock(residual=zero + np.sqrt(much / 4.0), J=np.zeros((4, p)), slope=zero, shift=0.0, prior=1.0)

    search = {"depth": Search(0, 0.4), "stiffness_ratio": Search(0.5, 2)}
    layer = Candidate(id="soil-layer", kind="physics", family="", search=search)
    stiff = Candidate(id="soil-stiffness", kind="parameter", family="", search={"scale": Search(0, 2)})
    mass = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-1, 1)})
    first = stiff if is_held else mass
    best = Fitted(candidates=(first, layer), x=(0.7, 0.5, 0.2), blocks=(left(4.0, 3),))
    inquiry = cast(Inquiry, SimpleNamespace(fits=fits, candidates=[layer, stiff, mass]))
    after = simplification.simpler(inquiry, step(best))
    assert asked == ([] if is_held else [pytest.approx((0.7, 0.4), rel=1e-12)])  # rounding
    assert (after is not None) == (taken and not is_held)
    if after is not None:
        assert after.fitted.candidates == (mass, stiff)


@pytest.mark.parametrize(("leaves", "straight"), [(9.0, ("first", "last")), (30.0, ("last",)), (99.0, ())])
def test_a_variant_that_did_anothers_work_is_usual_beside_it(leaves: float, straight: tuple[str, ...]) -> None:
    """A layer's width and a rate's reference speed, the one of which is needed where both at once leave far more."""
    layer = Candidate(id="soil-layer", kind="physics", family="", search={"depth": Search(0, 0.4)})
    rate = Candidate(id="soil-rate-hardening", kind="physics", family="", search={"per_decade": Search(0, 0.2)})
    wide = replace(layer, search={**layer.search, "width": Search(0, 0.1)})
    other = replace(rate, search={**rate.search, "reference_speed": Search(0, 1)})
    names = {("soil-layer", 1): "first", ("soil-rate-hardening", 1): "last"}

    def made(candidates: tuple[Candidate, ...], x: tuple[float, ...]) -> Fitted:
        unbent = tuple(n for c in candidates if (n := names.get((c.id, len(c.search)))))
        left = {(): 4.0, ("first",): 90.0, ("last",): 6.0, ("first", "last"): leaves}[unbent]
        left = 99.0 if leaves == 99.0 and unbent else left
        zero = np.zeros(4)
        block = ResidualBlock(
            residual=zero + np.sqrt(left / 4.0), J=np.zeros((4, len(x))), slope=zero, shift=0.0, prior=1.0
        )
        return Fitted(candidates=candidates, x=x, blocks=(block,))

    begun: list[tuple[float, ...]] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        begun.extend(task.start for task in tasks)
        return [made(task.candidates, task.start) for task in tasks]

    best = made((wide, other), (0.25, 0.6, 0.5, 0.7))
    found = replace(step(best), rivals=(best,))
    after = simplification._with_usual_secondary(
        cast(Inquiry, SimpleNamespace(fits=fits, candidates=[layer, rate])), found
    )
    assert begun == [(0.25, 0.5), (0.25, 0.5, 0.7), (0.25, 0.6, 0.5)]
    assert (after is None) == (not straight)
    if after is not None:
        assert tuple(n for c in after.fitted.candidates if (n := names.get((c.id, len(c.search))))) == straight


@pytest.mark.parametrize("is_a_curve", [True, False])
def test_what_draws_any_curve_is_not_followed_but_straightened(
    is_a_curve: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However well it fits it would be refused as it stands."""
    traced: list[Fitted] = []
    best = fitted("soil-layer", 4.0, (0.7, 0.3))
    problem = SimpleNamespace(effort=SimpleNamespace(is_ensemble=False), dataset=[])
    monkeypatch.setattr(simplification, "mismatch_of", lambda *_: SimpleNamespace(p_value=1e-9))
    monkeypatch.setattr(simplification, "is_over_flexible", lambda _: is_a_curve)
    monkeypatch.setattr(simplification, "with_thresholds_traced", lambda _, f: traced.append(f) or f)
    for name in ("with_time_shift_search", "polish", "ended"):
        monkeypatch.setattr(simplification, name, lambda _, f: f)
    monkeypatch.setattr(simplification, "simpler", lambda *_: None)
    straight = step(fitted("soil-stiffness", 4.0, (0.7, 0.3)))
    monkeypatch.setattr(simplification, "_with_usual_secondary", lambda *_: straight)
    found, _ = simplification.followed(
        cast(Inquiry, SimpleNamespace(problem=problem, phases=[], candidates=[])), step(best)
    )
    assert found is straight
    assert traced == ([] if is_a_curve else [best])


def test_a_damping_is_tried_as_drag_of_squared_speed() -> None:
    """1/2 C rho A v^2 = d v^2: C = 2 d/(rho A), whatever a drag that was fitted from afar came to."""
    asked: list[Task] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend(tasks)
        return [None for _ in tasks]

    damping = Candidate(
        id="soil-viscous-damping", kind="physics", family="",
        search={"damping": Search(0.0, 100.0), "exponent": Search(0.5, 2.0)},
    )  # fmt: skip
    drag = Candidate(id="soil-inertial-drag", kind="physics", family="", search={"coefficient": Search(0.0, 50.0)})
    mass = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-1, 1)})
    block = ResidualBlock(residual=np.ones(4), J=np.zeros((4, 3)), slope=np.zeros(4), shift=0.0, prior=1.0)
    best = Fitted(candidates=(mass, damping), x=(0.7, 0.22, 0.99), blocks=(block,))
    assert (
        simplification.simpler(cast(Inquiry, SimpleNamespace(fits=fits, candidates=[damping, drag])), step(best))
        is None
    )
    assert [task.candidates for task in asked] == [(mass, drag)]
    assert asked[0].start == pytest.approx((0.7, 2.0 * 22.0 / (1800.0 * 0.140 * 0.045) / 50.0), rel=1e-12)  # rounding


@pytest.mark.parametrize(("leaves", "polished", "taken"), [(7.0, 6.9, True), (7.0, 4.0, True), (20.0, 4.0, False)])
def test_two_thresholds_at_one_place_are_one_and_a_stiffness(leaves: float, polished: float, taken: bool) -> None:
    """A crust of two numbers beside a layer leaves 5; one number is saved for chi-square of 10.8, of what comes near.

    Sensors are not asked, nor what has as many numbers; the best of those that are is followed along its valley.
    """
    asked: list[Task] = []

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        asked.extend(tasks)
        return [fitted(j.candidates[-1].id, polished if j.how == "polish" else leaves, j.start) for j in tasks]

    plain = Candidate(id="soil-stiffness", kind="parameter", family="", search={"a": Search(0, 1)})
    others = [replace(plain, kind="sensor"), replace(plain, search={"a": Search(0, 1), "b": Search(0, 1)})]
    best, rival = fitted("soil-crust", 5.0, (0.7, 0.4, 0.3)), fitted("mass", 9.0, (0.7, 0.2))
    there = cast(Inquiry, SimpleNamespace(fits=fits, candidates=[plain, *others, best.candidates[0]], problem=None))
    found = simplification.with_fewer_parameters(there, step(best, rival))
    assert {j.candidates[-1].id for j in asked} == {"soil-stiffness"}
    ways = [("fit", SETTINGS.selection.forward_step.short_rounds), ("fit", None), ("polish", None)]
    assert [(j.how, j.rounds) for j in asked] == ways[: 2 + taken]
    assert asked[0].start[:-1] == (0.7,)
    assert (found is not None) is taken
    if found is not None:
        assert [f.candidates[-1].id for f in found.rivals] == ["soil-stiffness", "mass"]


@pytest.mark.parametrize(("family", "taken"), [("depth", True), ("damping", False)])
def test_either_of_two_thresholds_may_be_a_stiffness(family: str, taken: bool) -> None:
    """Beside the layer a stiffness leaves 90 where both leave 5; beside the crust it leaves 6."""
    two = {"depth": Search(0, 1), "ratio": Search(0, 1)}
    layer, crust = (
        Candidate(id=f"soil-{name}", kind="physics", family=of, search=two)
        for name, of in (("layer", "depth"), ("crust", family))
    )
    plain = Candidate(id="soil-stiffness", kind="parameter", family="", search={"scale": Search(0, 1)})

    def left(candidates: Sequence[Candidate], x: Sequence[float], squares: float) -> Fitted:
        block = fitted("mass", squares, (0.5, *x)[: len(x)]).blocks[0]
        return Fitted(candidates=tuple(candidates), x=tuple(x), blocks=(block,))

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        return [left(j.candidates, j.start, 6.0 if j.candidates[0] == crust else 90.0) for j in tasks]

    problem = SimpleNamespace(fit=lambda c, x, **_: left(c, x, 400.0), effort=SETTINGS.forward.drops)
    there = cast(Inquiry, SimpleNamespace(fits=fits, candidates=[layer, crust, plain], problem=problem))
    found = simplification.with_fewer_parameters(there, step(left((layer, crust), (0.4, 0.5, 0.3, 0.6), 5.0)))
    assert (found is not None) is taken
    if found is not None:
        assert [c.id for c in found.fitted.candidates] == ["soil-crust", "soil-stiffness"]
        assert found.fitted.x[:2] == (0.3, 0.6)
        assert found.base.label == "soil-crust"


def test_an_effect_by_itself_is_not_given_for_a_plainer_one() -> None:
    """Beside nothing all of fewer numbers were tried before it."""
    both = fitted("soil-crust", 5.0, (0.7, 0.4, 0.3))
    alone = replace(both, candidates=both.candidates[1:], x=both.x[1:])
    there = cast(Inquiry, SimpleNamespace(candidates=[both.candidates[0]], problem=None))
    assert simplification.with_fewer_parameters(there, step(alone)) is None


@pytest.mark.parametrize(("profile_extents", "known"), [(5.5, 40.0), (5.5, None), (50.0, 40.0)])
def test_what_mirrors_the_last_effect_competes_with_it(profile_extents: float, known: float | None) -> None:
    """A layer that a look beside the stiffness left at 40 leaves 5.5 where the stiffness has gone along."""
    two, stiff = (
        Search(0.01, 1, "log"),
        Candidate(id="soil-stiffness", kind="", family="", search={"scale": Search(0, 1)}),
    )
    layer, crust = (
        Candidate(
            id=f"soil-{name}", kind="physics", family="", search={at: two, "stiffness_ratio": Search(0.1, 10, "log")}
        )
        for name, at in (("layer", "depth"), ("crust", "thickness"))
    )

    def left(candidates: Sequence[Candidate], x: Sequence[float], squares: float) -> Fitted:
        return Fitted(
            candidates=tuple(candidates), x=tuple(x), blocks=fitted("mass", squares, (0.5, *x)[: len(x)]).blocks
        )

    def fits(tasks: Sequence[Task]) -> list[Fitted | None]:
        # where the layer is held, the stiffness goes along
        return [
            left(j.candidates, j.start if j.candidates[-1].id == "soil-layer" else (0.9,), profile_extents)
            for j in tasks
        ]

    best = left((stiff, crust), (0.5, 0.4, 0.75), 5.0)
    rivals = [] if known is None else [left((stiff, layer), (0.5, 0.4, 0.5), known)]
    there = cast(Inquiry, SimpleNamespace(fits=fits, free=lambda _: [layer]))
    found = simplification.with_mirror_rivals(there, step(best, *rivals))
    assert found.fitted is best
    if known is not None and profile_extents > known:
        assert [f.chi2 for f in found.rivals] == pytest.approx([5.0, known])
    else:
        assert [f.chi2 for f in found.rivals] == pytest.approx([5.0, profile_extents])
        assert found.rivals[-1].x == pytest.approx((0.9, 0.4, 0.25), rel=1e-12)  # rounding: a logarithm and back
