"""The table of effects: switchable terms of the simulation, each a class of parameters, by effect id.

An effect of one's own is one Python file with a class derived from `Effect`, named by ``--effects FILE`` or the
environment variable ROLLOVER_EFFECTS (several files as in PATH); it then stands beside those of this folder.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import fields
from types import ModuleType
from typing import Any

from ground.law import is_current
from ground.promises import broken_by_term
from ground.settings import ForceTerm
from rollover.effects import empirical, ground, parameter, sensor, striker, vehicle
from rollover.effects.effect import EFFECTS, Effect, Form, Heard, Search, nothing, possible, spoken, units_of
from rollover.recording import Recording
from rollover.system import own_code

__all__ = [
    "EFFECTS",
    "Effect",
    "Form",
    "Heard",
    "Search",
    "acting",
    "effects",
    "ground",
    "nothing",
    "parameter",
    "read",
]
__all__ += ["empirical", "entries", "every", "nth", "possible", "sensor", "spoken", "striker", "units_of", "vehicle"]

MOST = 3  # sensor effects of one id in a scenario, each on its own channel


def effects() -> dict[str, type[Effect]]:
    """Every effect that exists, by its id; those of one's own files last. Raises `InputError`."""
    try:
        own_code.load("effects", _wrong)
    finally:
        for stale in [each for each, effect in EFFECTS.items() if not is_current(effect)]:
            del EFFECTS[stale]
    return dict(EFFECTS)


def _wrong(module: ModuleType) -> str:
    """What is wrong with a file of effects; nothing if it is well."""
    own = [e for e in EFFECTS.values() if e.__module__ == module.__name__]
    if not own:
        return "no effect, got no class derived from Effect; one is needed (`rollover new effect` writes one)"
    found = ((effect, _broken(effect)) for effect in own)
    wrong = next((f"{effect.__name__}: {why}" for effect, why in found if why), "")
    if wrong:
        for effect in own:  # the file is not taken: neither is any of it
            del EFFECTS[effect.id]
    return wrong


def _broken(effect: type[Effect]) -> str:
    """What an effect does not keep of what an effect must."""
    if "__dataclass_fields__" not in vars(effect):
        return "no parameters; @parameters is needed above the class"
    names = {f.name for f in fields(effect)}
    if not effect.null or not set(effect.null) <= names:
        return (
            f"null: {'of no parameter' if effect.null else 'missing'}, got {dict(effect.null)!r}; the value of a "
            f"parameter ({', '.join(sorted(names))}) at which it changes nothing is needed"
        )
    for chosen, is_null in ((effect(), False), (nothing(effect), True)):
        for force, p in chosen.force_terms():
            if why := broken_by_term(force, p, is_null=is_null):
                return why
    return ""


def acting(chosen: Mapping[str, Any]) -> tuple[dict[int, float], tuple[ForceTerm, ...]]:
    """Numbers by place, and force terms, that a scenario's effects hand to the ground's kernel."""
    places: dict[int, float] = {}
    terms: tuple[ForceTerm, ...] = ()
    for effect in chosen.values():
        places |= effect.places()
        terms += effect.force_terms()
    return places, terms


def entries() -> dict[str, type[Effect]]:
    """What may stand under `effects` of a scenario: each effect once, one of a sensor also as ID-2 and ID-3.

    A sensor effect is one channel's; with its number the same one acts on a second and a third channel.
    """
    return _entries(tuple(effects().items()))


@functools.lru_cache(maxsize=4)  # asked for with every value that is exchanged
def _entries(found: tuple[tuple[str, type[Effect]], ...]) -> dict[str, type[Effect]]:
    more = {nth(id, n): kind for id, kind in found if kind.kind == "sensor" for n in range(2, MOST + 1)}
    return dict(found) | more


def nth(id: str, n: int) -> str:
    """Key under which the n-th (1, 2, ...) effect of one id stands."""
    return id if n == 1 else f"{id}-{n}"


def every(chosen: Mapping[str, Any], id: str) -> list[Any]:
    """All effects of one id that a scenario has switched on."""
    return [chosen[key] for key in _numbered(id) if key in chosen]


@functools.cache  # effects are few
def _numbered(id: str) -> tuple[str, ...]:
    return tuple(nth(id, n) for n in range(1, MOST + 1))


def read(chosen: Mapping[str, Any], recording: Recording) -> Recording:
    """What a scenario's sensors make of a recording: y = clip(G (R h x)(t - t_0 - e t) + b).

    Whatever the order in the file: the sensor's axis, its lag, its scale and gain, its clock, its bias, its range.
    """
    for name in sensor.ORDER:
        for one in every(chosen, name):
            recording = one.read(recording)
    return recording
