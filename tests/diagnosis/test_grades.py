"""How much an explanation explains, and the answer that follows; what holds of every diagnosis."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.grades import answer_of, graded, is_load, jackknifed
from rollover.diagnosis.invariants import at_bounds, checked, is_noise_alone
from rollover.diagnosis.result import Diagnosis, Interval, Location, Named, Score, Share
from rollover.diagnosis.selection.candidates import candidates_of, size_of
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario
from tests.physics.scenes import shipped
from tests.rollover.diagnosed import nothing_found


def effect(id: str = "soil-viscous-damping", name: str = "damping", **given: Any) -> Named:
    numbers = {"value": 900.0, "low": 800.0, "high": 1000.0, "unit": "N s/m", "at_bound": False}
    own = {k: given.pop(k) for k in tuple(given) if k in numbers}
    kept: dict[str, Any] = {"kind": "physics", "channel": None, "moves": 0.2, "indistinguishable_from": ()} | given
    return Named(
        id=id, statement="A resistance.", parameters={name: Interval(**{**numbers, **own})}, settings={name: 900.0},
        p_value=1e-9, discriminating_test="", **kept,
    )  # fmt: skip


def share(value: float) -> Share:
    return Share(share=value, low=value - 0.05, high=min(value + 0.05, 1.0))


def test_a_share_is_of_all_recordings_its_interval_jackknifed() -> None:
    before = np.array([10.0, 20.0, 30.0, 40.0])
    even = jackknifed(0.8 * before, before, [[0], [1], [2], [3]])
    assert (even.share, even.low, even.high) == pytest.approx((0.8, 0.8, 0.8))
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(300):
        due = rng.uniform(20.0, 40.0, 6)
        found = jackknifed(due * rng.normal(0.7, 0.1, 6), due, [[k] for k in range(6)])
        covered += found.low <= 0.7 <= found.high
    assert 0.90 < covered / 300 < 0.99
    # a channel that one drop alone drives to its end: it says nothing for or against what the others leave
    one = jackknifed(
        np.array([80.0, 0.0, 0.2, -0.3, 0.0]), np.array([100.0, 1.0, 0.8, 1.2, 1.0]), [[k] for k in range(5)]
    )
    assert one.share == pytest.approx(79.9 / 104.0)
    assert one.low > 0.6
    some = jackknifed(np.array([80.0, 0.0, 0.0, 0.0]), np.array([100.0, 40.0, 50.0, 30.0]), [[k] for k in range(4)])
    assert some.low < 0.0  # of large parts that it predicts nothing of
    alone = jackknifed(np.array([3.0]), np.array([4.0]), [[0]])
    assert (alone.share, alone.low) == (0.75, -np.inf)  # of one recording nothing is told


@pytest.mark.parametrize(
    ("effects", "whole", "is_beside", "remains", "answer"),
    [
        ([effect()], share(0.99), False, False, "whole"),
        ([effect()], share(1.0), True, False, "likeness"),  # noise alone refutes it: its form is not quite that
        ([effect()], share(0.9), True, False, "likeness"),  # a brake as a layer: its form is another
        ([effect()], share(0.3), False, False, "whole"),  # of a faint one noise decides how much it seems to explain
        ([effect(indistinguishable_from=("soil-inertial-drag",))], share(0.99), False, False, "likeness"),
        ([effect()], share(0.8), False, True, "part"),
        ([effect()], share(0.4), False, True, "unexplained"),
        ([effect(moves=0.004)], share(0.99), False, False, "immaterial"),
        ([effect(moves=0.004), effect("mass", "added")], share(0.99), False, False, "whole"),
        ([effect("sensor-bias", "bias", kind="sensor", channel=FORCE, moves=None)], share(0.99), False, False, "whole"),
    ],
)
def test_the_answer_says_how_much_of_it_is_explained(
    effects: list[Named], whole: Share, is_beside: bool, remains: bool, answer: str
) -> None:
    found, told = graded(effects, whole, is_beside=is_beside, remains=remains)
    assert found == answer
    assert told[0].answer in (answer, "immaterial")
    assert [e.id for e in told] == [e.id for e in effects]


def test_a_negligible_effect_is_no_mismatch_but_reported() -> None:
    told = {"slight": False, "is_beside": False}
    assert answer_of("no-mismatch", "immaterial", 1e-9, slight=True, is_beside=False) == "immaterial"
    assert answer_of("no-mismatch", "whole", 1e-9, **told) == "immaterial"  # sure, and too small for a word
    assert answer_of("no-mismatch", "whole", 1e-9, slight=False, is_beside=True) == "nothing"  # as models usually miss
    assert answer_of("no-mismatch", "whole", 0.3, **told) == "nothing"
    assert answer_of("unexplained", "whole", 1e-9, **told) == "unexplained"
    assert answer_of("missing-physics", "part", 1e-9, **told) == "part"


def test_loads_are_forces_moments_and_what_tells_them() -> None:
    assert [c for c in (FORCE, DEPTH, ACCELERATION, "rops/mount/a/force_x", "chassis/roll") if is_load(c)] == [
        FORCE,
        ACCELERATION,
        "rops/mount/a/force_x",
    ]


def test_a_value_at_a_bound_is_no_result_but_a_shape_may_be() -> None:
    assert at_bounds([effect(at_bound=True), effect("mass", "added")]) == {"soil-viscous-damping"}
    assert at_bounds([effect(name="exponent", at_bound=True)]) == set()
    # the least adhesion holds what moves along on the face, the largest is where the search ended
    assert at_bounds([effect("soil-adhesion", "stress", value=500.0, at_bound=True)]) == set()
    assert at_bounds([effect("soil-adhesion", "stress", value=2e5, at_bound=True)]) == {"soil-adhesion"}


@pytest.mark.parametrize(
    ("changed", "broken"),
    [
        ({}, ()),
        ({"effects": (effect(at_bound=True),)}, ("no value at a bound is a finding",)),
        ({"effects": (effect(low=-1.0),)}, ("no interval of a finding holds its null",)),
        ({"effects": ()}, ("verdict and effects agree",)),
        ({"effects": (effect(moves=0.001),)}, ("no effect of consequence to no load leads to a verdict",)),
        (
            {"after": {"held_out": Score(nrmse=3.1, iso18571=None, peak_force_error=None)}},
            ("held-out recordings are predicted no worse than without",),
        ),
    ],
)
def test_what_breaks_an_invariant_is_said_by_name(changed: dict[str, Any], broken: tuple[str, ...]) -> None:
    scores: dict[str, Any] = {
        "before": {"held_out": Score(nrmse=3.0, iso18571=None, peak_force_error=None)},
        "after": {"held_out": Score(nrmse=1.0, iso18571=None, peak_force_error=None)},
    }
    sound: Diagnosis = replace(nothing_found(), verdict="missing-physics", effects=(effect(),), **scores)
    found = checked(replace(sound, **changed))
    assert found.broken == broken
    assert set(broken) <= set(found.checked)


def test_unexplained_is_more_than_noise_or_shown_by_recordings() -> None:
    place = Location(
        recording="a", channel=FORCE, phase="all", start=0.0, end=0.3, share=1.0, depends_on="coarse steps"
    )
    for nrmse, by_itself, holds in ((1.0, False, False), (1.0, True, True), (1.3, False, True)):
        score = Score(nrmse=nrmse, iso18571=None, peak_force_error=None)
        found = replace(nothing_found(), verdict="unexplained", where=(place,), before={"held_out": score})
        assert (checked(replace(found, by_itself=by_itself)).broken == ()) is holds


def test_the_smallest_that_would_have_shown_is_never_nothing() -> None:
    found = checked(replace(nothing_found(), smallest_detectable={"mass": 0.0, "impact-speed": 0.01, "x": np.inf}))
    assert dict(found.smallest_detectable) == {"impact-speed": 0.01}
    assert found.broken == ()


def test_no_layer_is_sought_in_water_and_one_is_in_clay() -> None:
    for name, there in (("cone_drop", False), ("drop_test", True)):
        no_jacobian = scenario() if there else shipped(name)
        ((_, r),) = recorded({}, 1, speeds=(2.0,))
        r = r if there else SimpleNamespace(**vars(r))  # type: ignore[assignment]
        dataset = []
        if there:
            one = dataset_of("r", r, simulator_of(no_jacobian, r))
            assert one is not None
            dataset = [one]
        ids = {c.id for c in candidates_of(dataset, (), "drop", no_jacobian, size_of(no_jacobian))}
        assert ({"soil-layer", "soil-crust", "soil-rate-hardening", "soil-adhesion"} <= ids) is there
        assert {"soil-inertial-drag", "soil-added-mass-growth", "structural-compliance"} <= ids


@pytest.mark.parametrize(
    ("total", "end", "is_noise"),
    [
        (1.04, 0.5, True),  # what a sentence would give as 1.0
        (1.1, 0.5, False),
        (1.1, -0.01, True),  # a slow part of the noise, before anything is hit
        (5.0, -0.01, False),  # air that brakes a ball as it falls
    ],
)
def test_near_noise_is_no_mismatch_and_a_braked_fall_is_one(total: float, end: float, is_noise: bool) -> None:
    block = SimpleNamespace(size=100.0, normal=lambda: (np.zeros((0, 0)), np.zeros(0), 100.0 * total**2))
    base = Fitted(candidates=(), x=(), blocks=(block,))  # type: ignore[arg-type]
    before = SimpleNamespace(cells=[SimpleNamespace(recording=0, end=end)], adjusted=[1e-9])
    problem: Any = SimpleNamespace(dataset=[SimpleNamespace(simulator=SimpleNamespace(contact=0.0))])
    found: Any = SimpleNamespace(base=base, before=before)
    assert is_noise_alone(problem, found, []) is is_noise
