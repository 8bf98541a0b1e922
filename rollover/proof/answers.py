"""Anyone's answers to sealed cases: how they are written down, what is refused, and their score."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, Literal

from ground.quantity import Quantity, parameters
from rollover.proof.probabilities import NOT_LISTED, NOTHING, flaw
from rollover.proof.score import score
from rollover.proof.sealed_cases import Sealed, truths_of
from rollover.proof.summary import tally
from rollover.spec import document
from rollover.system.arguments import is_finite_number
from rollover.system.errors import Fault, InputError, hint

FORMAT, SCORE_FORMAT = "rollover-answers/1", "rollover-score/1"
NAMING = ("missing-physics", "parameter", "sensor")
KEYS = ("value", "low", "high")


@parameters
class Name:
    """An effect that is named, with what cannot be told from it and its numbers."""

    id: str
    channel: Annotated[str | None, "of a sensor's effect"] = None
    indistinguishable_from: tuple[str, ...] = ()
    parameters: Annotated[Mapping[str, Any], "name -> {value, low, high}, SI"] = field(default_factory=dict)

    def validate(self) -> None:
        """Refuse numbers that are none, and an interval that its value lies outside of."""
        for name, given in self.parameters.items():
            at = f"parameters.{name}"
            if not isinstance(given, Mapping) or "value" not in given or set(given) - set(KEYS):
                raise ValueError(f"{at}: got {given!r}; {{value: 1.0}}, or {{value: 1.0, low: 0.9, high: 1.1}}")
            for key, value in given.items():
                if not is_finite_number(value):
                    raise ValueError(f"{at}.{key}: not a number, got {value!r}; a finite one")
            if ("low" in given) != ("high" in given):
                raise ValueError(f"{at}: one end of an interval, got {dict(given)!r}; `low` and `high`, or neither")
            if "low" in given and not given["low"] <= given["value"] <= given["high"]:
                raise ValueError(f"{at}: value outside its interval, got {dict(given)!r}; low <= value <= high")


@parameters
class Answer:
    """What is said of one case."""

    case: str
    verdict: Literal["missing-physics", "parameter", "sensor", "no-mismatch", "cannot-tell", "unexplained", "no-answer"]
    effects: Annotated[tuple[Name, ...], "what is named, the strongest first"] = ()
    probabilities: Annotated[Mapping[str, Any] | None, "over ids, `nothing` and `not-listed`"] = None
    seconds: Annotated[float, Quantity("s", "that it took", least=0)] = 0.0

    def validate(self) -> None:
        """Refuse a verdict that does not go with what is named, and probabilities that are none."""
        if self.verdict in NAMING and not self.effects:
            raise ValueError(f"effects: none named, got the verdict {self.verdict!r}; at least one, or another verdict")
        if self.effects and self.verdict not in NAMING:
            names = ", ".join(e.id for e in self.effects)
            raise ValueError(f"verdict: names nothing, got {self.verdict!r} beside {names}; {', '.join(NAMING)}")
        if self.probabilities is not None and (what := flaw(self.probabilities)):
            raise ValueError(f"probabilities: {what}; numbers from 0 to 1 that add up to 1")


@parameters
class Answers:
    """A file of answers to all cases of a folder."""

    format: Literal["rollover-answers/1"]
    by: Annotated[str, "method and version"] = ""
    seal: Annotated[str, "digest of the seal.json of the cases that are answered"]
    answers: tuple[Answer, ...]


def read_answers(path: Path, given: Sealed) -> Answers:
    """Answers that fit the cases. Raises `InputError`, each fault in a line with its place in the file."""
    found: Answers = document.load(path, Answers)
    faults = [Fault(file=str(path), path=where, message=what) for where, what in _faults(found, given)]
    if faults:
        raise InputError(*faults)
    return found


def _faults(found: Answers, given: Sealed) -> Iterator[tuple[str, str]]:
    """Places and messages of what does not fit the cases."""
    if found.seal != given.digest:
        yield "seal", f"of other cases, got {found.seal!r}; {given.digest} of {given.folder / 'seal.json'} is needed"
        return
    seen: set[str] = set()
    for k, answer in enumerate(found.answers):
        at = f"answers.{k}"
        if answer.case not in given.cases:
            yield f"{at}.case", f"no such case, got {answer.case!r}; {hint(answer.case, given.cases)}"
        elif answer.case in seen:
            yield f"{at}.case", f"answered twice, got {answer.case!r}; each case once"
        seen.add(answer.case)
        for j, name in enumerate(answer.effects):
            yield from _unknown(f"{at}.effects.{j}", name, given)
        for id in answer.probabilities or {}:
            if id not in given.candidates and id not in (NOTHING, NOT_LISTED):
                known = hint(str(id), [*given.candidates, NOTHING, NOT_LISTED])
                yield f"{at}.probabilities", f"no such candidate, got {id!r}; {known}"
    if missing := [case for case in given.cases if case not in seen]:
        shown = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
        yield "answers", f"not answered: {shown}; every case, with the verdict no-answer where there is none"


def _unknown(at: str, name: Name, given: Sealed) -> Iterator[tuple[str, str]]:
    for id in (name.id, *name.indistinguishable_from):
        if id not in given.candidates:
            yield at, f"no such candidate, got {id!r}; {hint(id, given.candidates)}"
            return
    own = given.candidates[name.id]
    for parameter in name.parameters:
        if parameter not in own:
            yield f"{at}.parameters", f"none of {name.id}, got {parameter!r}; {hint(str(parameter), own)}"


def scored(found: Answers, given: Sealed, truth: Path) -> dict[str, Any]:
    """What score.json says: the rows and counts of a proof, of answers instead of diagnoses. Raises `InputError`."""
    by_case = {a.case: a for a in found.answers}
    rows = []
    for one in truths_of(given, truth):
        answer = by_case[one["case"]]
        said = None if answer.verdict == "no-answer" else _as_diagnosis(answer)
        rows.append({**score(one, said, answer.seconds), "failure": "" if said else "no answer"})
    return {
        "format": SCORE_FORMAT,
        "by": found.by,
        "cases": len(rows),
        "seal": given.seal,
        "summary": tally(rows),
        "rows": rows,
    }


def _as_diagnosis(answer: Answer) -> dict[str, Any]:
    """As diagnosis.json would say it."""
    effects = [
        {
            "id": e.id,
            "channel": e.channel,
            "indistinguishable_from": list(e.indistinguishable_from),
            "parameters": {name: dict(value) for name, value in e.parameters.items()},
        }
        for e in answer.effects
    ]
    more = {} if answer.probabilities is None else {"probabilities": dict(answer.probabilities)}
    return {"verdict": answer.verdict, "effects": effects, **more}
