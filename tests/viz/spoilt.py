"""Pages of plans, rolling, frames, stability and soils in which one text stands wherever a word from data may."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from rollover.assessment import frame_json
from rollover.assessment.frame_test import frame_test
from rollover.assessment.rolled import json_of, rolled
from rollover.assessment.standing import scenario_of
from rollover.diagnosis.planning.next_test import Advice, NextTest
from rollover.diagnosis.planning.plan import Detectable, Pair, Plan
from rollover.scenario import load
from viz.pages import identification as identification_page
from viz.pages import plan as plan_page
from viz.pages import rolling as rolling_page
from viz.pages import rops as rops_page
from viz.pages import stability as stability_page

OWN = (
    "verdict",
    "symbol",
    "kind",
    "status",
    "come_from",
    "quantity",
    "confidence",
    "unit",
    "corners",
)  # of an account: words of the program alone, by which a page decides


def everywhere(value: Any, text: str) -> Any:
    """An account with the text in place of each of its words, but for those of `OWN`."""
    if isinstance(value, str):
        return text
    if isinstance(value, dict):
        return {k: v if k in OWN else everywhere(v, text) for k, v in value.items()}
    return [everywhere(v, text) for v in value] if isinstance(value, (list, tuple)) else value


def _plan(text: str) -> str:
    words: dict[str, Any] = {"kind": text, "parameter": text, "unit": text, "others": {text: 1.0}}
    numbers: dict[str, Any] = {"least": 1.0, "usual": 2.0, "power": 0.9, "judged": 2.0}
    effects = tuple(Detectable(effect=f"{text}{k}", **words, **numbers) for k in range(2))
    names = [e.effect for e in effects]
    pairs = tuple(Pair(effect=a, rival=b, noncentrality=1.0, probability=0.6) for a, b in (names, reversed(names)))
    tried = NextTest(path=text, value=1.0, unit=text, channels=(text,), rate=100.0, probability=0.9)
    advice = Advice(
        effects=(names[0], names[1]), probability=0.6, best=tried, is_enough=False, tried=(tried,), known=text
    )
    shares = {"tolerance": 0.0, "gain": 0.01, "power": 0.8, "false_alarm": 0.05, "size": 0.01, "distinguishable": 0.9}
    found = Plan(
        conditions=({text: text},),
        noise={"ground/force_normal": 1.0},
        rate=1000.0,
        noncentrality=10.0,
        effects=effects,
        pairs=pairs,
        next_tests=(advice,),
        **shares,
    )
    return plan_page.page(found, title=text, command=text, scenario_hash=text, versions={text: text})


def _rolling(text: str) -> str:
    asked, found = rolled(scenario_of("vineyard_tractor"))
    answer = everywhere(json_of(asked, found, {"scenario_hash": text, "outside": [text]}), text)
    return rolling_page.page({**answer, "outside": [text], "versions": {text: text}}, command=text)


@functools.cache
def _pushed() -> dict[str, Any]:
    weld = {"name": "foot", "member": "post_left", "end": "start", "weld": {"throat": 5.0}}  # which gives way
    frame = frame_json.scenario_of("two_post_rear_tubes_3t", 3000.0).replaced({"vehicle.rops.connections": [weld]})
    return frame_json.json_of(frame_test(frame, segments=4))


def _rops(text: str) -> str:
    answer = everywhere(_pushed(), text)
    return rops_page.page({**answer, "scenario_hash": text, "versions": {text: text}}, command=text)


def _stability(text: str) -> str:
    closed = {"free_pivot_deg": None, "rigid_deg": 30.0}
    row = {
        **dict.fromkeys(("lift_off_deg", "phase_one_deg", "stop_deg", "overturn_deg", "balance_deg"), 30.0),
        "first_off": [text],
        "closed_form": {"outer_edge": closed, "centre_line": closed},
    }
    answer = {
        "headings": [{**row, "heading_deg": h} for h in (0.0, 90.0, 180.0, 270.0)],
        "least": {"balance_deg": 30.0, "heading_deg": 90.0},
        "code_6": {"limit_deg": 38.0, "confidence": text, "applies": True},
        "losses": [{"part": text, "mass": 1.0, "without_deg": 31.0, "with_deg": 30.0, "share": 0.03}],
        "effects_left_out": [text],
        "vehicle": text,
        "scenario_hash": text,
        "versions": {text: text},
    }
    return stability_page.page(answer, command=text)


def _identification(text: str, *, forms: bool = False) -> str:
    ends = {"value": 1.0, "low": None, "high": 2.0}
    drop = {"name": text, "speed": 2.0, "mass": 132.0, "area": 0.0063}
    drop |= {"stiffness": {"depth": [0.01, 0.02], "value": [5e4, 5e4], "sd": [1.0, 1.0]}}
    numbers = {"law": text, "recordings": [text], "drops": [drop], "law_mass": "reference"}
    numbers |= {"coefficients": [{"name": text, "origin": "neutral", "why": text, **ends}]}
    errors = dict.fromkeys(("residual", "log_scatter", "held_out_deceleration_error", "held_out_depth_error"), 0.1)
    form = {"name": text, "statement": text, "numbers": [{"name": text, **ends}], **errors}
    of_forms = {"law": text, "recordings": [text], "drops": [], "chosen": text, "forms": [form]}
    words: dict[str, Any] = {"refused": [text], "remarks": [text], "command": text, "versions": {text: text}}
    return identification_page.page(load("drop_test").ground.law, of_forms if forms else numbers, **words)


PAGES: dict[str, Callable[[str], str]] = {
    "plan": _plan,
    "rolling": _rolling,
    "stability": _stability,
    "rops": _rops,
    "identification": _identification,
    "identification of a cone": functools.partial(_identification, forms=True),
}
