"""Scores of diagnoses that were made by hand, and of their sums."""

from __future__ import annotations

from typing import Any

import pytest
from scipy.stats import binom

from rollover.proof.counts import counted, share
from rollover.proof.score import score
from rollover.proof.summary import confusion, table, tally, uniformity

FORCE, DEPTH = "ground/force_normal", "ground/sinkage"


def effect(id: str = "soil-viscous-damping", kind: str = "physics", **more: Any) -> dict[str, Any]:
    cells = [
        {"recording": 0, "channel": FORCE, "start": 0.01, "end": 0.1, "share": 0.9},
        {"recording": 1, "channel": FORCE, "start": 0.02, "end": 0.2, "share": 0.08},
        {"recording": 1, "channel": DEPTH, "start": 0.1, "end": 0.3, "share": 0.02},
    ]
    sealed = {
        "id": id,
        "kind": kind,
        "parameters": {"damping": 1000.0},
        "channel": "",
        "depends_on": "speed",
        "near": [],
    }
    return {**sealed, "over_noise": 3.0, "signal_to_noise": 40.0, "where": cells, **more}


def truth(*effects: dict[str, Any], kind: str = "single", verdict: str = "missing-physics") -> dict[str, Any]:
    return {
        "case": "case-0001",
        "kind": kind,
        "verdict": verdict,
        "effects": list(effects),
        "over_noise": 3.0,
        "signal_to_noise": 40.0,
        "noise_share": {FORCE: 0.01, DEPTH: 0.02},
        "recordings": [{"title": "Drop 1"}, {"title": "Drop 2"}],
    }


def said(*ids: str, verdict: str = "missing-physics", **more: Any) -> dict[str, Any]:
    return {"verdict": verdict, "effects": [{"id": id} for id in ids], **more}


def test_named_first_alone_and_right() -> None:
    found = said()
    value = {"value": 1020.0, "low": 990.0, "high": 1050.0}
    found["effects"] = [{"id": "soil-viscous-damping", "parameters": {"damping": value}}]
    found["where"] = [{"recording": "r1", "channel": FORCE, "start": 0.05, "end": 0.3}]
    found["fit"] = {"held_out": {"before": {"nrmse": 0.2}, "after": {"nrmse": 0.1}}}
    row = score(truth(effect()), found)
    assert (row["detected"], row["first"], row["in_set"], row["alone"], row["verdict_right"]) == (True,) * 5
    assert (row["channel_right"], row["place_right"]) == (True, True)
    assert row["held_out"] == {"before": 0.2, "after": 0.1}
    (parameter,) = row["parameters"]
    assert parameter["error"] == pytest.approx(0.02)
    assert parameter["covers"] is True
    for ends in ({"low": 1001.0}, {"low": 900.0, "high": 999.0}):
        value |= ends
        assert score(truth(effect()), found)["parameters"][0]["covers"] is False


@pytest.mark.parametrize(
    ("place", "channel", "hit"),
    [
        ({"recording": "r1", "channel": FORCE, "start": 0.11, "end": 0.2}, True, False),  # too late
        ({"recording": "r2", "channel": FORCE, "start": 0.11, "end": 0.2}, True, True),
        ({"recording": "Drop 2", "channel": FORCE, "start": 0.11, "end": 0.2}, True, True),
        ({"recording": "r2", "channel": DEPTH, "start": 0.1, "end": 0.2}, False, False),  # hardly felt there
    ],
)
def test_where_it_was_seen(place: dict[str, Any], channel: bool, hit: bool) -> None:
    row = score(truth(effect()), said("soil-viscous-damping", where=[place]))
    assert (row["channel_right"], row["place_right"]) == (channel, hit)


@pytest.mark.parametrize(("more", "right"), [({}, None), ({"where": []}, False)])
def test_an_answer_without_places_is_not_scored_by_them(more: dict[str, Any], right: bool | None) -> None:
    row = score(truth(effect()), said("soil-viscous-damping", **more))
    assert (row["channel_right"], row["place_right"]) == (right, right)


def test_in_the_set_but_not_first() -> None:
    found = said("soil-inertial-drag")
    found["effects"][0]["indistinguishable_from"] = ["soil-viscous-damping"]
    row = score(truth(effect()), found)
    assert (row["first"], row["in_set"], row["alone"]) == (False, True, False)
    assert row["set"] == ["soil-inertial-drag", "soil-viscous-damping"]
    both = said("soil-viscous-damping", "mass")
    assert score(truth(effect()), both)["alone"] is False


def test_a_sensor_is_right_on_its_channel_only() -> None:
    sealed = truth(effect("sensor-gain", "sensor", channel=FORCE), verdict="sensor")
    named = {"id": "sensor-gain", "parameters": {"channel": {"value": DEPTH}}}
    assert score(sealed, {"verdict": "sensor", "effects": [named]})["first"] is False
    named = {"id": "sensor-gain", "channel": FORCE}
    assert score(sealed, {"verdict": "sensor", "effects": [named]})["first"] is True


