"""A plan as its file: plan.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rollover.assessment.results import plain, versions
from rollover.diagnosis.planning.plan import Plan

FORMAT = "rollover-plan/1"
JSON, PAGE = "plan.json", "report.html"
FILES = (JSON, PAGE)


def json_of(found: Plan, about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """What plan.json says, bare JSON values; `about` names what was asked."""
    fields = asdict(found)
    effects, pairs, tests = (fields.pop(key) for key in ("effects", "pairs", "next_tests"))
    answer: dict[str, Any] = plain(
        {
            "format": FORMAT,
            **(about or {}),
            **fields,
            "effects": effects,
            "pairs": [{**p, "is_told_apart": p["probability"] >= found.told_apart} for p in pairs],
            "next_tests": tests,
            "versions": versions(),
        }
    )
    return answer
