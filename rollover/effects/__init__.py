"""The table of effects: switchable terms of the simulation, each a class of parameters, by effect id."""

from __future__ import annotations

EFFECTS: dict[str, type] = {}


def effects() -> dict[str, type]:
    """Every effect that exists, by its id."""
    return dict(EFFECTS)
