"""Scores of many cases added up: the confusion matrix and not the best case, intervals instead of bare shares."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rollover.proof.counts import Row, counted, mean, median, quantile, share
from rollover.proof.graded import ONE, real
from rollover.proof.probabilities import reliability

STRENGTHS = ((0.0, 5.0), (5.0, 20.0), (20.0, 100.0), (100.0, 500.0), (500.0, float("inf")))  # signal to noise
NOISES = ((0.0, 0.005), (0.005, 0.01), (0.01, 0.02), (0.02, 1.0))  # of the range
NULLS = ("null", "decoy", "negligible", "background")
NOBODY = "nothing"


def uniformity(p_values: Sequence[float]) -> dict[str, Any]:
    """Kolmogorov-Smirnov test of p-values against the uniform distribution; None for fewer than five."""
    if len(p_values) < 5:
        return {"of": len(p_values), "statistic": None, "p_value": None}
    from scipy.stats import kstest

    found = kstest(p_values, "uniform")
    return {"of": len(p_values), "statistic": float(found.statistic), "p_value": float(found.pvalue)}


def tally(rows: Sequence[Row]) -> dict[str, Any]:
    """All cases together; see the keys. A failed diagnosis counts as nothing detected, and is listed."""
    singles = [r for r in rows if r["kind"] in ONE]
    pairs = [r for r in rows if r["kind"] == "pair"]
    outside = [r for r in rows if r["kind"] == "outside"]
    nulls = [r for r in rows if r["kind"] in NULLS]
    parameters = [p for r in rows for p in r["parameters"]]
    sets = [len(r["set"]) for r in singles if r["detected"] and r["set"]]
    errors = [p["error"] for p in parameters if p["error"] is not None]
    bare = [r for r in nulls if r["kind"] != "negligible" and not r.get("background")]
    return {
        "cases": len(rows),
        "failed": [r["case"] for r in rows if r["failed"]],
        "false_alarms": counted(nulls, "false_alarm"),
        "false_alarms_by_kind": {k: counted([r for r in nulls if r["kind"] == k], "false_alarm") for k in NULLS},
        "p_values": uniformity([r["p_value"] for r in bare if r["p_value"] is not None]),
        "detected": counted(singles, "detected"),
        "named_first": counted(singles, "first"),
        "in_set": counted(singles, "in_set"),
        "alone_and_right": counted(singles, "alone"),
        "set_size": {"mean": mean(sets), "median": median(sets)},
        "verdict_right": counted(rows, "verdict_right"),
        "channel_right": counted(rows, "channel_right"),
        "place_right": counted(rows, "place_right"),
        "parameter_error": {"of": len(errors), "median": median(errors), "p90": quantile(errors, 0.9)},
        "coverage": counted(parameters, "covers"),
        "held_out": _held_out(singles),
        "two_effects": {
            "detected": counted(pairs, "detected"),
            "strongest_first": counted(pairs, "first"),
            "both": counted(pairs, "both"),
            "both_in_sets": counted(pairs, "both_in_sets"),
        },
        "outside": {
            **{claim: _claims(outside, claim) for claim in ("unexplained", "near", "wrong", "missed")},
            "dependence_right": counted(outside, "dependence_right"),
            "by_kind": _by(outside, _strongest, _outside_row),
        },
        "by_effect": _by(singles, _strongest, _row),
        "by_strength": _by(singles, lambda r: _bin(r["signal_to_noise"], STRENGTHS), _row),
        "by_noise": _by(singles, lambda r: _bin(r["noise_share"], NOISES), _row),
        "by_recordings": _by(singles, lambda r: str(r["recordings"]), _row),
        "confusion": confusion(rows),
        "real": real(rows, NULLS),
        "probabilities": reliability(rows),
        "misses": [_miss(r) for r in rows if _is_wrong(r)],
        "seconds": {
            "median": median([r["seconds"] for r in rows]),
            "most": max((r["seconds"] for r in rows), default=None),
        },
    }


def confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Truth -> what was named first -> how often, pairs left out; `nothing` and verdicts stand for themselves."""
    table: dict[str, dict[str, int]] = {}
    for row in rows:
        if row["kind"] == "pair":
            continue
        truth = NOBODY if row["kind"] in NULLS or not row["truth"] else row["truth"][0]
        said = row["claimed"] or (row["verdict"] if row["detected"] else NOBODY)
        line = table.setdefault(truth, {})
        line[said] = line.get(said, 0) + 1
    return {truth: dict(sorted(line.items(), key=lambda item: -item[1])) for truth, line in sorted(table.items())}


