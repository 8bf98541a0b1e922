"""The law that the documentation shows, as a file of its own; imported only by a process that may keep it."""

from typing import Annotated, Literal

from ground.compiled import force_law
from ground.law import GroundLaw
from ground.quantity import Quantity, parameters


@parameters
class Peat(GroundLaw):
    """F = k z: a linear soil."""

    kind: Literal["peat"] = "peat"
    stiffness: Annotated[float, Quantity("N/m", "secant stiffness on the reference face", above=0)] = 3.0e4

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        return p[1] * z
