"""What a model of one's own declares, and its file: channels, parameters that are always fitted, candidate terms."""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Formatter
from types import ModuleType
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Quantity
from rollover.effects import Effect
from rollover.effects.sensor import ORDER as SENSORS
from rollover.spec.channels import UNITS, describe, is_known
from rollover.spec.document import shipped_folder
from rollover.system import own_code
from rollover.system.arguments import is_finite_number
from rollover.system.errors import Fault, InputError, hint

FOLDER, OBJECT = "models", "model"

Array = NDArray[np.float64]

BASELINE = "baseline"  # id under which what is always fitted stands
CHANNEL = re.compile(r"[A-Za-z][A-Za-z0-9_-]*(/[A-Za-z][A-Za-z0-9_-]*)*")
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
ID = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number of a model, in `unit`: looked for from `low` to `high`, in even steps of it or of its logarithm.

    `start` is where a fit begins, of a term's parameter its typical value. At `null` a term changes nothing, by not one
    bit; a parameter of a term that says where it acts has none, and changes nothing while another one is at its null.
    """

    unit: str
    low: float
    high: float
    start: float
    null: float | None = None
    scale: Literal["linear", "log"] = "linear"
    meaning: str = ""


@dataclass(frozen=True, kw_only=True)
class Term:
    """A candidate: physics that the model may lack, or a stated value that may be wrong (`kind` "parameter").

    `family` is what a report names before the member: "a stiffness that grows with deflection". `sentence` may hold
    values as ``{parameter}`` or ``{parameter:more|less}``; `rivals` say by id which test tells a look-alike apart.
    """

    id: str
    family: str
    equation: str
    parameters: Mapping[str, Parameter]
    kind: Literal["physics", "parameter"] = "physics"
    sentence: str = ""
    rivals: Mapping[str, str] = field(default_factory=dict)


@runtime_checkable
class ForwardModel(Protocol):
    """A model that recorded inputs drive, by channel: what a recording should have shown.

    `inputs` and `outputs` are channels with unit (SI) and meaning; `parameters` are fitted in every explanation, with
    the terms or without. A model may also have `conditions`, numbers that each recording states beside its channels,
    and `sensors`, ids of the sensor effects that compete as explanations of outputs (all of them without it).
    """

    title: str
    inputs: Mapping[str, Quantity]
    outputs: Mapping[str, Quantity]
    parameters: Mapping[str, Parameter]
    terms: Sequence[Term]

    def simulate(self, time: Array, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Mapping[str, Array]:
        """Simulate one recording; the same arguments give the same outputs.

        Parameters
        ----------
        time
            Stamps (n,), s.
        inputs
            Recorded inputs (n,) by channel, SI.
        values
            All parameters by name, those of a term as "TERM.PARAMETER", at their nulls (or starts, without one) where
            the term is not there, and the recording's conditions, SI.

        Returns
        -------
        Mapping
            Outputs (n,) by channel, SI. What is not finite says that there is no solution for these values.

        Raises
        ------
        ArithmeticError
            Where there is no solution for these values.
        """


def conditions_of(model: ForwardModel) -> Mapping[str, Quantity]:
    """Numbers that each recording states for a model."""
    found: Mapping[str, Quantity] = getattr(model, "conditions", {})
    return found


def sensors_of(model: ForwardModel) -> tuple[str, ...]:
    """Ids of the sensor effects that compete beside a model's terms."""
    return tuple(getattr(model, "sensors", SENSORS))


def values_of(model: ForwardModel) -> dict[str, float]:
    """Values of a model where fits begin, all terms at their nulls."""
    found = {name: p.start for name, p in model.parameters.items()}
    for term in model.terms:
        found |= {f"{term.id}.{n}": p.start if p.null is None else p.null for n, p in term.parameters.items()}
    return found


def file_of(model: ForwardModel) -> str:
    """The file in which a model's class stands; the class's name where there is none."""
    try:
        return inspect.getfile(type(model))
    except (TypeError, OSError):
        return type(model).__qualname__


def declared(model: object, file: str = "") -> ForwardModel:
    """The model, if what it declares can be used. Raises `InputError` with a line for each fault."""
    where = file or file_of(model)  # type: ignore[arg-type]
    faults = [Fault(file=where, path=path, message=message) for path, message in _wrong(model)]
    if faults:
        raise InputError(*faults)
    assert isinstance(model, ForwardModel)
    return model


