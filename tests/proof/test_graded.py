"""Foreign forms, backgrounds, grades and probabilities, counted from diagnoses that were made by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rollover.cli.commands.prove import sentences
from rollover.proof.probabilities import reliability, scored
from rollover.proof.score import score
from rollover.proof.summary import tally
from tests.proof.test_score import effect, said, truth

BEHIND = {"background": {"share": 0.03}}


def foreign(id: str = "soil-crust", over: float | None = 2.0, **more: Any) -> dict[str, Any]:
    formed = {"form": "force-stays", **({} if over is None else {"over_background": over})}
    return truth(effect(id, **formed), kind="foreign-form") | more


def graded(id: str, grade: str, **more: Any) -> dict[str, Any]:
    return {"verdict": "missing-physics", "effects": [{"id": id, "grade": grade, **more}]}


def test_what_is_counted_of_foreign_forms_and_backgrounds() -> None:
    nothing = truth(kind="background", verdict="no-mismatch") | BEHIND
    unlisted = truth(effect("outside:hum", "outside"), kind="outside", verdict="unexplained") | BEHIND
    set_of_two = said("soil-layer")
    set_of_two["effects"][0]["indistinguishable_from"] = ["soil-crust"]
    rows = [
        score(foreign(), graded("soil-crust", "whole")),
        score(foreign(**BEHIND), set_of_two),
        score(foreign(over=0.2, **BEHIND), said(verdict="no-mismatch")),
        score(foreign(**BEHIND), graded("mass", "part")),
        score(foreign(), graded("mass", "whole")),
        score(foreign(), said(verdict="unexplained")),
        score(foreign(), None),
        score(nothing, said(verdict="no-mismatch")),
        score(nothing, said(verdict="unexplained")),
        score(nothing, said("mass", verdict="parameter")),
        score(unlisted, graded("soil-layer", "whole")),
        score(unlisted, graded("soil-layer", "likeness")),
        score(truth(effect()), said("soil-viscous-damping")),  # an own form with nothing behind it is not of these
    ]
    found = tally(rows)
    real = found["real"]
    assert real["cases"] == 12

    def of(part: str, key: str) -> tuple[int, int]:
        return real[part][key]["hits"], real[part][key]["of"]

    assert of("of_all", "in_set") == (2, 7), "what is not detected, and what failed, is not in the set"
    assert of("of_all", "first") == (1, 7)
    assert of("stronger_than_background", "in_set") == (2, 6)
    assert of("called", "another_name") == (2, 7)
    assert of("called", "another_name_whole") == (1, 7)
    assert of("called", "unexplained") == (1, 7)
    assert of("called", "nothing") == (2, 7)
    assert of("background_alone", "false_name") == (1, 3)
    assert of("background_alone", "unexplained") == (1, 3)
    assert of("background_alone", "false_alarm") == (2, 3), "unexplained where nothing is, is a false alarm"
    assert (found["false_alarms"]["hits"], found["false_alarms"]["of"]) == (2, 3)
    assert of("unlisted", "wrong_name") == (2, 2)
    assert of("unlisted", "wrong_name_whole") == (1, 2)
    assert real["grades"] == {"whole": {"right": 1, "wrong": 1}, "part": {"right": 0, "wrong": 1}}
    assert real["by_form"]["soil-crust, force-stays"]["cases"] == 7
    assert real["by_background"]["0.02 to 0.05"]["in_set"]["hits"] == 1
    assert real["by_over_background"]["0 to 0.5"]["detected"]["hits"] == 0
    lines = " ".join(" ".join(sentences(found)).split())
    assert "in the set, of all 2 of 7 (" in lines
    assert "a background alone named as an effect 1 of 3 (" in lines
    assert "Probabilities" not in lines


def test_cases_without_either_have_no_such_part() -> None:
    found = tally([score(truth(effect()), said("soil-viscous-damping"))])
    assert found["real"] is None
    assert found["probabilities"] is None


@pytest.mark.parametrize(
    ("said_so", "read"),
    [
        ({"share": 0.8}, (0.8, None)),
        ({"share": {"share": 0.8, "low": 0.7, "high": 0.9}}, (0.8, 0.7)),
        ({"share": {"value": 0.8, "low": 0.7, "high": 0.9}}, (0.8, 0.7)),
        ({"explains": {"share": 0.8, "low": 0.7, "high": 0.9}}, (0.8, 0.7)),
    ],
)
def test_a_share_that_is_explained(said_so: dict[str, Any], read: tuple[float, float | None]) -> None:
    sealed = truth(effect(), kind="single") | BEHIND | {"explains": 0.75}
    row = score(sealed, {"verdict": "missing-physics", "effects": [{"id": "soil-viscous-damping", **said_so}]})
    assert (row["explained"]["share"], row["explained"]["low"]) == read
    explained = tally([row])["real"]["explained"]
    assert explained["error"] == pytest.approx(0.05)
    assert explained["coverage"]["of"] == (0 if read[1] is None else 1)
    assert explained["coverage"]["hits"] == explained["coverage"]["of"]


def test_brier_and_log_scores_by_hand() -> None:
    given = {"soil-layer": 0.7, "soil-crust": 0.2, "nothing": 0.1}
    right = scored(given, "soil-layer")
    assert right is not None
    assert right["brier"] == pytest.approx(0.09 + 0.04 + 0.01)
    assert right["log"] == pytest.approx(-math.log(0.7))
    missing = scored(given, "mass")
    assert missing is not None
    assert missing["brier"] == pytest.approx(0.49 + 0.04 + 0.01 + 1.0)
    assert missing["log"] == pytest.approx(-math.log(1e-3))
    row = score(truth(kind="null", verdict="no-mismatch"), {"verdict": "no-mismatch", "probabilities": given})
    assert row["probabilities"]["brier"] == pytest.approx(0.49 + 0.04 + 0.81)
    unlisted = truth(effect("outside:hum", "outside"), kind="outside", verdict="unexplained")
    row = score(unlisted, {"verdict": "unexplained", "probabilities": {"not-listed": 1.0}})
    assert row["probabilities"]["brier"] == 0.0


@pytest.mark.parametrize(
    "flawed", [{"mass": 0.7}, {"mass": 1.2, "nothing": -0.2}, {"mass": "much"}, {"mass": float("nan")}, {}, [0.5, 0.5]]
)
def test_what_are_no_probabilities_is_not_scored(flawed: Any) -> None:
    rows = [score(truth(effect()), said("mass", probabilities=flawed))]
    found = tally(rows)["probabilities"]
    assert found["cases"] == 0
    assert len(found["flawed"]) == 1
    assert found["brier"] is None


def cases(sure: float, count: int = 3000) -> list[dict[str, Any]]:
    """Two names at p and 1 - p, of which the first comes true as often as p pulled towards one half says."""
    random = np.random.default_rng(6)
    rows = []
    for p in random.uniform(0.02, 0.98, count):
        true = "mass" if random.random() < 0.5 + (p - 0.5) / sure else "nothing"
        rows.append({"probabilities": scored({"mass": float(p), "nothing": float(1.0 - p)}, true)})
    return rows


def test_a_reliability_diagram_shows_who_is_too_sure() -> None:
    """Slopes of the line through outcomes: that of the truth over what is given."""
    fair, bold = reliability(cases(1.0)), reliability(cases(2.0))
    assert fair is not None
    assert bold is not None
    assert fair["slope"] == pytest.approx(1.0, abs=0.05)
    assert bold["slope"] == pytest.approx(0.5, abs=0.06)
    assert fair["brier"] < bold["brier"]
    assert fair["log"] < bold["log"]
    assert len(fair["bins"]) == 10
    held = [one["right"]["low"] <= one["given"] <= one["right"]["high"] for one in fair["bins"]]
    assert sum(held) >= 8
    assert not bold["bins"][9]["right"]["low"] <= bold["bins"][9]["given"] <= bold["bins"][9]["right"]["high"]
    assert sum(one["right"]["of"] for one in fair["bins"]) == 6000
