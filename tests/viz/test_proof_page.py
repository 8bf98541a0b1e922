"""The page of a blind proof says what the counts say: right, wrong, false alarms, failures, the seal."""

from __future__ import annotations

import re
from typing import Any

import pytest

from rollover.proof.summary import tally
from tests.viz.html import Parts
from viz.figures.counts import Share, confusion, shares
from viz.pages.proof import page


def row(case: str, kind: str, truth: str, claimed: str | None, **more: Any) -> dict[str, Any]:
    """A scored case with one parameter whose interval holds the truth."""
    nothing = kind in ("null", "decoy", "negligible")
    first = None if nothing or kind == "outside" or claimed is None else claimed == truth
    found = {
        "case": case,
        "kind": kind,
        "truth": [] if nothing else [truth],
        "claimed": claimed,
        "named": [claimed] if claimed else [],
        "set": [claimed] if claimed else [],
        "verdict": "missing-physics" if claimed else "no-mismatch",
        "detected": claimed is not None,
        "failed": False,
        "failure": "",
        "false_alarm": claimed is not None if nothing else None,
        "p_value": 0.5,
        **dict.fromkeys(("in_set", "first", "alone"), first),
        **dict.fromkeys(("both", "both_in_sets", "claim", "dependence_right", "channel_right", "place_right")),
        "verdict_right": bool(first) or (nothing and claimed is None),
        "parameters": [] if not first else [{"error": 0.02, "covers": True}],
        "signal_to_noise": 50.0,
        "over_noise": 3.0,
        "noise_share": 0.007,
        "recordings": 4,
        "held_out": {"before": 4.0, "after": 1.0},
        "seconds": 2.0,
    }
    return {**found, **more}


@pytest.fixture
def report() -> dict[str, Any]:
    rows = [
        row("case-0001", "single", "mass", "mass"),
        row("case-0002", "single", "mass", "slope"),
        row(
            "case-0003", "single", "tyre-damping", None, failed=True, failure="ValueError: <b>no</b> idea", verdict=None
        ),
        row("case-0004", "null", "", None),
        row("case-0005", "null", "", "soil-layer"),
        row("case-0006", "outside", "outside:cubic", None, claim="unexplained", detected=True, verdict="unexplained"),
    ]
    seal = {"digest": "ab" * 32, "algorithm": "sha256 of all", "cases": 6}
    return {"seed": 7, "summary": tally(rows), "rows": rows, "seal": seal}


def made(report: dict[str, Any]) -> Parts:
    return Parts(page(report, command="rollover prove --cases 6", versions={"rollover": "0.1.0"}))


def test_the_answer_comes_first_and_false_alarms_with_it(report: dict[str, Any]) -> None:
    said = made(report).said
    assert "2 of 3 single effects were detected, 1 of them named alone and right;" in said
    assert "1 of 2 cases without an effect were false alarms." in said
    assert "1 diagnosis failed; with 2 such cases the rate of false alarms is at most 99 %." in said
    assert 'class="headline fail"' in made(report).text


def test_every_case_that_went_wrong_is_listed_with_its_reason(report: dict[str, Any]) -> None:
    found = made(report)
    assert ["case-0003", "single", "tyre-damping", "ValueError: <b>no</b> idea"] in found.rows
    assert ["case-0002", "single", "mass", "missing-physics", "slope", "50"] in found.rows
    assert ["case-0005", "null", "", "missing-physics", "soil-layer", "50"] in found.rows
    listed = {r[0] for r in found.rows if r[0].startswith("case-")}
    assert listed == {"case-0002", "case-0003", "case-0005"}


def test_confusion_groups_and_seal_stand_there(report: dict[str, Any]) -> None:
    found = made(report)
    assert ["mass", "1", "slope 1"] in found.rows
    assert ["outside:cubic", "1", ""] in found.rows, "called unexplained, it is right"
    assert ["20 to 100", "3", "2 of 3", "1 of 2", "1 of 2", "1 of 2", "2 %", "1 of 1"] in found.rows
    assert f"Seal {'ab' * 32}" in re.sub(r"\s+", " ", found.said)
    assert "rollover prove --cases 6" in found.said
    assert found.fetched() == []


def test_groups_stand_in_the_order_of_their_numbers(report: dict[str, Any]) -> None:
    rows = [dict(r, signal_to_noise=s) for r, s in zip(report["rows"], (600.0, 3.0, 30.0, 1, 1, 1), strict=True)]
    found = made({**report, "rows": rows, "summary": tally(rows)})
    groups = [r[0] for r in found.rows if re.match(r"\d+ (to|and)", r[0])]
    assert groups[:3] == ["0 to 5", "20 to 100", "500 and more"]


def test_shares_are_drawn_where_they_lie() -> None:
    svg = shares([Share(name="a", hits=1, of=4, low=0.1, high=0.5), Share(name="b", hits=4, of=4, low=0.5, high=1.0)])
    ticks = [float(x) for x in re.findall(r'<line x1="([\d.]+)" x2="\1" y1="4"', svg)]
    at = dict(zip((0.0, 0.25, 0.5, 0.75, 1.0), ticks, strict=True))
    dots = [float(x) for x in re.findall(r'<circle cx="([\d.]+)"', svg)]
    assert dots == pytest.approx([at[0.25], at[1.0]], abs=0.11)
    bars = re.findall(r'<line x1="([\d.]+)" x2="([\d.]+)" [^>]*stroke-width="2"', svg)
    assert float(bars[1][0]) == pytest.approx(at[0.5], abs=0.11)
    assert "1 of 4" in svg


def test_a_confusion_is_red_and_what_is_right_green() -> None:
    svg = confusion({"mass": {"mass": 3, "slope": 1}, "nothing": {"nothing": 2}}, lambda truth, said: truth == said)
    cells = re.findall(r'fill="var\(--(\w+), #\w+\)" opacity="([\d.]+)"><title>([^<]*)</title>', svg)
    assert cells == [
        ("third", "0.70", "mass: 3 of 4 named mass"),
        ("limit", "0.40", "mass: 1 of 4 named slope"),
        ("third", "0.85", "nothing: 2 of 2 named nothing"),
    ]


def test_reality_and_certainty_are_shown_where_there_is_any(report: dict[str, Any]) -> None:
    assert "Foreign forms" not in made(report).said
    assert "Probabilities over names" not in made(report).said
    formed = {"form": "force-stays", "background": 0.03, "over_background": 2.0, "grades": ["part"]}
    given = {"flaw": "", "truth": "soil-crust", "brier": 0.08, "log": 0.22, "pairs": [[0.8, True], [0.2, False]]}
    rows = [
        row("case-0001", "foreign-form", "soil-crust", "soil-crust", **formed, probabilities=given),
        row("case-0002", "foreign-form", "soil-crust", "mass", **formed),
        row("case-0003", "background", "", "mass", background=0.03),
    ]
    found = made({**report, "rows": rows, "summary": tally(rows)})
    assert ["soil-crust, force-stays", "2", "2", "1", "1", "1", "1", "50"] in found.rows
    assert ["part", "1", "1"] in found.rows
    assert "1 cases: Brier score 0.080, log score 0.220, slope 1.67." in found.said
    svg = found.text.partition('aria-label="reliability')[2].partition("</svg>")[0]
    dots = [(float(x), float(y)) for x, y in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', svg)]
    assert dots == [pytest.approx((44 + 260 * 0.2, 44 + 260), abs=0.1), pytest.approx((44 + 260 * 0.8, 44), abs=0.1)]
