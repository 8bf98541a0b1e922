"""Two effects at once: in which forms they are tried two by two, and with which shapes."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.data.phases import phases_of
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate
from rollover.diagnosis.fit.step import Inquiry, Screened, Step
from rollover.diagnosis.fit.threshold_scan import has_threshold, threshold_starts
from rollover.diagnosis.selection import pairs
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from tests.diagnosis.drops import linear_blocks, recorded
from tests.diagnosis.test_fits import candidate, problem_of

RATIO = Search(0.2, 5.0, "log")
MASS = Candidate(id="mass", kind="parameter", family="", search={"added": Search(-1, 1)})
DAMPING = Candidate(id="soil-viscous-damping", kind="physics", family="", search={"damping": Search(1, 2)})
PROPORTION = replace(DAMPING, search={"proportion": Search(0, 1)}, variant={"damping": 0.0})
NOSE = Candidate(
    id="structural-compliance", kind="physics", family="",
    search={"stiffness": Search(1, 2), "damping": Search(1, 2)}, secondary={"nose_share": Search(0.1, 0.9)},
)  # fmt: skip


def fitted(candidates: tuple[Candidate, ...], times: float) -> Fitted:
    """A fit that leaves so many times what chance does."""
    blocks = tuple(
        replace(b, residual=b.residual * np.sqrt(times), J=np.zeros((40, sum(len(c.search) for c in candidates))))
        for b in linear_blocks(np.random.default_rng(4), 2, 40, np.zeros(1))
    )
    return Fitted(candidates=candidates, x=(0.5,) * blocks[0].J.shape[1], blocks=blocks)


def screened(c: Candidate) -> Screened:
    return Screened(candidate=c, starts=((0.3,),), chi2=1.0, potential=1.0)


def inquiry(asked: list[Any]) -> Inquiry:
    """Answers each job with a fit that leaves nothing but chance, and notes it."""

    def fits(tasks: list[Any]) -> list[Fitted]:
        asked.extend(tasks)
        return [fitted((*j.candidates[:-1], j.candidates[-1].whole()), 1.0) for j in tasks]

    return cast(Inquiry, SimpleNamespace(fits=fits, problem=SimpleNamespace(again=lambda f: f, dataset=()), phases=()))


def test_a_lone_variant_is_tried_in_its_usual_form_in_pairs() -> None:
    """A form may make up for the second effect: a damping in proportion to the force for a little more mass."""
    alone = fitted((PROPORTION,), 1.1)
    first = Step(
        base=fitted((), 30.0), fitted=alone, p_value=0.0, rivals=(alone, fitted((MASS,), 4.0)),
        screened=(screened(DAMPING), screened(MASS)),
    )  # fmt: skip
    scored = ScoreTest(score=9.0, scores={"mass": 9.0}, null=np.zeros(9), detectable={})
    found = pairs._partners(inquiry([]), first, (), scored, SETTINGS.selection.pairs.scored)
    assert [(c.id, c.variant, x) for c, x in found] == [
        ("soil-viscous-damping", {"damping": 0.0}, (0.5,)),
        ("mass", {}, (0.5,)),
        ("soil-viscous-damping", {}, (0.3,)),
    ]


def test_a_trailing_variant_is_tried_in_its_usual_form_too() -> None:
    """Damping with a layer is neither by itself: a layer from the top on leads, a proportional damping comes next."""
    lead, curved = fitted((MASS,), 4.0), fitted((PROPORTION,), 6.0)
    first = Step(
        base=fitted((), 30.0), fitted=lead, p_value=0.0, rivals=(lead, curved),
        screened=(screened(DAMPING), screened(MASS)),
    )  # fmt: skip
    scored = ScoreTest(score=9.0, scores={"mass": 9.0}, null=np.zeros(9), detectable={})
    found = pairs._partners(inquiry([]), first, (), scored, SETTINGS.selection.pairs.scored)
    assert [(c.id, c.variant) for c, _ in found] == [
        ("mass", {}),
        ("soil-viscous-damping", {"damping": 0.0}),
        ("soil-viscous-damping", {}),
    ]


def test_all_oscillatory_pairs_are_fitted_with_their_share() -> None:
    """With a wrong share of the nose the wrong other effect may lead, as a mass before an impact speed."""
    asked: list[Any] = []
    curved = replace(MASS, id="soil-adhesion", secondary={"reach": Search(1, 2)})
    whole = [
        fitted((NOSE, MASS), 30.0),
        fitted((DAMPING, NOSE), 20.0),
        fitted((replace(curved, id="soil-layer"), curved), 20.0),
    ]
    far = fitted((replace(MASS, id="soil-stiffness"), NOSE), 100.0)
    found = pairs._with_secondary_fitted(inquiry(asked), [*whole, far])
    assert [(j.how, [c.id for c in j.candidates]) for j in asked] == [
        ("secondary", ["mass", "structural-compliance"]),
        ("secondary", ["soil-viscous-damping", "structural-compliance"]),
    ]
    assert [sorted(f.candidates[-1].search) for f in found] == [["damping", "nose_share", "stiffness"]] * 2
    assert {len(j.leaves) for j in asked} == {2}


def test_best_pairs_are_scanned_fully_until_noise_is_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The depth of a layer is one valley of many: fitted at 0.02 m, its pair leaves more than the wrong one."""
    search = {"depth": Search(0.01, 1.0, "log"), "stiffness_ratio": Search(0.2, 5.0, "log")}
    layer = Candidate(id="soil-layer", kind="physics", family="", search=search)
    wrong, right, third = fitted((DAMPING, MASS), 20.0), fitted((layer, DAMPING), 21.0), fitted((layer, MASS), 22.0)
    far = fitted((DAMPING, layer), 50.0)
    asked: list[Any] = []
    left = {"p": 1e-9}
    monkeypatch.setattr(pairs, "mismatch_of", lambda *_: SimpleNamespace(p_value=left["p"]))
    found = pairs._traced(inquiry(asked), [third, wrong, far, right])
    assert [(j.how, [c.id for c in j.candidates], j.stretch) for j in asked] == [
        ("trace", ["soil-viscous-damping", "soil-layer"], (1, 0.0, 0.5)),
        ("trace", ["soil-viscous-damping", "soil-layer"], (1, 0.5, 1.0)),
        ("trace", ["mass", "soil-layer"], (1, 0.0, 0.5)),
        ("trace", ["mass", "soil-layer"], (1, 0.5, 1.0)),
    ]
    assert len(found) == 4
    asked.clear()
    left["p"] = 0.5
    assert pairs._traced(inquiry(asked), [third, wrong, far, right]) == []
    assert asked == []


