"""What is scored of foreign forms and backgrounds: names, grades, shares; and what is counted of many such cases.

A diagnosis may say of each name how far it goes (`answer` or `grade`: whole, part, likeness, immaterial) and which
share of the mismatch it explains; where it says neither, neither is counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rollover.proof.counts import Row, counted, median, share

WHOLE = "whole"
BACKGROUNDS = ((0.0, 0.02), (0.02, 0.05), (0.05, 1.0))  # share of the force's range
OVER = ((0.0, 0.5), (0.5, 1.0), (1.0, 3.0), (3.0, float("inf")))  # of an effect over the background it stands in


def graded(truth: Mapping[str, Any], found: Mapping[str, Any], effects: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Entries of a case's row; `effects` are the true ones, strongest first."""
    named = list(found.get("effects") or [])
    strongest = effects[0] if effects else {}
    behind = truth.get("background") or {}
    return {
        "form": strongest.get("form"),
        "background": behind.get("share", 0.0),
        "over_background": strongest.get("over_background"),
        "answer": found.get("answer"),
        "grades": [grade_of(n) for n in named],
        "explained": explained(named[0]) if named else None,
        "explains": truth.get("explains"),
    }


def grade_of(named: Mapping[str, Any]) -> str | None:
    """How far a name goes, as the diagnosis says."""
    said = named.get("answer", named.get("grade"))
    return said if isinstance(said, str) else None


FOREIGN = ("foreign-form", "foreign-engine")  # an effect by a law, or beside an engine, that is not the product's
ONE = ("single", "other-form", *FOREIGN)  # kinds of one effect


def explained(named: Mapping[str, Any]) -> dict[str, float | None] | None:
    """Share of the mismatch that a name is said to explain, with its interval."""
    said = named.get("explains", named.get("share"))
    if isinstance(said, (int, float)):
        return {"share": float(said), "low": None, "high": None}
    if not isinstance(said, Mapping):
        return None
    value = said.get("share", said.get("value"))
    if not isinstance(value, (int, float)):
        return None
    low, high = said.get("low"), said.get("high")
    known = isinstance(low, (int, float)) and isinstance(high, (int, float))
    return {"share": float(value), "low": low if known else None, "high": high if known else None}


def real(rows: Sequence[Row], nothing: Sequence[str]) -> dict[str, Any] | None:
    """Counts over cases with foreign forms or a background; None where there are none. `nothing` are kinds of nulls.

    `of_all` counts cases that were not detected, or failed, as not named.
    """
    rows = [r for r in rows if r["kind"] in (*FOREIGN, "background") or r.get("background")]
    if not rows:
        return None
    one = [r for r in rows if r["kind"] in ONE]
    alone = [r for r in rows if r["kind"] in nothing]
    unlisted = [r for r in rows if r["kind"] == "outside"]
    shown = [r for r in one if (r.get("over_background") or 0.0) >= 1.0]
    return {
        "cases": len(rows),
        "backgrounds": median([r["background"] for r in rows if r.get("background")]),
        "of_all": _found(one),
        "stronger_than_background": _found(shown),
        "called": {
            "another_name": share(sum(_another(r) for r in one), len(one)),
            "another_name_whole": share(sum(_another(r) and _said_whole(r) for r in one), len(one)),
            "unexplained": share(sum(r["verdict"] == "unexplained" for r in one), len(one)),
            "nothing": share(sum(not r["detected"] for r in one), len(one)),
        },
        "background_alone": {
            "false_name": share(sum(bool(r["named"]) for r in alone), len(alone)),
            "unexplained": share(sum(_unexplained(r) for r in alone), len(alone)),
            "false_alarm": counted(alone, "false_alarm"),
            "failed": sum(bool(r["failed"]) for r in alone),
        },
        "unlisted": {
            "wrong_name": share(sum(_wrong(r) for r in unlisted), len(unlisted)),
            "wrong_name_whole": share(sum(_wrong(r) and _said_whole(r) for r in unlisted), len(unlisted)),
        },
        "by_form": _by(one, lambda r: f"{r['truth'][0]}, {r.get('form') or 'own form'}"),
        "by_background": _by(one, lambda r: _bin(r.get("background") or 0.0, BACKGROUNDS)),
        "by_over_background": _by(
            [r for r in one if r.get("over_background") is not None], lambda r: _bin(r["over_background"], OVER)
        ),
        "grades": _grades(one),
        "explained": _explained(one),
    }


def _found(rows: Sequence[Row]) -> dict[str, Any]:
    return {key: share(sum(bool(r[key]) for r in rows), len(rows)) for key in ("in_set", "first", "alone")}


def _another(row: Row) -> bool:
    """A name that is not the true one leads, and the set does not hold it either."""
    return bool(row["named"]) and not row["in_set"]


def _said_whole(row: Row) -> bool:
    """Whether the leading name is said to be all there is; a diagnosis without grades says so by not saying less."""
    grade = next(iter(row.get("grades") or []), None)
    return grade == WHOLE if grade is not None else row.get("answer") in (None, WHOLE)


def _wrong(row: Row) -> bool:
    return str(row["claim"] or "").startswith("wrong")


def _unexplained(row: Row) -> bool:
    return bool(row["detected"]) and not row["named"]


def _by(rows: Sequence[Row], key: Callable[[Row], str]) -> dict[str, dict[str, Any]]:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return {
        name: {
            "cases": len(group),
            "detected": counted(group, "detected"),
            **_found(group),
            "another_name": share(sum(_another(r) for r in group), len(group)),
            "signal_to_noise": median([r["signal_to_noise"] for r in group]),
        }
        for name, group in sorted(groups.items())
    }


def _bin(value: float, bins: Sequence[tuple[float, float]]) -> str:
    if value == 0.0:
        return "none"
    low, high = next((b for b in bins if b[0] <= value < b[1]), bins[-1])
    return f"{low:g} to {high:g}"


def _grades(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Grade of the leading name -> how often it is right and wrong; empty where none was given."""
    found: dict[str, dict[str, int]] = {}
    for row in rows:
        grade = next(iter(row.get("grades") or []), None)
        if grade is not None:
            line = found.setdefault(grade, {"right": 0, "wrong": 0})
            line["right" if row["in_set"] else "wrong"] += 1
    return found


def _explained(rows: Sequence[Row]) -> dict[str, Any]:
    """How often the stated share holds the true one: of effects in their own form, first and right, in a background.

    Of a foreign form the generator does not know what the product's own law would explain.
    """
    able = [r for r in rows if r["first"] and r.get("explains") is not None and r.get("form") is None]
    given = [(r["explained"], r["explains"]) for r in able if r.get("explained")]
    held = [e["low"] <= true <= e["high"] for e, true in given if e["low"] is not None]
    return {"coverage": share(sum(held), len(held)), "error": median([abs(e["share"] - true) for e, true in given])}
