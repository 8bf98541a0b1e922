"""A diagnosis as its files: diagnosis.json, and the scenario with what was found switched on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from rollover.assessment.results import plain, versions
from rollover.calibration import posterior
from rollover.diagnosis.result import Diagnosis, Draws, Interval, Law, Location, Named, Score
from rollover.effects import nth
from rollover.recording import Recording
from rollover.recording.importers import read_named
from rollover.scenario import Scenario
from rollover.spec.document import dump

FORMAT = "rollover-diagnosis/1"
JSON, SCENARIO, PAGE, PICTURE = "diagnosis.json", "scenario-diagnosed.yaml", "report.html", "diagnosis.rrd"
DRAWS = "posterior.csv"
REFERENCE = "reference"  # what the names of references begin with
FILES = (JSON, SCENARIO, PAGE, PICTURE, DRAWS)


def json_of(
    found: Diagnosis, about: Mapping[str, Any] | None = None, prechecks: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any]:
    """What diagnosis.json says, bare JSON values; `about` names what was asked, `prechecks` what sensors gave away."""
    depends = dict.fromkeys(("depends_on",), found.depends_on)
    answer: dict[str, Any] = plain(
        {
            "format": FORMAT,
            **(about or {}),
            "verdict": found.verdict,
            "answer": found.answer,
            "sentence": found.sentence,
            "remaining": {
                "significant": found.remaining_significant,
                "p_value": found.remaining_p_value,
                "where": [asdict(p) for p in found.remaining_where],
                **(depends if found.remaining_significant and not found.effects else {"depends_on": None}),
            },
            "smallest_detectable": {k: v for k, v in found.smallest_detectable.items() if isfinite(v)},
            "significance": {"p_value": found.p_value, "noise": dict(found.noise)},
            "where": [_location(p) for p in found.where],
            "depends_on": found.depends_on,
            "dependencies": [{"on": name, "share": share} for name, share in found.dependencies],
            "degrees_of_freedom": [asdict(d) for d in found.degrees],
            "effects": [_effect(e) for e in found.effects],
            **({"probabilities": dict(found.probabilities)} if found.probabilities else {}),
            "discrepancy": {channel: asdict(scale) for channel, scale in found.discrepancy.items()},
            "invariants": {"checked": len(found.checked), "broken": list(found.broken)},
            "fit": {
                "training": _fit(found, "training", found.training),
                "held_out": _fit(found, "held_out", found.held_out),
                "recordings": [{"name": n, "before": a, "after": b} for n, a, b in found.per_recording],
            },
            **({} if found.empirical is None else {"empirical": _law(found.empirical)}),
            "candidates": [asdict(c) for c in found.candidates],
            "simulations": found.simulations,
            "seconds": found.seconds,
            "prechecks": list(prechecks),
            "clocks": {name: zero.answer for name, zero in found.clocks.items()},
            "notes": list(found.notes),
            **({} if found.posterior is None else {"posterior": _posterior(found.posterior)}),
            "versions": versions(),
        }
    )
    return answer


def _posterior(drawn: Draws) -> dict[str, Any]:
    prior = "uniform over the range of the search, of the logarithm where that is looked for"
    return posterior.summary(drawn.names, drawn.values, drawn.convergence, prior)


def _location(location: Location) -> dict[str, Any]:
    return asdict(location)


def _effect(effect: Named) -> dict[str, Any]:
    return {
        "id": effect.id,
        "kind": effect.kind,
        **({} if effect.channel is None else {"channel": effect.channel}),
        "answer": effect.answer,
        "explains": None if effect.explains is None else _finite(asdict(effect.explains)),
        "moves_leading_load_by": effect.moves,
        "statement": effect.statement,
        "parameters": {name: _interval(i) for name, i in effect.parameters.items()},
        "p_value": effect.p_value,
        "indistinguishable_from": list(effect.indistinguishable_from),
        "discriminating_test": effect.discriminating_test,
        **({} if effect.next_test is None else {"next_test": asdict(effect.next_test)}),
    }


def _finite(numbers: Mapping[str, float]) -> dict[str, float | None]:
    """Numbers, none where there is no end of an interval."""
    return {name: v if isfinite(v) else None for name, v in numbers.items()}


def _interval(interval: Interval) -> dict[str, Any]:
    return {k: v for k, v in asdict(interval).items() if v is not None}


def _law(law: Law) -> dict[str, Any]:
    return {
        "law": law.law,
        "terms": [{"term": t.term, "depends_on": t.depends_on, "coefficient": _interval(t.force)} for t in law.terms],
        "held_out_gain": law.held_out_gain,
        "standard_error": law.standard_error,
        "held_out": {"before": {"nrmse": law.before}, "after": {"nrmse": law.after}},
        "settings": dict(law.settings),
    }


def _fit(found: Diagnosis, which: str, names: tuple[str, ...]) -> dict[str, Any]:
    def score(scores: Mapping[str, Score]) -> dict[str, Any]:
        return asdict(scores[which]) if which in scores else {}

    return {"recordings": list(names), "before": score(found.before), "after": score(found.after)}


def diagnosed_scenario(scenario: Scenario, found: Diagnosis) -> Scenario:
    """The scenario with the found effects, or the law found by regression, switched on and fitted."""
    ids = [e.id for e in found.effects]
    changes = {
        f"effects.{nth(e.id, 1 + ids[:k].count(e.id))}": dict(e.settings)
        for k, e in enumerate(found.effects)
        if e.settings
    }
    if found.empirical is not None:
        changes["effects.empirical"] = dict(found.empirical.settings)
    return scenario.replaced(changes, origin="diagnosis") if changes else scenario


def diagnosed_text(scenario: Scenario, found: Diagnosis) -> str:
    """scenario-diagnosed.yaml: `rollover run` accepts it."""
    return dump(diagnosed_scenario(scenario, found), f"{scenario.title}\nDiagnosed: {found.sentence}")


def recordings_in(folder: Path) -> list[tuple[str, Recording]]:
    """Name and recording of each table in a folder, by name. Raises `InputError`."""
    return [(name, recording) for name, (_, recording) in read_named([folder]).items()]
