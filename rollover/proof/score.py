"""One case scored: what a diagnosis said against the truth. Bare values in, bare values out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rollover.proof.graded import graded
from rollover.proof.probabilities import name_of, scored

NOTHING = ("no-mismatch", "cannot-tell")
VERDICTS = ("no-mismatch", "cannot-tell", "parameter", "sensor", "missing-physics", "unexplained")
FELT = 0.05  # share of an effect's evidence from which on a channel is one that feels it
SAME_AS = {
    "depth": ("sinkage", "position"),
    "speed": ("velocity",),
    "impact-speed": ("initiation.speed", "speed"),
    "attitude": ("roll", "pitch", "axle/front/angle"),
}


def score(truth: Mapping[str, Any], diagnosis: Mapping[str, Any] | None, seconds: float = 0.0) -> dict[str, Any]:
    """Row of one case. `diagnosis` is diagnosis.json as the contract has it, or None for a diagnosis that failed.

    `detected` says whether any mismatch was claimed; `first`, `in_set` and `alone` whether the strongest true effect
    was named first, was in the set offered (with what it is indistinguishable from), and was the whole set; `claimed`
    the id named first; grades, shares and probabilities stand there where the diagnosis gives them. Values that do not
    apply are None.
    """
    effects = list(truth["effects"]) if truth["kind"] != "negligible" else []
    effects.sort(key=lambda e: -float(e["signal_to_noise"]))
    row: dict[str, Any] = {
        "case": truth["case"],
        "kind": truth["kind"],
        "truth": [e["id"] for e in effects] or [e["id"] for e in truth["effects"]],
        "truth_verdict": truth["verdict"],
        "over_noise": truth["over_noise"],
        "signal_to_noise": truth["signal_to_noise"],
        "noise_share": _middle(list(truth["noise_share"].values())),
        "recordings": len(truth["recordings"]),
        "seconds": seconds,
        "failed": diagnosis is None,
    }
    found = diagnosis or {}
    verdict = found.get("verdict")
    named = list(found.get("effects") or [])
    remaining = bool((found.get("remaining") or {}).get("significant"))
    detected = diagnosis is not None and verdict not in NOTHING
    row |= {
        "verdict": verdict,
        "claimed": named[0]["id"] if named else None,
        "set": _set(named[0]) if named else [],
        "named": [n["id"] for n in named],
        "detected": detected,
        "p_value": (found.get("significance") or {}).get("p_value"),
        "verdict_right": verdict == truth["verdict"] or (not effects and verdict in NOTHING),
        "false_alarm": detected if not effects else None,
        "held_out": _held_out(found),
    }
    row |= _names(effects, named, detected, remaining)
    row |= _where(effects, found, detected, [r["title"] for r in truth["recordings"]])
    row |= graded(truth, found, effects)
    row["probabilities"] = scored(found.get("probabilities"), name_of(effects))
    row["parameters"] = [p for e in effects for p in _parameters(e, named)]
    return row


def _set(effect: Mapping[str, Any]) -> list[str]:
    return [effect["id"], *(i for i in effect.get("indistinguishable_from") or [] if i != effect["id"])]


def _names(
    effects: Sequence[Mapping[str, Any]], named: Sequence[Mapping[str, Any]], detected: bool, remaining: bool
) -> dict[str, Any]:
    """Whether the right effects were named."""
    row: dict[str, Any] = dict.fromkeys(("first", "in_set", "alone", "both", "both_in_sets", "claim"))
    if not effects:
        return row
    if effects[0]["kind"] == "outside":
        if not detected:
            row["claim"] = "missed"
        elif not named:
            row["claim"] = "unexplained"
        else:
            near = all(n["id"] in effects[0]["near"] for n in named)
            row["claim"] = ("near" if near else "wrong") + (", rest unexplained" if remaining else "")
        return row
    if not detected:
        return row
    strongest, sets = effects[0], [_set(n) for n in named]
    row["first"] = bool(named) and _same(named[0], strongest)
    row["in_set"] = any(_holds(n, strongest) for n in named)
    row["alone"] = bool(row["first"]) and len(sets) == 1 and len(sets[0]) == 1
    if len(effects) == 2:
        row["both"] = all(any(_same(n, e) for n in named) for e in effects) and len(named) == 2
        row["both_in_sets"] = all(any(_holds(n, e) for n in named) for e in effects)
    return row


def _channel(effect: Mapping[str, Any]) -> Any:
    channel = effect.get("channel")
    if channel:
        return channel
    value = (effect.get("parameters") or {}).get("channel")
    return value.get("value") if isinstance(value, Mapping) else value


def _same(named: Mapping[str, Any], effect: Mapping[str, Any]) -> bool:
    """The same id, and for a sensor the same channel where the diagnosis says one."""
    if named["id"] != effect["id"]:
        return False
    channel = _channel(named)
    return not effect["channel"] or channel is None or channel == effect["channel"]


def _holds(named: Mapping[str, Any], effect: Mapping[str, Any]) -> bool:
    return _same(named, effect) or effect["id"] in (named.get("indistinguishable_from") or [])


def _where(
    effects: Sequence[Mapping[str, Any]], found: Mapping[str, Any], detected: bool, titles: Sequence[str]
) -> dict[str, Any]:
    """Whether the first place named is one where the effect shows: a channel that feels it, at a time when it does.

    None of each where nothing was detected, or an answer gives no places at all.
    """
    row: dict[str, Any] = {"place_right": None, "channel_right": None, "dependence_right": None}
    places = list(found.get("where") or [])
    if not effects or not detected:
        return row
    cells = [cell for e in effects for cell in e["where"]]
    top = places[0] if places else {}
    felt: dict[str, float] = {}
    for cell in cells:
        felt[cell["channel"]] = felt.get(cell["channel"], 0.0) + cell["share"]
    if "where" in found:
        row["channel_right"] = bool(felt.get(top.get("channel", ""), 0.0) >= FELT)
        number = _number(top.get("recording"), titles)
        row["place_right"] = row["channel_right"] and any(
            cell["channel"] == top["channel"]
            and (number is None or cell["recording"] == number)
            and float(top.get("start", -math.inf)) <= cell["end"]
            and float(top.get("end", math.inf)) >= cell["start"]
            for cell in cells
        )
    wanted = effects[0]["depends_on"]
    if effects[0]["kind"] == "outside" and wanted:
        said = " ".join(str(p.get("depends_on") or "") for p in places)
        said += " " + str((found.get("remaining") or {}).get("depends_on") or "")
        row["dependence_right"] = any(word in said for word in SAME_AS.get(wanted, (wanted,)))
    return row


def _number(name: Any, titles: Sequence[str]) -> int | None:
    """Index of a recording from its file's stem, r1, or its title."""
    text = str(name)
    if text in titles:
        return list(titles).index(text)
    stem = text.rpartition("/")[2].partition(".")[0]
    return int(stem[1:]) - 1 if stem[:1] == "r" and stem[1:].isdigit() else None


def _parameters(effect: Mapping[str, Any], named: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Each true parameter that the diagnosis gives a value for."""
    match = next((n for n in named if _same(n, effect)), None)
    rows = []
    for name, value in effect["parameters"].items():
        given = ((match or {}).get("parameters") or {}).get(name)
        if not isinstance(given, Mapping) or not isinstance(given.get("value"), (int, float)):
            continue
        low, high = given.get("low"), given.get("high")
        known = isinstance(low, (int, float)) and isinstance(high, (int, float))
        rows.append(
            {
                "effect": effect["id"],
                "name": name,
                "truth": value,
                "value": given["value"],
                "low": low,
                "high": high,
                "error": abs(given["value"] - value) / abs(value) if value else None,
                "covers": low <= value <= high if known else None,
            }
        )
    return rows


def _held_out(found: Mapping[str, Any]) -> dict[str, Any]:
    """Held-out NRMSE before and after."""
    held = ((found.get("fit") or {}).get("held_out")) or {}
    before, after = (held.get(key) or {} for key in ("before", "after"))
    return {"before": before.get("nrmse"), "after": after.get("nrmse")}


def _middle(values: Sequence[float]) -> float | None:
    ordered = sorted(values)
    return ordered[len(ordered) // 2] if ordered else None