def _wrong(model: Any) -> Iterator[tuple[str, str]]:
    """What is wrong with a declaration: where, and in words."""
    kinds: dict[str, Any] = {
        "title": str, "inputs": Mapping, "outputs": Mapping, "parameters": Mapping, "terms": Sequence
    }  # fmt: skip
    missing = [name for name in (*kinds, "simulate") if not hasattr(model, name)]
    if missing:
        yield "", f"no forward model: without {', '.join(missing)}; {', '.join((*kinds, 'simulate'))} are needed"
        return
    wrong = [(n, type(getattr(model, n)).__name__) for n, k in kinds.items() if not isinstance(getattr(model, n), k)]
    for name, got in wrong:
        yield name, f"not of the right type, got {got}; a {kinds[name].__name__.lower()} is needed"
    if wrong:
        return
    if wrong_types := list(_wrong_types(model)):
        yield from wrong_types  # what else is asked of them has no meaning
        return
    yield from _wrong_channels(model)
    if not callable(model.simulate):
        yield "simulate", f"not a method, got {model.simulate!r}; simulate(time, inputs, values) is needed"
    for name, p in model.parameters.items():
        yield from _wrong_parameter(f"parameters.{name}", name, p, is_always=True)
    for name in {*model.parameters} & {*conditions_of(model)}:
        yield f"conditions.{name}", f"a parameter as well, got {name!r}; another name is needed"
    yield from _wrong_terms(model)
    for sensor in sensors_of(model):
        if sensor not in SENSORS:
            yield "sensors", f"unknown sensor effect, got {sensor!r}; {hint(sensor, SENSORS)}"


TEXTS: Mapping[type, tuple[str, ...]] = {
    Term: ("id", "family", "equation", "sentence", "kind"),
    Parameter: ("unit", "meaning", "scale"),
    Quantity: ("unit", "meaning"),
}


def _wrong_types(model: Any) -> Iterator[tuple[str, str]]:
    """What is no text, no mapping or no list of texts where one is declared."""
    declared: list[tuple[str, Any]] = []
    parts: list[tuple[str, Any]] = [(n, getattr(model, n)) for n in ("inputs", "outputs", "parameters")]
    for k, term in enumerate(model.terms):
        declared.append((f"terms[{k}]", term))
        parts += [(f"terms[{k}].{n}", getattr(term, n)) for n in ("parameters", "rivals") if isinstance(term, Term)]
    parts.append(("conditions", conditions_of(model)))
    for path, part in parts:
        if not isinstance(part, Mapping):
            yield path, f"not of the right type, got {type(part).__name__}; a mapping is needed"
            continue
        for name, value in part.items():
            declared.append((f"{path}.{name}", value))
            if not isinstance(name, str):
                yield path, f"a name that is no text, got {name!r}; a text is needed"
            if path.endswith(".rivals") and not isinstance(value, str):
                yield (
                    f"{path}.{name}",
                    f"no text, got {value!r}; a sentence on what tells them apart is needed",
                )
    for path, value in declared:
        for name in TEXTS.get(type(value), ()):
            if not isinstance(text := getattr(value, name), str):
                yield f"{path}.{name}", f"no text, got {text!r}; a text is needed"
    sensors = getattr(model, "sensors", ())
    if isinstance(sensors, str) or not isinstance(sensors, Collection) or not all(isinstance(s, str) for s in sensors):
        yield "sensors", f"no list of texts, got {sensors!r}; ids of sensor effects, or () for none, are needed"


def _wrong_terms(model: Any) -> Iterator[tuple[str, str]]:
    """What is wrong with terms."""
    ids = [getattr(t, "id", None) for t in model.terms]
    if not ids:
        yield "terms", "empty; at least one term that may be missing is needed"
    for k, term in enumerate(model.terms):
        if not isinstance(term, Term):
            yield f"terms[{k}]", f"not a term, got {type(term).__name__}; rollover.Term(...) is needed"
            continue
        if not ID.fullmatch(term.id) or term.id == BASELINE or term.id in SENSORS:
            yield f"terms[{k}].id", f"not to be used, got {term.id!r}; lower-case words joined by '-' are allowed"
        if term.id in ids[:k]:
            yield f"terms[{k}].id", f"given twice, got {term.id!r}; once is allowed"
        if term.kind not in ("physics", "parameter"):
            yield f"terms[{k}].kind", f"unknown kind, got {term.kind!r}; physics or parameter is allowed"
        for name, p in term.parameters.items():
            yield from _wrong_parameter(f"terms[{k}].parameters.{name}", name, p, is_always=False)
        known = [p for p in term.parameters.values() if isinstance(p, Parameter)]
        if all(p.null is None for p in known):
            yield f"terms[{k}].parameters", "none with a null; the one that says how strong it is needs null=..."
        try:
            asked = {name for _, name, _, _ in Formatter().parse(term.sentence) if name is not None}
        except ValueError as e:
            yield f"terms[{k}].sentence", f"braces that do not fit, got {e}; {{parameter}} is allowed"
            continue
        for name in sorted(asked - {*term.parameters}):
            yield f"terms[{k}].sentence", f"no such parameter, got {name!r}; {hint(name, term.parameters)}"


