"""Names are those of the field: no identifier holds a word that only this project ever used for a standard thing."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("rollover", "ground", "viz", "tests")
PRIVATE = {  # word -> what the field says
    "aftermath": "record truncation",
    "akin": "same family",
    "bursts": "outliers",
    "chords": "frequency scan",
    "crew": "executor",
    "door": "entry point, CLI helper",
    "doors": "entry points, CLI helpers",
    "doubts": "nuisance marginalisation",
    "eased": "marginalised",
    "foretold": "refitted cross-validation",
    "forgiven": "masked at jumps, weighted down",
    "freed": "Schur complement",
    "hats": "linear B-splines",
    "hums": "spectral lines",
    "instead": "swap step",
    "is_any_curve": "over-flexible",
    "is_rough": "model error dominates",
    "kin": "same family",
    "leap": "jump, discontinuity",
    "leaps": "jumps, discontinuities",
    "lent": "reused Jacobian columns",
    "lookout": "parallel map",
    "loudness": "heteroscedasticity",
    "may_be_nothing": "interval contains null",
    "misstated": "wrong condition",
    "narrowed": "step-size control",
    "needless": "backward elimination",
    "nudge": "finite-difference step",
    "nudged": "finite-difference step",
    "odds": "probability",
    "outlasts": "ensemble-validated gain",
    "pinned": "fixed time shifts",
    "probes": "start grid",
    "remainder": "adequacy test",
    "ripples": "local minima",
    "shiftless": "Schur complement",
    "soon": "record truncation",
    "straying": "heavy-tailed residual model",
    "strays": "ensemble perturbations",
    "sudden": "discontinuous",
    "surely_there": "significant by Wald",
    "teeth": "grid scan",
    "thrifty": "drops or full runs: a forward model",
    "triggers": "onset detection",
    "two_by_two": "best-subset search",
    "valley": "ridge",
    "valleys": "local minima",
    "way_down": "truncated warm start",
    "weigh": "with_noise_model",
    "weighed": "weighted",
    "yardstick": "strength parameter",
}
# words that were private in one sense and stay in the one that the field has; once each, so that a reader finds why
STANDARD = {
    "account": "energy account of the ledger",
    "approach": "closing speed of a contact; nearing a limit",
    "bare": "a number without a unit, a column without a name, a channel without its background",
    "bent": "bending of members, posts and bodies",
    "block": "of an array or matrix, of text, the pendulum's block; `ResidualBlock` is a block of the stacked residual",
    "blow": "one strike of a pendulum or hammer, as in test codes and pile driving",
    "clocks": "recorders' clocks",
    "colour": "spectrum of a noise; of what is drawn",
    "confusion": "confusion matrix, confusion set",
    "course": "time course",
    "digits": "of a number",
    "ends": "of a range, of a run",
    "evidence": "Bayesian evidence",
    "form": "functional form; FORM, the first-order reliability method; weak form",
    "gate": "a gate of a build",
    "hat": "Gelman and Rubin's R-hat",
    "held_out": "held-out recordings",
    "hum": "mains hum, a fault of instruments that the proof draws",
    "job": "of a cluster, of the corpus",
    "joint": "of a mechanism",
    "judge": "the oracle of the fuzzer",
    "kept": "left as it was, stored",
    "lines": "of a file; spectral lines",
    "looks": "how a series is drawn in the viewer",
    "narrow": "narrow-track tractors of OECD Codes 6 and 7; a small width",
    "needed": "an installed package, a stiffness that is needed",
    "neighbours": "samples beside a sample",
    "neutral": "value at which a scale or an offset does nothing (CF conventions)",
    "null": "null value, null hypothesis",
    "phi": "angle of internal friction",
    "places": "of a list, of a scan of offsets",
    "reaches": "how far something extends",
    "readings": "of an instrument",
    "response": "of an instrument, of a linear system",
    "rings": "circles of sample points",
    "roughness": "of a surface",
    "says": "what a text holds",
    "secant": "secant stiffness",
    "series": "time series; springs in series",
    "settle": "coming to rest, of soil and of files on a disk",
    "settled": "at rest",
    "shapes": "of bodies and arrays",
    "shown": "what is displayed",
    "slips": "of contacts",
    "told": "what was printed",
    "weak": "hardly determined; weak form",
    "zeros": "of clocks and sensors",
}


def names(source: str) -> Iterator[str]:
    """Identifiers that a source defines: functions, classes, arguments, variables, attributes."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield node.name
            case ast.arg():
                yield node.arg
            case ast.Name(ctx=ast.Store()):
                yield node.id
            case ast.Attribute(ctx=ast.Store()):
                yield node.attr


def words(name: str) -> str:
    """A name as words between underscores: `_isRough` is `_is_rough_`."""
    return f"_{re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower().strip('_')}_"


def defined() -> Iterator[tuple[str, str]]:
    """Every identifier with the file that defines it, modules and packages too."""
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            place = path.relative_to(ROOT)
            yield from ((words(part), str(place)) for part in place.with_suffix("").parts)
            yield from ((words(name), str(place)) for name in names(path.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def every() -> set[tuple[str, str]]:
    """All of them, once each."""
    return set(defined())


def test_no_identifier_holds_a_private_word(every: set[tuple[str, str]]) -> None:
    assert len(every) > 20_000
    found = {(name, place, PRIVATE[w]) for name, place in every for w in PRIVATE if f"_{w}_" in name}
    assert found == set()


def test_what_stays_in_its_standard_sense_is_in_use(every: set[tuple[str, str]]) -> None:
    used = {w for name, _ in every for w in STANDARD if f"_{w}_" in name}
    assert used == set(STANDARD)
    assert PRIVATE.keys().isdisjoint(STANDARD)


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("def _kin(way_down): pass", {"_kin_", "_way_down_"}),
        ("class CrewMember:\n    valleys: int = 3\n    self.leaps = 1", {"_crew_member_", "_valleys_", "_leaps_"}),
        ("skin, akimbo, leaping = f(door=doors)", {"_skin_", "_akimbo_", "_leaping_"}),
    ],
)
def test_a_word_is_found_in_any_identifier_and_no_longer_one(source: str, found: set[str]) -> None:
    assert {words(name) for name in names(source)} == found
    assert any(f"_{w}_" in name for name in found for w in PRIVATE) is ("skin" not in source)
