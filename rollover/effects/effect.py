"""What an effect is: a term of the simulation that can be switched on, with its numbers and what is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, ClassVar, Literal, NamedTuple

from ground.law import is_current
from ground.quantity import parameters, quantities
from ground.settings import ForceTerm
from rollover.recording import Recording
from rollover.spec.channels import describe, is_known

EFFECTS: dict[str, type[Effect]] = {}

NEAR_ONE = 0.01  # of what is said with as many digits as tell it from one
CHANNELS_OWN = "SI unit of the channel"
Kind = Literal["physics", "parameter", "sensor"]


class Search(NamedTuple):
    """Where to look for a parameter: from `low` to `high`, in even steps of the value or of its logarithm.

    `suggested` is a value that recordings show by themselves, and that is looked at beside others.
    """

    low: float
    high: float
    scale: Literal["log", "linear"] = "linear"
    suggested: float | None = None


class Heard(NamedTuple):
    """What recordings say of one of their channels, SI: `spans` of all by channel, and its `end`, see below.

    `times` is how many times as far as simulated it moves: 1,000 of millimetres read as metres, below 0 of what moves
    the other way. `end` is the size of its largest value if that is met again and again to the last digit, else 0.
    """

    channel: str
    spans: Mapping[str, float]
    times: float = 1.0
    end: float = 0.0


class Form(NamedTuple):
    """Another form of an effect: what is `fixed` in it, ranges of what is fitted instead, and how it is said, if so."""

    fixed: Mapping[str, float]
    search: Mapping[str, Search]
    sentence: str = ""


@parameters
class Effect:
    """A term beyond the basic model; the numbers that a class declares default to a typical strength.

    At `null` it changes nothing, by not one bit: a number, or None where the scenario's own value then holds.
    A class gives one of: `places` and `force_terms` (the ground's loading curve), `changes` (values of the scenario),
    `read` (what a sensor makes of a channel); terms on the bodies are read by `rollover.kernels.terms`.
    """

    id: ClassVar[str] = ""
    kind: ClassVar[Kind] = "physics"
    family: ClassVar[str] = ""  # what a report names before the member: "a resistance that grows with speed"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = ""  # with its confidence: seen, or recalled with high, medium or low confidence
    sentence: ClassVar[str] = ""  # for a test engineer; {parameter} or {parameter:more|less} stands for a value
    rivals: ClassVar[Mapping[str, str]] = {}  # look-alike -> the test that tells them apart
    acts: ClassVar[tuple[str, ...]] = ("drop", "rollover")
    needs: ClassVar[str] = ""  # of an effect that does nothing but `changes`: what a scenario may be without
    channels: ClassVar[tuple[str, ...]] = ()  # that feel it first
    solid: ClassVar[bool] = False  # it is of ground that keeps its shape: no fluid has it
    competes: ClassVar[bool] = True  # as an explanation of what a scenario misses
    null: ClassVar[Mapping[str, float | None]] = {}
    search: ClassVar[Mapping[str, Search]] = {}
    secondary: ClassVar[
        tuple[str, ...]
    ] = ()  # parameters that few recordings tell from the strength: mostly at default
    forms: ClassVar[tuple[Form, ...]] = ()  # what else goes by its name, no matter of degree
    local_starts: ClassVar[
        Mapping[str, tuple[float, ...]]
    ] = {}  # parameter -> places in its range, near which alone it tells
    is_abrupt: ClassVar[bool] = False  # it rings, or turns from one instant to the next: drops take shorter steps
    is_smooth: ClassVar[bool] = False  # its force terms jump nowhere: drops take no shorter steps for them
    is_discontinuous: ClassVar[bool] = False  # its least strength does something already: slopes there lead nowhere
    # an effect of fewer numbers that it becomes at an end of its range -> which of its own numbers that one's are, and
    # how many times as large
    becomes: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {}
    # an effect that does the same beside another stiffness of all the ground -> which of its own numbers that one's
    # are, and to which power
    mirrors: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {}
    # parameter -> powers of mass and of face with which its range grows, from a striker of 132 kg on the reference face
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {}

    def __init_subclass__(cls) -> None:
        """Enter the table. Raises ``TypeError`` for one without an id, an id given twice, an old name."""
        known = EFFECTS.get(cls.id)
        if not cls.id:
            raise TypeError(f"{cls.__module__}.{cls.__name__}: an effect needs an `id`")
        if "shapes" in vars(cls):  # its name until 0.1: unread, such a parameter would be fitted as a strength is
            raise TypeError(f"{cls.__module__}.{cls.__name__}: `shapes` is named `secondary`")
        if (
            known is not None
            and is_current(known)
            and (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__)
        ):
            raise TypeError(f"{cls.__module__}.{cls.__name__}: effect {cls.id!r} is taken by {known.__module__}")
        EFFECTS[cls.id] = cls

    def places(self) -> Mapping[int, float]:
        """Numbers for the ground's kernel, by their place (see `ground.kernel`)."""
        return {}

    def force_terms(self) -> tuple[ForceTerm, ...]:
        """Compiled forces that are added to the ground's loading curve."""
        return ()

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Values of the scenario that the effect replaces, by path."""
        return {}

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """Range of a fitted parameter in a scenario (if known), from its usual one; None where it has no part."""
        return search

    @classmethod
    def reshaped(cls, numbers: Mapping[str, float], shape: str, value: float) -> Mapping[str, float]:
        """Numbers with another value of a shape, and what goes along with it so that what shows most stays as it is."""
        return {**numbers, shape: value}

    @classmethod
    def looked_for_on(cls, heard: Heard) -> Mapping[str, Search] | None:
        """Ranges of a sensor's effect on a channel that was recorded; None where it has no part."""
        return cls.search

    def read(self, recording: Recording) -> Recording:
        """What the sensors make of a recording."""
        return recording

    def same_as(self) -> Mapping[str, str]:
        """Ids of other effects beside which it does the very same at other values, and the sentence that says so."""
        return {}

    def wording(self) -> str:
        """The sentence for its values; that of its form, if it is in one that has a sentence of its own."""
        own = (f for f in self.forms if f.sentence and all(getattr(self, n) == v for n, v in f.fixed.items()))
        return next((f.sentence for f in own), self.sentence)

    def statement(self) -> str:
        """The sentence, with the values in it."""
        units = units_of(type(self), getattr(self, "channel", None))
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        spoken = {
            name: _Spoken(value, units[name]) if isinstance(value, float) and name in units else value
            for name, value in values.items()
        }
        return self.wording().format(**spoken)


class _Spoken:
    """A number with its unit in a sentence; {name:more|less} is its size and what it is above and below nought."""

    def __init__(self, value: float, unit: str) -> None:
        self.value, self.unit = value, "" if unit == "1" else f" {unit}"

    def __format__(self, ways: str) -> str:
        above, either, below = ways.partition("|")
        if not either:
            return f"{spoken(self.value)}{self.unit}"
        return f"{spoken(abs(self.value))}{self.unit} {above if self.value >= 0.0 else below}"


def spoken(value: float) -> str:
    """Three digits; 95,700 rather than 9.57e+04, and 1.0022 rather than 1."""
    if NEAR_ONE > abs(abs(value) - 1.0) > 0.0:
        return f"{value:.5g}"
    digits = float(f"{value:.3g}")
    return f"{digits:,.0f}" if 1e3 <= abs(digits) < 1e9 else f"{digits:.3g}"


def units_of(effect: type[Effect], channel: str | None = None) -> dict[str, str]:
    """Unit of each number of an effect; of a sensor's offset or limit that of its channel, where one is given."""
    kind: Any = effect
    found = {name: q.unit for name, q in quantities(kind).items()}
    own = describe(channel).unit if channel is not None and is_known(channel) else CHANNELS_OWN
    return {name: own if unit == CHANNELS_OWN else unit for name, unit in found.items()}


def possible(effect: type[Effect], name: str, value: float) -> float:
    """The value that a number of an effect can have nearest to `value`: no friction is below none."""
    kind: Any = effect
    bounds = quantities(kind).get(name)
    return value if bounds is None else bounds.nearest(value)


def nothing(effect: type[Effect]) -> Effect:
    """The effect at its null: switched on, and without effect."""
    return effect(**effect.null)