def table(result: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    """Rows of one of the `by_` tables for a page: shares as numbers, one row each."""
    rows = []
    for key, found in result[name].items():
        row: dict[str, Any] = {name.removeprefix("by_"): key}
        for column, value in found.items():
            row[column] = value["share"] if isinstance(value, Mapping) and "share" in value else value
        rows.append(row)
    return rows


def _strongest(row: Row) -> str:
    return str(row["truth"][0])


def _bin(value: float | None, bins: Sequence[tuple[float, float]]) -> str:
    for low, high in bins:
        if value is not None and low <= value < high:
            return f"{low:g} to {high:g}"
    return "not known"


def _by(
    rows: Sequence[Row], key: Callable[[Row], str], line: Callable[[Sequence[Row]], dict[str, Any]]
) -> dict[str, dict[str, Any]]:
    groups: dict[str, list[Row]] = {}
    for row in sorted(rows, key=lambda r: r["signal_to_noise"]):
        groups.setdefault(key(row), []).append(row)
    return {name: line(group) for name, group in groups.items()}


def _row(rows: Sequence[Row]) -> dict[str, Any]:
    found = [p for r in rows for p in r["parameters"]]
    errors = [p["error"] for p in found if p["error"] is not None]
    return {
        "cases": len(rows),
        "detected": counted(rows, "detected"),
        "first": counted(rows, "first"),
        "in_set": counted(rows, "in_set"),
        "alone": counted(rows, "alone"),
        "parameter_error": median(errors),
        "coverage": counted(found, "covers"),
        "signal_to_noise": median([r["signal_to_noise"] for r in rows]),
    }


def _outside_row(rows: Sequence[Row]) -> dict[str, Any]:
    claims = ("unexplained", "near", "wrong", "missed")
    return {
        "cases": len(rows),
        **{claim: sum(_is_claim(r, claim) for r in rows) for claim in claims},
        "dependence_right": counted(rows, "dependence_right"),
        "signal_to_noise": median([r["signal_to_noise"] for r in rows]),
    }


def _is_claim(row: Row, claim: str) -> bool:
    return str(row["claim"] or "").split(",")[0] == claim


def _claims(rows: Sequence[Row], claim: str) -> dict[str, Any]:
    return share(sum(_is_claim(r, claim) for r in rows), len(rows))


def _held_out(rows: Sequence[Row]) -> dict[str, Any]:
    """Ratio of the held-out NRMSE after and before, where something was named."""
    ratios = [
        r["held_out"]["after"] / r["held_out"]["before"]
        for r in rows
        if r["claimed"] and r["held_out"]["before"] and r["held_out"]["after"] is not None
    ]
    return {"of": len(ratios), "median_ratio": median(ratios), "worse": sum(ratio > 1.0 for ratio in ratios)}


def _is_wrong(row: Row) -> bool:
    if row["failed"] or row["false_alarm"] or str(row["claim"] or "").startswith("wrong"):
        return True
    return row["in_set"] is False or (row["kind"] == "pair" and row["both_in_sets"] is False)


def _miss(row: Row) -> dict[str, Any]:
    keys = ("case", "kind", "truth", "verdict", "claimed", "set", "named", "signal_to_noise", "over_noise", "claim")
    return {key: row[key] for key in keys}
