"""An effect of one's own in one file: a force on the ground's loading curve."""

from __future__ import annotations

from typing import Annotated, ClassVar

from ground.compiled import force_law
from ground.quantity import Quantity, parameters
from ground.settings import ForceTerm
from rollover.effects import Effect, Search


@force_law
def roots(p, s, z, v):  # type: ignore[no-untyped-def]
    """N on the reference face: stretched roots, until they tear."""
    return p[0] * z if z < p[1] else 0.0


@parameters
class SoilRoots(Effect):
    """F += k z until the roots tear at a depth."""

    stiffness: Annotated[float, Quantity("N/m", "of the roots under the reference face", least=0)] = 2e4
    depth: Annotated[float, Quantity("m", "at which they tear", above=0)] = 0.05

    id = "soil-roots"
    family = "a resistance of the ground that changes with depth"
    equation = "F += k z for z < depth"
    source = "made up for this page"
    sentence = "Roots hold with {stiffness} until they tear at {depth}."
    channels = ("ground/force_normal",)
    null: ClassVar = {"stiffness": 0.0}
    search: ClassVar = {"stiffness": Search(1e3, 1e6, "log"), "depth": Search(0.01, 0.3, "log")}

    def force_terms(self) -> tuple[ForceTerm, ...]:
        """The compiled force with its numbers."""
        return (ForceTerm(roots, (self.stiffness, self.depth)),)