@pytest.mark.parametrize(
    ("alone", "pair", "explains_little"),
    [
        (21.0, 19.5, True),  # 1.5 of 20 times what chance leaves
        (21.0, 18.95, False),
        (1.6, 1.59, False),  # not much is left: what takes all of it may not be met yet
    ],
)
def test_a_pair_that_gains_next_to_nothing_is_dropped(alone: float, pair: float, explains_little: bool) -> None:
    lead, both = leaving((DAMPING,), alone), leaving((DAMPING, MASS), pair)
    assert pairs._explains_little(lead, both, (0, 1)) is explains_little
    # of few recordings the pair was fitted to these alone
    assert pairs._explains_little(lead, replace(both, blocks=both.blocks[:1]), (1,)) is explains_little


def leaving(candidates: tuple[Candidate, ...], times: float) -> Fitted:
    """A fit that leaves just so many times the number of samples."""
    found = fitted(candidates, 1.0)
    blocks = tuple(replace(b, residual=np.full(40, np.sqrt(times)), shift=0.0) for b in found.blocks)
    return replace(found, blocks=blocks)


LAYER, CRUST = (
    Candidate(
        id=f"soil-{name}", kind="physics", family="", search={at: Search(0.01, 1, "log"), "stiffness_ratio": RATIO}
    )
    for name, at in (("layer", "depth"), ("crust", "thickness"))
)
VARIANT = replace(CRUST, search={**CRUST.search, "width": Search(0.001, 0.1, "log")})
OF_ITS_OWN = replace(LAYER, search={"depth": Search(0.01, 1, "log"), "stiffness": Search(1, 9)}, variant={"onset": 1.0})


