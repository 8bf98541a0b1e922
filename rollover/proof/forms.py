"""What a form of an effect is: a law with a name, where it stands, and a draw of its numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rollover.proof.campaign import log_uniform
from rollover.proof.library import Change, Random, Setting
from rollover.proof.rig import Resist

STRENGTH = (40.0, 1500.0)  # N, of what a form adds to a drop whose force peaks at 3500


@dataclass(frozen=True, kw_only=True)
class Form:
    """A law by which an effect acts; `draw` makes a change of it at a random strength."""

    name: str
    source: str
    draw: Callable[[Random, Setting, str], Change]


def physics(id: str, parameters: Mapping[str, float], depends_on: str, kind: str = "physics", **rig: Any) -> Change:
    """A change of the rig; `parameters` are the law's numbers."""
    return Change(id=id, kind=kind, parameters=parameters, rig=rig, depends_on=depends_on)


def resisting(
    id: str, parameters: Mapping[str, float], depends_on: str, resist: Resist, kind: str = "physics", **rig: Any
) -> Change:
    """A change of what the ground resists with on the way down."""
    return physics(id, parameters, depends_on, kind, resist=resist, **rig)


def strength(random: Random) -> float:
    """Newtons, even in the logarithm."""
    return log_uniform(random, *STRENGTH)


def ratio(random: Random, low: float = 0.05, high: float = 1.2) -> float:
    """A factor above or below 1, by `low` to `high` of its logarithm."""
    return math.exp(log_uniform(random, low, high) * float(random.choice((-1.0, 1.0))))


def uniform(random: Random, low: float, high: float) -> float:
    """A number that is evenly spread."""
    return float(random.uniform(low, high))
