"""Concealed cases with fixed seeds, from the proof's own generator: what must hold whatever is changed."""

from __future__ import annotations

from typing import Any

import pytest

from rollover.diagnosis import Diagnosis, diagnose
from rollover.diagnosis.io import json_of
from rollover.proof.generator import Case, Order, make
from rollover.proof.score import score
from rollover.scenario import load


def diagnosed(order: Order, tmp_path: Any) -> tuple[Case, Diagnosis, dict[str, Any]]:
    case = make(order)
    path = tmp_path / "scenario.yaml"
    path.write_text(case.scenario, encoding="utf-8")
    recordings = [(f"r{k}", r) for k, r in enumerate(case.recordings, start=1)]
    found = diagnose(load(path), recordings)
    return case, found, score(case.truth, json_of(found))


@pytest.mark.parametrize(("kind", "seed"), [("null", 410), ("decoy", 411)])
def test_nothing_is_named_where_nothing_is(kind: str, seed: int, tmp_path: Any) -> None:
    _, found, row = diagnosed(Order(index=0, seed=seed, kind=kind), tmp_path)
    assert found.verdict == "no-mismatch"
    assert not row["false_alarm"]
    assert not found.effects
    assert found.p_value > 0.005
    assert all(value > 0.0 for value in found.smallest_detectable.values())
    assert "soil-viscous-damping" in found.smallest_detectable


@pytest.mark.parametrize(
    ("id", "seed", "verdict"),
    [
        ("sensor-gain", 423, "sensor"),
        ("soil-stiffness", 423, "parameter"),
        ("soil-viscous-damping", 425, "missing-physics"),
    ],
)
def test_one_effect_is_named_with_its_value(id: str, seed: int, verdict: str, tmp_path: Any) -> None:
    case, found, row = diagnosed(Order(index=0, seed=seed, kind="single", ids=(id,)), tmp_path)
    assert case.truth["over_noise"] > 0.5  # else nothing would be asked of it
    assert found.verdict == verdict
    assert row["in_set"]
    assert row["first"]
    assert found.after["held_out"].nrmse < 1.2
    assert row["parameters"]
    for p in row["parameters"]:
        assert p["error"] < 0.1
    assert not found.remaining_significant


def test_both_of_two_effects_are_named(tmp_path: Any) -> None:
    """A soil 0.13 % softer than its law and an accelerometer 1.3 % short, both far above the noise."""
    order = Order(index=0, seed=432, kind="pair", ids=("soil-stiffness", "sensor-gain"))
    _, found, row = diagnosed(order, tmp_path)
    assert {n.id for n in found.effects} == {"soil-stiffness", "sensor-gain"}
    assert row["both"]
    assert found.verdict == "sensor"
    assert found.after["held_out"].nrmse < 1.05


def test_what_no_table_holds_is_not_given_a_name(tmp_path: Any) -> None:
    order = Order(index=0, seed=440, kind="outside", ids=("outside:bands",))
    _, found, row = diagnosed(order, tmp_path)
    assert row["claim"] == "unexplained"
    assert found.remaining_significant
    assert found.remaining_where


def test_the_depth_of_a_weak_layer_is_followed_to_where_it_is(tmp_path: Any) -> None:
    """A hardpan 4 % stiffer at 0.102 m: beside it, at 0.095 m, differences over a step lead nowhere."""
    *_, row = diagnosed(Order(index=6, seed=31415926, kind="single", ids=("soil-layer",)), tmp_path)
    assert row["alone"]
    assert [p["name"] for p in row["parameters"]] == ["depth", "stiffness_ratio"]
    assert all(p["covers"] and p["error"] < 0.02 for p in row["parameters"]), row["parameters"]