def _wrong_channels(model: Any) -> Iterator[tuple[str, str]]:
    """What is wrong with channels and conditions."""
    if not model.outputs:
        yield "outputs", "empty; at least one channel that is simulated is needed"
    for name in {*model.inputs} & {*model.outputs}:
        yield f"outputs.{name}", f"an input as well, got {name!r}; one of the two is allowed"
    for part, channels in (("inputs", model.inputs), ("outputs", model.outputs), ("conditions", conditions_of(model))):
        for name, q in channels.items():
            path = f"{part}.{name}"
            if not isinstance(q, Quantity):
                yield path, f"no unit and meaning, got {type(q).__name__}; Quantity(unit, meaning) is needed"
                continue
            si = next((own for own, known in UNITS.items() if q.unit in known and known[q.unit] == 1.0), None)
            other = next((own for own, known in UNITS.items() if q.unit in known), None)
            if q.unit not in UNITS and si is None and other is not None:
                yield path, f"not an SI unit, got {q.unit!r}; {other!r} is needed"
            if part == "conditions":
                continue
            if name == "time" or not CHANNEL.fullmatch(name):
                yield (
                    path,
                    f"not a channel's name, got {name!r}; words with '/' between, such as 'axis/force', are allowed",
                )
            elif is_known(name) and describe(name).unit != q.unit:
                yield path, f"a channel of another unit, got {q.unit!r}; {describe(name).unit!r}, or another name"


def _wrong_parameter(path: str, name: object, p: object, *, is_always: bool) -> Iterator[tuple[str, str]]:
    """What is wrong with one parameter."""
    if not isinstance(p, Parameter):
        yield path, f"not a parameter, got {type(p).__name__}; rollover.Parameter(...) is needed"
        return
    if not isinstance(name, str) or not NAME.fullmatch(name) or hasattr(Effect, name):
        yield path, f"not to be used as a name, got {name!r}; letters, digits and '_', no word that effects use"
    numbers = {"low": p.low, "high": p.high, "start": p.start} | ({} if p.null is None else {"null": p.null})
    bad = {n: v for n, v in numbers.items() if not is_finite_number(v)}
    for n, v in bad.items():
        yield f"{path}.{n}", f"not a finite number, got {v!r}; a number in {p.unit} is needed"
    if bad:
        return
    if p.scale not in ("linear", "log"):
        yield f"{path}.scale", f"unknown scale, got {p.scale!r}; linear or log is allowed"
    if not p.low < p.high:
        yield path, f"an empty range, got low {p.low:g}, high {p.high:g}; low < high is needed"
    elif p.scale == "log" and p.low <= 0.0:
        yield f"{path}.low", f"no logarithm, got {p.low:g}; above 0 with scale 'log', or scale 'linear'"
    elif not p.low <= p.start <= p.high or (is_always and p.start in (p.low, p.high)):
        yield f"{path}.start", f"outside its range, got {p.start:g}; between {p.low:g} and {p.high:g} is needed"
    if is_always and p.null is not None:
        yield f"{path}.null", f"of a parameter that is always fitted, got {p.null:g}; a null is a term's"
    if not is_always and p.null is not None and p.null == p.start:
        yield f"{path}.start", f"the same as its null, got {p.start:g}; a typical value of the term is needed"


def found_at(name: str | Path) -> Path:
    """Path of a model's file, or of a shipped one by its name. Raises `InputError` where there is none."""
    path = Path(name)
    if path.is_file() or path.suffix == ".py":
        return path
    shipped = {p.stem: p for p in sorted((shipped_folder() / FOLDER).glob("*.py"))}
    if str(name) in shipped:
        return shipped[str(name)]
    message = f"no such model, got {str(name)!r}; a Python file is needed, or a shipped one: {hint(str(name), shipped)}"
    raise InputError(Fault(file="--model", message=message))


def load_model(path: Path) -> ForwardModel:
    """The object `model` of a Python file, checked. Raises `InputError`."""
    return declared(getattr(own_code.load_one(FOLDER, path, _examined), OBJECT), str(path))


def hashes(path: Path) -> dict[str, str]:
    """SHA-256 of a model's file by its name, as a result states it."""
    known = own_code.hashes(FOLDER)
    return {name: known[name] for name in (path.name, str(path.resolve())) if name in known}


def _examined(module: ModuleType) -> str:
    """What is wrong with a module that should hold a model."""
    return (
        ""
        if hasattr(module, OBJECT)
        else f"holds no model; an object named {OBJECT!r} is needed, see rollover.ForwardModel"
    )