@pytest.mark.parametrize(
    ("pair", "places"),
    [
        ((DAMPING, VARIANT), [("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.0})]),
        ((VARIANT, DAMPING), [("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.0})]),
        ((PROPORTION, VARIANT), [("soil-layer", {"depth": 0.1, "stiffness_ratio": 1.0})]),
        ((DAMPING, OF_ITS_OWN), []),
        ((DAMPING, MASS), []),
    ],
)
def test_what_is_stiffer_above_is_tried_as_what_is_softer_below(
    pair: tuple[Candidate, ...], places: list[tuple[str, dict[str, float]]]
) -> None:
    """The other is led there first, as it usually is; in a form that has no usual one it stays in that."""
    asked: list[Any] = []
    there = inquiry(asked)
    there = cast(
        Inquiry,
        SimpleNamespace(fits=there.fits, candidates=[DAMPING, MASS, LAYER, CRUST], free=lambda _: [LAYER, MASS]),
    )
    found = pairs._mirrored(there, fitted(pair, 4.0))
    assert [(f.candidates[-1].id, dict(f.candidates[-1].values(f.own))) for f in found] == [
        (id, pytest.approx(values)) for id, values in places
    ]
    assert [(len(j.candidates[0].search), j.candidates[0].fixed.keys()) for j in asked[: len(places)]] == [
        (0, {"depth", "stiffness_ratio"})
    ] * len(places)
    assert [j.candidates[0] for j in asked[len(places) :]] == [c for c in pair if c is not VARIANT][: len(places)]


RATE, DEPTH = 0.05, 0.13  # per decade, m


def layered(ratio: float, depth: float = DEPTH) -> Problem:
    """Ground that hardens by its rate and is so many times as stiff below a depth, met three times."""
    hidden = {
        "effects.soil-rate-hardening.per_decade": RATE,
        "effects.soil-layer.depth": depth,
        "effects.soil-layer.stiffness_ratio": ratio,
    }
    return problem_of(recorded(hidden, 3, speeds=(1.4, 1.9, 2.6), noise=0.003, rate=1000.0))


@pytest.mark.parametrize(("ratio", "lost"), [(0.7, 500.0), (1.3, 0.0)])
def test_a_threshold_starts_where_it_helps_beside_the_other(ratio: float, lost: float) -> None:
    """Alone a softer layer ends elsewhere than under ground that hardens: from there a fit of both leads nowhere."""
    problem = layered(ratio)
    rate, layer = candidate(problem, "soil-rate-hardening"), candidate(problem, "soil-layer")
    shifts, few = [0.0] * 3, [0, 1, 2]
    hardening = problem.fit((rate,), (0.6,), shifts=shifts, fixed_shifts=True)
    alone = problem.fit((layer,), (0.3, 0.5), shifts=shifts, fixed_shifts=True)
    assert hardening is not None
    assert alone is not None
    begun = threshold_starts(problem, (rate, hardening.x, layer), few=few, shifts=shifts)
    assert begun is not None
    assert begun[:1] == hardening.x
    assert begun[1] == pytest.approx(coordinate(DEPTH, layer.search["depth"]), abs=0.1)
    led = [problem.fit((rate, layer), x, shifts=shifts) for x in (begun, (*hardening.x, *alone.x))]
    assert led[0] is not None
    assert led[1] is not None
    count = sum(b.residual.size for b in led[0].blocks)
    assert led[0].chi2 < 1.1 * count
    assert led[1].chi2 > lost * count


def test_the_scan_point_of_least_misfit_beside_it_is_taken() -> None:
    """Two more are reached by the fastest drop, and leave more."""
    shallow = 0.07
    problem = layered(0.7, shallow)
    rate, layer = candidate(problem, "soil-rate-hardening"), candidate(problem, "soil-layer")
    begun = threshold_starts(problem, (rate, (0.1,), layer), few=[0, 1, 2], shifts=[0.0] * 3)
    assert begun is not None
    assert begun[1] == pytest.approx(coordinate(shallow, layer.search["depth"]), abs=0.1)


def test_what_sets_in_somewhere_says_how_strong_it_is_and_where() -> None:
    problem = layered(1.3)
    able = ("soil-layer", "soil-crust")
    others = ("soil-rate-hardening", "structural-compliance", "mass")
    assert [has_threshold(candidate(problem, i)) for i in (*able, *others)] == [True, True, False, False, False]


def test_leaders_and_thresholds_are_scanned_in_pairs(monkeypatch: pytest.MonkeyPatch) -> None:
    search = {"depth": Search(0.01, 1.0, "log"), "stiffness_ratio": Search(0.2, 5.0, "log")}
    layer = Candidate(id="soil-layer", kind="physics", family="", search=search)
    curved = replace(layer, id="soil-crust", variant={"a": 1.0})
    partners = [(MASS, (0.1,)), (DAMPING, (0.2,)), (layer, (0.3, 0.4)), (curved, (0.5, 0.6)), (PROPORTION, (0.7,))]
    tried: list[Any] = []

    def parallel_map(scan: Any, ways: list[Any]) -> list[Any]:
        tried.append((scan.keywords, [(a.id, x, c.id) for a, x, c in ways]))
        return [None, *((*x, 0.8, 0.9) for _, x, _ in ways[1:])]

    asking = cast(Inquiry, SimpleNamespace(parallel_map=parallel_map))
    found = pairs._with_thresholds_scanned(asking, partners, [0, 2], [1e-3, 0.0, 0.0])
    ways = [
        ("mass", (0.1,), "soil-layer"),
        ("soil-viscous-damping", (0.2,), "soil-layer"),
        ("soil-crust", (0.5, 0.6), "soil-layer"),
    ]
    assert tried == [({"few": (0, 2), "shifts": (1e-3, 0.0, 0.0), "base": ((), ())}, ways)]
    assert [([c.id for c in both], x) for both, x in found] == [
        (["soil-viscous-damping", "soil-layer"], (0.2, 0.8, 0.9)),
        (["soil-crust", "soil-layer"], (0.5, 0.6, 0.8, 0.9)),
    ]


def test_a_pair_of_which_one_is_placed_beside_the_other() -> None:
    """The hardening does not lead and the layer ended elsewhere alone: together they are all there is."""
    problem = layered(0.7)
    rate, layer, stiffer = (candidate(problem, i) for i in ("soil-rate-hardening", "soil-layer", "soil-stiffness"))
    base = problem.fit((), ())
    assert base is not None
    alone = [problem.fit((c,), x, shifts=[0.0] * 3) for c, x in ((stiffer, (0.5,)), (rate, (0.6,)))]
    led = [f for f in alone if f is not None]
    lost = Screened(candidate=layer, starts=((0.05, 0.9),), chi2=9.0, potential=0.0)
    first = Step(base=base, fitted=led[0], p_value=0.0, rivals=tuple(led), screened=(lost,))
    scored = ScoreTest(score=9.0, scores={"soil-layer": 9.0}, null=np.zeros(9), detectable={})
    asking = Inquiry(
        problem=problem, candidates=[rate, layer, stiffer], groups=[], phases=[phases_of(e) for e in problem.dataset],
        say=lambda _: None, executor=Executor(),
    )  # fmt: skip
    best = pairs.best_pair(asking, [first], scored)
    assert best is not None
    assert best.fitted.label == "soil-rate-hardening + soil-layer"
    assert best.fitted.chi2 < 1.1 * sum(b.residual.size for b in best.fitted.blocks)
    assert layer.values(best.fitted.own)["depth"] == pytest.approx(DEPTH, rel=0.05)


GRADUAL = (
    Candidate(id="soil-layer", kind="physics", family="", search={"depth": Search(0, 1)}, variant={"onset": 1.0}),
    Candidate(id="soil-crust", kind="physics", family="", search={"thickness": Search(0, 1)}, variant={"onset": 1.0}),
)


@pytest.mark.parametrize(
    ("other", "current", "p_value", "better"),
    [
        (3.0, (6.0, (MASS, DAMPING)), 0.0, True),  # 2 beyond the noise for 5
        (4.0, (6.0, (MASS, DAMPING)), 0.0, False),  # 3 for 5, though two thirds of all
        (1.4, (2.5, (MASS, DAMPING)), 0.0, True),  # 0.4 for 1.5
        (5.5, (6.0, (MASS, DAMPING)), 0.5, True),  # no more than chance
        (6.5, (6.0, (MASS, DAMPING)), 0.5, False),
        (10.0, (6.0, GRADUAL), 0.0, True),  # any curve will be refused
        (12.0, (6.0, GRADUAL), 0.0, False),
    ],
)
def test_far_less_is_far_less_beyond_the_noise(
    other: float, current: tuple[float, tuple[Candidate, ...]], p_value: float, better: bool
) -> None:
    left = cast(Any, SimpleNamespace(p_value=p_value))
    new, held = fitted((MASS, DAMPING), other), fitted(current[1], current[0])
    assert pairs.is_better(new, left, held) == better
    runs = other < current[0] if p_value > 0.001 else other < 0.5 * current[0]
    assert pairs.is_better(new, left, held, scattered=True) == runs, "nobody knows what chance leaves of full runs"


@pytest.mark.parametrize(("left", "taken"), [(1.2, True), (1.5, False)])
def test_three_become_two_only_where_the_third_is_not_retained(
    left: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Weighed as noise by all that a pair leaves, what the third effect takes would be noise: it takes 40 of 80."""
    found = Step(base=fitted((), 30.0), fitted=fitted((MASS,), left), p_value=0.0)
    monkeypatch.setattr(pairs, "best_pair", lambda *_: found)
    monkeypatch.setattr(pairs, "followed", lambda _, one: (one, SimpleNamespace(p_value=1e-6)))
    monkeypatch.setattr(pairs, "is_enough", lambda *_: False)
    monkeypatch.setattr(pairs, "with_noise_of_fit", lambda *_: True)
    monkeypatch.setattr(pairs, "mismatch_of", lambda *_: SimpleNamespace(p_value=0.4))
    both = pairs.best_subsets(inquiry([]), [found], cast(ScoreTest, None), fitted((MASS,), 1.0), is_whole=True)
    assert (both is not None) == taken


@pytest.mark.parametrize(
    ("p_value", "is_noise", "is_whole", "told"),
    [
        (1e-6, True, False, 0.4),
        (1e-6, False, False, None),  # it leaves structure, and hardly less than there is
        (0.4, True, False, 0.4),
        (0.4, True, True, 0.4),  # three that are all there is are given for two
        (1e-6, False, True, None),
    ],
)
def test_a_pair_that_leaves_nearly_noise_tells_of_it(
    p_value: float, is_noise: bool, is_whole: bool, told: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Quiet stretches alone tell of a noise that is a little too small: two that are all there is left structure."""
    found = Step(base=fitted((), 30.0), fitted=fitted((MASS,), 2.0), p_value=0.0)
    reweighted: list[Any] = []

    def with_noise_model(_problem: Any, fit: Fitted, _phases: Any) -> bool:
        reweighted.append(fit)
        return is_noise

    monkeypatch.setattr(pairs, "best_pair", lambda *_: found)
    monkeypatch.setattr(pairs, "followed", lambda _, one: (one, SimpleNamespace(p_value=p_value)))
    monkeypatch.setattr(pairs, "is_enough", lambda _problem, _fit, left: left.p_value > 0.001)
    monkeypatch.setattr(pairs, "with_noise_of_fit", with_noise_model)
    monkeypatch.setattr(pairs, "mismatch_of", lambda *_: SimpleNamespace(p_value=0.4))
    asking = inquiry([])
    asking.problem.dataset, asking.problem.with_noise_model = ("quiet",), reweighted.append  # type: ignore[assignment,method-assign]
    both = pairs.best_subsets(
        asking, [found], cast(ScoreTest, None), fitted((MASS,), 1.8 if is_whole else 2.5), is_whole=is_whole
    )
    assert (None if both is None else both[1].p_value) == told
    tried = [] if p_value > 0.001 else [found.fitted]
    assert reweighted == [*tried, *([("quiet",)] if both is None else [])], (
        "the noise is as it was if they are not taken"
    )
