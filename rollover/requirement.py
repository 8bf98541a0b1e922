"""One requirement of a standard: what is asked, how it is worked out, where that stands, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Confidence = Literal["seen", "recalled-high", "recalled", "recalled-low"]


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """`value` in `unit` is the least, or the most, that the `quantity` may be; `clause` says under which heading."""

    standard: str
    name: str
    formula: str
    clause: str
    quantity: Literal["energy", "force", "height", "angle", "deflection", "distance"]
    unit: str
    value: float
    bound: Literal["least", "most"]
    source: str
    confidence: Confidence
