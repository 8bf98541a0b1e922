"""One requirement of a standard: what is asked, how it is worked out, where that stands, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Confidence = Literal["source checked", "recalled, high confidence", "recalled", "recalled, low confidence"]


@dataclass(frozen=True, kw_only=True)
class Requirement:
    """`value` in `unit` is the least, or the most, that the `quantity` may be; `clause` says under which heading.

    A `range` reaches from `value` to `upper`. `come_from` are the sides from which a test's load or blow comes that
    this is asked of, empty where it is asked of no such test.
    """

    standard: str
    name: str
    formula: str
    clause: str
    quantity: Literal["energy", "force", "height", "angle", "deflection", "distance", "share"]
    unit: str
    value: float
    bound: Literal["least", "most", "range"]
    source: str
    confidence: Confidence
    upper: float | None = None
    come_from: tuple[str, ...] = ()
