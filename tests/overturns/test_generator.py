"""Concealed overturns: nothing in the folder tells the truth, the same order gives the same case."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rollover.effects import EFFECTS
from rollover.proof import runner
from rollover.proof.generator import Order
from rollover.proof.handover import write_case
from rollover.proof.overturns import foreign, generator, library
from rollover.proof.overturns.generator import CHANNELS, make, plan
from rollover.proof.overturns.outside import OUTSIDE
from rollover.scenario import Scenario, load
from tests.physics.scenes import shipped


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """As little as shows what a case is made of."""
    monkeypatch.setattr(generator, "STEP", 1e-3)
    monkeypatch.setattr(generator, "LENGTH", 0.2)
    monkeypatch.setattr(generator, "PERTURBED_RUNS", 1)


def written(order: Order, folder: Path) -> Scenario:
    write_case(make(order), folder)
    return load(folder / "scenario.yaml")


def test_a_plan_takes_every_effect_in_turn() -> None:
    orders = plan(2 * len(library.EFFECTS), 3, kinds=["single"])
    assert Counter(o.ids[0] for o in orders) == Counter(dict.fromkeys(library.EFFECTS, 2))
    assert {o.kind for o in plan(40, 3)} == set(generator.KINDS)
    assert [o.ids for o in plan(12, 3)] != [o.ids for o in plan(12, 4)]


@pytest.mark.parametrize(("kinds", "effects"), [(["decoy"], []), ([], ["soil-crust"])])
def test_what_there_are_no_overturns_of_is_refused(kinds: list[str], effects: list[str]) -> None:
    with pytest.raises(ValueError, match=r"are allowed|none of overturns"):
        plan(3, 1, kinds, effects)


def test_another_form_of_yield_is_written_into_the_mounts() -> None:
    """Forces of mounts drawn apart: hardening lifts them behind the yield, a rate too, two yields bend twice."""
    assert {o.ids for o in plan(3, 3, ["foreign-form"])} == {("rops-plasticity",)}
    with pytest.raises(ValueError, match="none of kind foreign-form, got slope"):
        plan(3, 1, ["foreign-form"], ["slope"])
    for form in foreign.FORMS["rops-plasticity"]:
        change = form(np.random.default_rng(2))
        tractor = generator._base().replaced(dict(change.values)).vehicle
        force, elastic = [], 0.0
        for u in np.linspace(0.0, 0.08, 400):
            total = 0.0
            for mount in tractor.rops.mounts:
                k, most, tangent = mount.stiffness[1], mount.yield_force[1], mount.hardening[1]
                total += min(k * u, most + tangent * (k * u - most) if k * u > most else k * u)
                elastic = max(elastic, k)
            force.append(total)
        slopes = np.round(np.diff(force) / np.diff(np.linspace(0.0, 0.08, 400)) / elastic, 3)
        different = len({float(s) for s in slopes if np.sum(slopes == s) > 3})
        rate = tractor.rops.mounts[0].rate_factor
        if change.form == "hardening":
            assert slopes[-1] == pytest.approx(2.0 * change.parameters["tangent"], abs=1e-3)
        elif change.form == "one-by-one":
            assert (different, max(force)) == (3, pytest.approx(change.parameters["yield_force"]))
        else:
            assert rate is not None
            assert (rate.rate, rate.exponent, rate.gauge_length) == (40.4, 5.0, change.parameters["gauge_length"])
    order = Order(index=0, seed=5, kind="foreign-form", ids=("rops-plasticity",))
    (effect,) = make(order).truth["effects"]
    assert effect["form"] in ("hardening", "by-rate", "one-by-one")
    assert effect["source"]


def test_pairs_are_two_and_what_is_outside_comes_in_turn() -> None:
    pairs = [o.ids for o in plan(26, 3, kinds=["pair"])]
    assert all(len(set(ids)) == 2 and set(ids) <= set(library.EFFECTS) for ids in pairs)
    assert set(Counter(id for ids in pairs for id in ids).values()) <= {3, 4, 5}
    outside = [o.ids[0] for o in plan(2 * len(OUTSIDE), 3, kinds=["outside"])]
    assert Counter(outside) == Counter(dict.fromkeys(OUTSIDE, 2))
    asked = plan(4, 3, effects=["slope", "outside:hum"])
    assert Counter((o.kind, o.ids) for o in asked) == {("single", ("slope",)): 2, ("outside", ("outside:hum",)): 2}
    with pytest.raises(ValueError, match="a pair needs two, got slope"):
        plan(3, 1, ["pair"], ["slope"])


def test_every_effect_acts_in_overturns_by_its_parameters() -> None:
    random = np.random.default_rng(0)
    spans = dict.fromkeys(CHANNELS, 10.0)
    for id, draw in {**library.EFFECTS, **library.NEGLIGIBLE}.items():
        change, kind = draw(random, spans), EFFECTS[id]
        assert change.id == id
        assert change.kind == kind.kind
        assert "rollover" in kind.acts
        for name, value in change.parameters.items():
            if id != "sensor-bias":  # searched over the channel's range
                assert kind.search[name].low <= value <= kind.search[name].high, (id, name)


def test_numbers_of_the_library_are_those_of_the_vehicle() -> None:
    vehicle = shipped("side_overturn").vehicle
    assert vehicle.whole.mass == library.MASS  # type: ignore[union-attr]
    assert vehicle.whole.centre_of_mass == library.CENTRE  # type: ignore[union-attr]
    assert vehicle.whole.inertia == library.INERTIA  # type: ignore[union-attr]
    assert vehicle.front_axle.swing_deg == library.SWING  # type: ignore[union-attr]
    assert [w.name for w in vehicle.wheels] == list(library.TYRES)  # type: ignore[union-attr]
    assert {w.tyre.vertical_damping for w in vehicle.wheels} == {library.TYRE_DAMPING}  # type: ignore[union-attr]
    assert [m.name for m in vehicle.rops.mounts] == list(library.MOUNTS)  # type: ignore[union-attr]


def test_the_folder_holds_nothing_of_the_truth(tmp_path: Path) -> None:
    order = Order(index=0, seed=5, kind="single", ids=("ground-friction",))
    scenario = written(order, tmp_path / "case")
    assert not scenario.effects
    assert scenario.ground.friction.coefficient == library.FRICTION
    names = sorted(p.name for p in (tmp_path / "case").iterdir())
    assert names == [
        "r1.parquet",
        "r1.yaml",
        "r2.parquet",
        "r2.yaml",
        "r3.parquet",
        "r3.yaml",
        "r4.parquet",
        "r4.yaml",
        "scenario.yaml",
    ]
    for path in (tmp_path / "case").glob("*.yaml"):
        for word in ("friction: {coefficient: 0.3", "single", "seed", "truth", "ground-friction"):
            assert word not in path.read_text(encoding="utf-8")


def test_a_case_repeats_and_its_noise_is_as_stated() -> None:
    order = Order(index=2, seed=5, kind="null")
    a, b = make(order), make(order)
    for one, other in zip(a.recordings, b.recordings, strict=True):
        for c in CHANNELS:
            np.testing.assert_array_equal(one[c], other[c])
    assert a.truth == b.truth
    assert a.truth["verdict"] == "no-mismatch"
    quiet = a.recordings[0]["chassis/angular_velocity_y"][:40]  # nothing has hit the ground yet
    sigma = a.truth["noise"]["chassis/angular_velocity_y"]
    trend = np.polyval(np.polyfit(np.arange(40), quiet, 3), np.arange(40))
    assert 0.4 * sigma < np.std(quiet - trend) < 1.6 * sigma


def test_an_effect_shows_where_it_acts_a_fault_in_its_channel() -> None:
    strong = make(Order(index=1, seed=5, kind="single", ids=("slope",)))
    assert strong.truth["verdict"] == "parameter"
    assert strong.truth["over_noise"] > 0.0
    order = Order(index=1, seed=5, kind="single", ids=("sensor-gain",))
    faulty, plain = make(order), make(replace(order, kind="null", ids=()))
    effect = faulty.truth["effects"][0]
    over = effect["channels"]
    assert max(over, key=lambda c: over[c]) == effect["channel"]
    assert effect["parameters"]["gain"] != 1.0
    assert plain.truth["effects"] == []


def test_two_effects_share_the_strength_that_is_left() -> None:
    case = make(Order(index=3, seed=5, kind="pair", ids=("sensor-gain", "sensor-bias")))
    gain, bias = case.truth["effects"]
    assert gain["channel"] != bias["channel"]
    for effect in (gain, bias):
        over = effect["channels"]
        assert max(over, key=lambda c: over[c]) == effect["channel"]
        assert effect["signal_to_noise"] < case.truth["signal_to_noise"]
    stronger = max((gain, bias), key=lambda e: float(e["signal_to_noise"]))
    assert case.truth["verdict"] == stronger["kind"] == "sensor"
    for effect in (gain, bias):
        assert 0.0 < effect["over_scatter"] <= effect["over_noise"] * (1.0 + 1e-9)


@pytest.mark.parametrize("id", ["outside:pushed", "outside:hum"])
def test_what_is_outside_shows_and_is_told_as_such(id: str) -> None:
    order = Order(index=1, seed=8, kind="outside", ids=(id,))
    found, plain = make(order), make(replace(order, kind="null", ids=()))
    effect = found.truth["effects"][0]
    assert found.truth["verdict"] == "unexplained"
    assert id not in EFFECTS
    assert set(effect["near"]) <= set(EFFECTS)
    over = effect["channels"]
    if effect["channel"]:
        assert max(over, key=lambda c: over[c]) == effect["channel"]
        assert over[effect["channel"]] > 0.1
    else:
        assert min(over.values()) > 1e-6
    assert found.scenario == plain.scenario
    assert [r.conditions for r in found.recordings] == [r.conditions for r in plain.recordings]


def test_a_rig_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="rig: no such rig, got 'sled'; drop, overturn are allowed"):
        runner.prove(1, 1, rig="sled")


def test_overturns_are_sealed_handed_over_and_scored_like_drops() -> None:
    proof = runner.prove(
        1, 6, rig="overturn", kinds=["null"], workers=0, diagnosis="tests.proof.diagnoses:says_nothing"
    )
    assert proof.report["rig"] == "overturn"
    assert proof.truths[0]["rig"] == "overturn"
    assert proof.report["summary"]["false_alarms"]["hits"] == 0
