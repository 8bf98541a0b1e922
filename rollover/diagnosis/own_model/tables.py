"""A model's channels and terms in the tables of channels and effects, as long as it is diagnosed.

What selects, fits and reports looks effects up by id and channels by name. A model's terms stand there as classes made
from what it declares, beside the effects of sensors and instead of all others: those act on a scenario.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import numpy as np

from ground.quantity import Quantity, parameters
from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.parameterisation import Candidate, coordinates
from rollover.diagnosis.own_model.declaration import BASELINE, ForwardModel, Parameter, Term, sensors_of
from rollover.diagnosis.selection.candidates import of_sensors
from rollover.effects import EFFECTS, Effect, Search, effects
from rollover.spec.channels import CHANNELS, Channel


@contextmanager
def tables(model: ForwardModel) -> Iterator[None]:
    """Within it channels and terms are the model's, and afterwards what they were before."""
    effects()  # those in files of one's own as well: loaded within, they would be gone afterwards
    channels, known = dict(CHANNELS), dict(EFFECTS)
    try:
        enter(model)
        yield
    finally:
        for table, before in ((CHANNELS, channels), (EFFECTS, known)):
            table.clear()
            table.update(before)  # type: ignore[arg-type]


def enter(model: ForwardModel) -> None:
    """Enter channels and terms, for good: in a child process, which serves one diagnosis."""
    for name, q in {**model.inputs, **model.outputs}.items():
        CHANNELS.setdefault(name, Channel(name=name, unit=q.unit, meaning=q.meaning))
    for id in [id for id, kind in EFFECTS.items() if kind.kind != "sensor"]:
        del EFFECTS[id]
    baseline = Term(id=BASELINE, family="the model itself", equation="", kind="parameter", parameters=model.parameters)
    for term in (baseline, *model.terms):
        _effect_of(term)


def _effect_of(term: Term) -> type[Effect]:
    """The class of effects that a term stands for; it enters the table as it is made."""
    each = _ordered(term)
    said = ", ".join(f"{name} {{{name}}}" for name in each)
    own: dict[str, Any] = {
        "__module__": __name__,
        "__annotations__": {n: Annotated[float, Quantity(p.unit, p.meaning)] for n, p in each.items()},
        **{n: float(p.start) for n, p in each.items()},
        "id": term.id,
        "kind": term.kind,
        "family": term.family,
        "equation": term.equation,
        "sentence": term.sentence
        or f"There is {term.family}: {term.equation.replace('{', '{{').replace('}', '}}')} ({said}).",
        "rivals": dict(term.rivals),
        "competes": term.id != BASELINE,
        "null": {n: float(p.null) for n, p in each.items() if p.null is not None},
        "search": {n: Search(float(p.low), float(p.high), p.scale) for n, p in each.items()},
    }
    return parameters(type(term.id, (Effect,), own))


def _ordered(term: Term) -> dict[str, Parameter]:
    """Parameters of a term, first those that say where it acts: over these a look goes in finer steps."""
    each = term.parameters.items()
    return dict([*((n, p) for n, p in each if p.null is None), *((n, p) for n, p in each if p.null is not None)])


def candidate_of(term: Term) -> Candidate:
    """A term as it is looked for."""
    kind = EFFECTS[term.id]
    return Candidate(id=term.id, kind=kind.kind, family=kind.family, search=dict(kind.search))


def baseline_of(model: ForwardModel) -> tuple[tuple[Candidate, ...], tuple[float, ...]]:
    """What is always fitted as a candidate, and the coordinates at which it begins; nothing of a model without any."""
    if not model.parameters:
        return (), ()
    kind = EFFECTS[BASELINE]
    search = dict(kind.search)
    start = coordinates({name: p.start for name, p in model.parameters.items()}, search)
    return (Candidate(id=BASELINE, kind=kind.kind, family=kind.family, search=search, is_baseline=True),), start


def candidates_of_model(model: ForwardModel, dataset: Sequence[Dataset]) -> list[Candidate]:
    """Who competes: the model's terms, and the effects of sensors on each channel that was recorded."""
    allowed = sensors_of(model)
    return [*map(candidate_of, model.terms), *(c for c in of_sensors(dataset) if c.id in allowed)]


def stretches(time: np.ndarray, samples: int) -> tuple[tuple[float, str], ...]:
    """(start s, name) of stretches of a recording of about so many samples each."""
    many = max(1, round(time.size / samples))
    firsts = [round(k * time.size / many) for k in range(many)]
    return tuple((float(time[first]), f"part {k + 1} of {many}") for k, first in enumerate(firsts))
