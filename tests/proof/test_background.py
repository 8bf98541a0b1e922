"""A background: as large as it says, nothing before contact, in balance with the motion, and never twice the same."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from rollover.proof import campaign
from rollover.proof.background import Background, background, drawn_share, unsized
from rollover.proof.campaign import ACCELERATION, DEPTH, FORCE, PLACE, SPEED
from rollover.proof.generator import Case, Order, extent, make, plan
from rollover.proof.readings import measured, rig_of, span
from rollover.proof.reference_solver import CHANNELS, LOADING, Descent, descend
from rollover.proof.rig import Rig, loading_curve
from tests.benchmarks import background as bench
from tests.proof.test_score import effect, said, truth

SPEEDS = (1.4, 2.0, 2.7, 3.3)
RIGS = [Rig(speed=v) for v in SPEEDS]


@pytest.fixture(scope="module")
def plain() -> list[Descent]:
    return [descend(rig, -0.06, 0.6) for rig in RIGS]


def one(plain: list[Descent], seed: int = 3, share: float = 0.03) -> Background:
    return background(seed, 0, share, RIGS, plain)


@pytest.mark.parametrize(("seed", "share"), [(1, 0.01), (2, 0.03), (3, 0.10), (4, 0.03)])
def test_the_force_is_off_by_the_share_that_is_stated(plain: list[Descent], seed: int, share: float) -> None:
    """Root mean square up to the first of the two deepest points, over the range of the force: by another grid."""
    found = one(plain, seed, share)
    squares, count = 0.0, 0
    for i, (rig, drop) in enumerate(zip(RIGS, plain, strict=True)):
        with_it = descend(found.about(rig, i), -0.06, 0.6)
        t = np.linspace(0.0, min(drop.deepest()[0], with_it.deepest()[0]), 313)
        read = with_it.channels(t)[FORCE] * (1.0 + found.frame(t, FORCE))
        squares += float(np.mean((read - drop.channels(t)[FORCE]) ** 2))
        count += 1
    span_of_force = max(float(d.channels([d.deepest()[0] - 1e-9])[FORCE][0]) for d in plain)
    assert np.sqrt(squares / count) / span_of_force == pytest.approx(share, rel=0.06)


def test_nothing_is_off_before_contact_and_all_channels_after(plain: list[Descent]) -> None:
    found = one(plain)
    before, after = np.linspace(-0.05, -1e-6, 60), np.linspace(0.02, 0.1, 60)
    for i, (rig, drop) in enumerate(zip(RIGS, plain, strict=True)):
        with_it = descend(found.about(rig, i), -0.06, 0.6)
        for channel in CHANNELS:
            np.testing.assert_array_equal(with_it.channels(before)[channel], drop.channels(before)[channel])
            assert np.max(np.abs(with_it.channels(after)[channel] - drop.channels(after)[channel])) > 0.0
        for channel in (FORCE, ACCELERATION):
            np.testing.assert_array_equal(found.frame(before, channel), np.zeros(60))
        for channel in (DEPTH, PLACE, SPEED):
            np.testing.assert_array_equal(found.frame(after, channel), np.zeros(60))


def test_force_and_motion_are_one(plain: list[Descent]) -> None:
    """(M + m_b1) a = m g - F (1 + b(t)), with accelerations as second differences of the position."""
    found = one(plain, share=0.08)
    h = 2e-5
    for i, rig in enumerate(RIGS):
        shaken = found.about(rig, i)
        assert shaken.background is not None
        drop, curve = descend(shaken, -0.06, 0.6), loading_curve(rig, rig.speed)
        stage = max((s for s in drop.stages if s.mode == LOADING), key=lambda s: s.end - s.start)
        for t in np.linspace(stage.start + 1e-3, stage.end - 1e-3, 20).tolist():
            z = -drop.channels(t + h * np.arange(-1.0, 2.0))[PLACE]
            a = (z[2] - 2.0 * z[1] + z[0]) / h**2
            presses = curve(0.0, z[1], 0.0) * (1.0 + shaken.background(t))
            assert 1.1 * 132.0 * a == pytest.approx(132.0 * 9.81 - presses, abs=4.0)
        rest = descend(shaken, -0.06, 1.2).channels([1.19])
        assert rest[FORCE][0] == pytest.approx(132.0 * 9.81, rel=1e-3), "at rest the ground bears the weight"


def test_it_is_smooth_and_no_stiffness(plain: list[Descent]) -> None:
    for seed in range(20):
        found = unsized(seed, 0, plain)
        for course in found.courses:
            x = np.linspace(0.0, 1.0, 2001)
            values = np.array([course(at) for at in x])
            assert abs(values.mean()) < 0.01
            # no faster than a bump of 0.08 of the way: what changes within a hundredth of it is little
            assert np.max(np.abs(values[20:] - values[:-20])) < 0.75


def test_drops_share_a_part_of_it(plain: list[Descent]) -> None:
    x = np.linspace(0.0, 1.0, 300)
    alike = []
    for seed in range(30):
        found = unsized(seed, 0, plain)
        a, b = (np.array([course(at) for at in x]) for course in found.courses[:2])
        alike.append((float(np.corrcoef(a, b)[0, 1]), found.common))
        assert 0.3 <= found.common <= 0.7
    assert np.mean([r for r, _ in alike]) == pytest.approx(np.mean([c for _, c in alike]), abs=0.15)


def test_the_truth_states_it_and_a_seed_repeats_it() -> None:
    order = Order(index=2, seed=31, kind="background", background=0.04)
    case = make(order)
    sealed = case.truth["background"]
    assert (case.truth["kind"], case.truth["verdict"], case.truth["effects"]) == ("background", "no-mismatch", [])
    assert sealed["share"] == 0.04
    assert sealed["channels"][FORCE]["rms"] == pytest.approx(0.04, rel=0.15)
    assert json.dumps(case.truth) == json.dumps(make(order).truth)
    for two, again in zip(case.recordings, make(order).recordings, strict=True):
        np.testing.assert_array_equal(two[FORCE], again[FORCE])
    other = make(replace(order, seed=32)).truth["background"]
    assert other["frame"] != sealed["frame"]


def test_a_case_with_a_background_is_that_case_and_a_background() -> None:
    """The same drops, the same effect, of which the truth says how it stands against the background."""
    order = Order(index=1, seed=12, kind="foreign-form", ids=("soil-crust",))
    bare, shaken = make(order), make(replace(order, background=0.03))
    (a,), (b,) = bare.truth["effects"], shaken.truth["effects"]
    assert (a["form"], a["parameters"]) == (b["form"], b["parameters"])
    assert "over_background" not in a
    assert b["over_background"] > 0.0
    assert bare.truth["recordings"] == shaken.truth["recordings"]
    held = campaign.draw(np.random.default_rng(4))
    rigs = [rig_of(held, shot, ()) for shot in held.shots]
    plain = [descend(rig, *span(shot)) for rig, shot in zip(rigs, held.shots, strict=True)]
    around = background(4, 0, 0.05, rigs, plain)
    off = [
        (two.values[FORCE] - one.values[FORCE])[one.times < shot.late - 2e-2]
        for one, two, shot in zip(measured(held, (), plain), measured(held, (), None, around), held.shots, strict=True)
    ]
    assert np.nanmax(np.abs(np.concatenate(off))) < 1e-9


def test_every_case_has_one_where_one_is_asked_for() -> None:
    for kinds in (["background"], ["background", "foreign-form"], ["null", "background", "outside"]):
        orders = plan(30, 9, kinds)
        assert all(0.01 <= o.background <= 0.10 for o in orders)
        assert {o.kind for o in orders} == set(kinds)
        assert len({o.background for o in orders}) == 30
    assert {o.background for o in plan(12, 9, ["foreign-form"], background=0.03)} == {0.03}
    assert {o.background for o in plan(12, 9, ["foreign-form"])} == {0.0}
    shares = [drawn_share(9, i) for i in range(400)]
    assert np.median(shares) == pytest.approx(np.sqrt(0.01 * 0.10), rel=0.15)
    for wrong in (0.5, 0.0, float("nan"), "much"):
        with pytest.raises(
            ValueError, match=r"no share of the force's range, got .*; drawn and 0.001 to 0.3 are allowed"
        ):
            plan(3, 1, background=wrong)


@pytest.mark.parametrize(("kind", "called"), [("null", "background"), ("unlisted", "outside")])
def test_a_benchmark_is_of_six_drops_known_before_they_are_made(kind: str, called: str) -> None:
    (case,) = bench.cases(1, 5, kind, 0.03, own=False, most=12000)
    assert case.truth["kind"] == called
    assert case.truth["background"]["share"] == 0.03
    assert len(case.recordings) == bench.DROPS
    samples = sum(np.isfinite(r[c]).sum() for r in case.recordings for c in r.channels)
    *before, own = plan(bench.PLANNED, 5, [called], (), 0.03)[: case.truth["index"] + 1]
    assert extent(own) == (6, pytest.approx(samples, rel=0.02))
    assert samples < 12000
    assert not any(drops == 6 and many < 12000 for drops, many in map(extent, before))


@pytest.mark.parametrize(
    ("id", "kind", "answer", "counted"),
    [
        ("soil-crust", "foreign-form", "likeness", {"in the set", "first"}),
        ("mass", "foreign-form", "whole", {"another name", "that called whole"}),
        ("soil-layer", "outside", "likeness", set()),  # as it is near: neither found nor wrong
        ("mass", "outside", "part", {"another name"}),
    ],
)
def test_a_benchmark_counts_names_as_they_are_right(id: str, kind: str, answer: str, counted: set[str]) -> None:
    true = effect("soil-crust" if kind != "outside" else "outside:edge", "physics" if kind != "outside" else "outside")
    case = SimpleNamespace(name="a", truth=truth(true | {"near": ["soil-layer"]}, kind=kind) | {"background": {}})
    answered = said(id) | {"answer": answer, "invariants": {"broken": []}}
    row = bench.counted(cast(Case, case), answered)
    assert {what for what in bench.COUNTED if row[what]} == counted