def test_nothing_and_false_alarms() -> None:
    nothing = truth(kind="null", verdict="no-mismatch")
    assert score(nothing, said(verdict="no-mismatch"))["false_alarm"] is False
    assert score(nothing, said(verdict="cannot-tell"))["verdict_right"] is True
    row = score(nothing, said("mass", verdict="parameter"))
    assert (row["false_alarm"], row["verdict_right"], row["first"]) == (True, False, None)
    small = truth(effect("air-drag"), kind="negligible", verdict="no-mismatch")
    assert score(small, said("air-drag"))["false_alarm"] is True
    assert score(truth(effect()), said(verdict="no-mismatch"))["first"] is None  # not detected is not misnamed


def test_two_effects() -> None:
    weak = effect("sensor-bias", "sensor", signal_to_noise=5.0, channel=FORCE)
    sealed = truth(weak, effect(), kind="pair")
    assert score(sealed, said("soil-viscous-damping", "sensor-bias"))["both"] is True
    row = score(sealed, said("soil-viscous-damping"))
    assert (row["first"], row["both"], row["both_in_sets"]) == (True, False, False)
    assert score(sealed, said("sensor-bias", "soil-viscous-damping"))["first"] is False


def test_what_is_in_no_library() -> None:
    bands = effect("outside:bands", "outside", depends_on="depth", near=["soil-layer"])
    sealed = truth(bands, kind="outside", verdict="unexplained")
    fine = said(verdict="unexplained", where=[{"channel": FORCE, "depends_on": "ground/sinkage"}])
    row = score(sealed, fine)
    assert (row["claim"], row["dependence_right"], row["verdict_right"]) == ("unexplained", True, True)
    assert score(sealed, said(verdict="unexplained"))["dependence_right"] is False
    flat = truth(effect("outside:flat-tyre", "outside", depends_on="attitude"), kind="outside", verdict="unexplained")
    for quantity, right in (("axle/front/angle", True), ("chassis/roll", True), ("chassis/angular_velocity_x", False)):
        there = [{"channel": "chassis/angular_velocity_z", "depends_on": quantity}]
        assert score(flat, said(verdict="unexplained", where=there))["dependence_right"] is right
    assert score(sealed, said("soil-layer"))["claim"] == "near"
    assert score(sealed, said("mass", remaining={"significant": True}))["claim"] == "wrong, rest unexplained"
    assert score(sealed, said(verdict="no-mismatch"))["claim"] == "missed"


def test_exact_binomial_interval() -> None:
    """At the ends of the interval the tail of the binomial is 2.5 %."""
    found = share(3, 40)
    assert binom.sf(2, 40, found["low"]) == pytest.approx(0.025, rel=1e-6)
    assert binom.cdf(3, 40, found["high"]) == pytest.approx(0.025, rel=1e-6)
    assert (share(0, 10)["low"], share(10, 10)["high"], share(0, 0)["share"]) == (0.0, 1.0, None)


def test_p_values_of_nulls() -> None:
    even = [(i + 0.5) / 50 for i in range(50)]
    assert uniformity(even)["p_value"] > 0.99
    assert uniformity([p * p for p in even])["p_value"] < 0.01
    assert uniformity([0.5])["p_value"] is None


def test_the_sums() -> None:
    rows = [
        score(truth(effect("mass"), effect("soil-crust"), kind="pair"), said("mass", "soil-crust")),
        score(truth(effect()), said("soil-viscous-damping")),
        score(truth(effect()), said("mass", verdict="parameter")),
        score(truth(effect("soil-layer")), said(verdict="no-mismatch")),
        score(
            truth(kind="null", verdict="no-mismatch"), said("mass", verdict="parameter", significance={"p_value": 0.01})
        ),
        score(truth(kind="null", verdict="no-mismatch"), None),
        score(
            truth(effect("outside:hum", "outside"), kind="outside", verdict="unexplained"), said(verdict="unexplained")
        ),
    ]
    found = tally(rows)
    assert (found["detected"]["hits"], found["detected"]["of"]) == (2, 3)
    assert (found["named_first"]["hits"], found["named_first"]["of"]) == (1, 2)
    assert (found["false_alarms"]["hits"], found["false_alarms"]["of"]) == (1, 2)
    assert found["failed"] == ["case-0001"]
    assert found["outside"]["unexplained"]["share"] == 1.0
    assert confusion(rows) == {
        "nothing": {"mass": 1, "nothing": 1},
        "outside:hum": {"unexplained": 1},
        "soil-layer": {"nothing": 1},
        "soil-viscous-damping": {"soil-viscous-damping": 1, "mass": 1},
    }
    lines = table(found, "by_effect")
    assert {line["effect"]: line["detected"] for line in lines} == {"soil-viscous-damping": 1.0, "soil-layer": 0.0}
    assert len(found["misses"]) == 3
    assert counted(rows, "first")["of"] == 3  # the pair too
