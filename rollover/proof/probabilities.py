"""Probabilities over names against the truth: Brier score, log score, and whether what is given 90 % comes nine in ten.

A diagnosis gives them as {id: p, ..., "nothing": p, "not-listed": p}; a name that it does not mention has none. One
name is true in a case: that of the strongest effect, "nothing" where nothing worth naming is, "not-listed" where no
table holds it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rollover.proof.counts import Row, mean, share

NOTHING, NOT_LISTED = "nothing", "not-listed"
LEAST = 1e-3  # probability below which a log score grows no further: one case in a thousand shows no difference
OFF = 0.01  # by which a sum of probabilities may be off one, for rounded digits
EDGES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def name_of(effects: Sequence[Mapping[str, Any]]) -> str:
    """The name that is true; `effects` that are worth naming, strongest first."""
    if not effects:
        return NOTHING
    return NOT_LISTED if effects[0]["kind"] == "outside" else str(effects[0]["id"])


def scored(given: Any, truth: str) -> dict[str, Any] | None:
    """Brier and log score of one case, and each probability with whether it came true; None where none are given.

    `flaw` says why they are no probabilities; such are not scored.
    """
    if given is None:
        return None
    if what := flaw(given):
        return {"flaw": what}
    p = {str(name): float(value) for name, value in given.items()}
    brier = sum((value - (name == truth)) ** 2 for name, value in p.items()) + (0.0 if truth in p else 1.0)
    return {
        "flaw": "",
        "truth": truth,
        "brier": brier,
        "log": -math.log(max(p.get(truth, 0.0), LEAST)),
        "pairs": [[value, name == truth] for name, value in p.items()],
    }


def flaw(given: Any) -> str:
    """Why these are no probabilities over names; nothing if they are."""
    if not isinstance(given, Mapping) or not given:
        return "no mapping of names"
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
            return f"{name}: {value!r} is no probability"
    total = float(sum(given.values()))
    return f"they add up to {total:.3g}" if abs(total - 1.0) > OFF else ""


def reliability(rows: Sequence[Row]) -> dict[str, Any] | None:
    """Scores over all cases with probabilities, and the diagram: given, came true, by bins; None where none are given.

    `slope` is of the straight line through all pairs of a probability and whether it came true: 1 where they are right,
    less where they are too sure.
    """
    cases = [r["probabilities"] for r in rows if r.get("probabilities")]
    if not cases:
        return None
    fine = [c for c in cases if not c["flaw"]]
    pairs = [(float(p), bool(hit)) for c in fine for p, hit in c["pairs"]]
    return {
        "cases": len(fine),
        "flawed": [c["flaw"] for c in cases if c["flaw"]],
        "brier": mean([c["brier"] for c in fine]),
        "log": mean([c["log"] for c in fine]),
        "slope": _slope(pairs),
        "bins": _bins(pairs),
    }


def _slope(pairs: Sequence[tuple[float, bool]]) -> float | None:
    given = np.array([p for p, _ in pairs])
    if given.size < 2 or np.ptp(given) == 0.0:
        return None
    return float(np.polyfit(given, np.array([float(hit) for _, hit in pairs]), 1)[0])


def _bins(pairs: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    found = []
    for low, high in itertools.pairwise(EDGES):
        here = [(p, hit) for p, hit in pairs if low <= p < high or (high == EDGES[-1] and p == high)]
        if here:
            given = mean([p for p, _ in here])
            found.append({"from": low, "to": high, "given": given, "right": share(sum(h for _, h in here), len(here))})
    return found
