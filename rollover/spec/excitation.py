"""What drives a striker into the ground besides its weight (data): a vibrator, or the blows of a hammer."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Quantity, parameters


@parameters
class Harmonic:
    """Two masses that turn against each other: a vertical force m_e e w^2 sin(w (t - start))."""

    kind: Literal["harmonic"] = "harmonic"
    eccentric_moment: Annotated[float, Quantity("kg m", "m_e e of both masses together", above=0)]
    frequency: Annotated[float, Quantity("1/s", "turns per second", above=0, most=200)]
    start: Annotated[float, Quantity("s", "when it starts to turn, at full speed", least=0)] = 0.0

    @property
    def amplitude(self) -> float:
        """m_e e w^2, N."""
        return self.eccentric_moment * (2.0 * math.pi * self.frequency) ** 2


@parameters
class Blows:
    """A hammer that falls again and again: each blow is an exchange of momentum with a given restitution.

    The hammer is caught after each blow, its weight never rests on the striker. What is driven takes
    m_h/(m_h + m) (1 + e) of the hammer's speed; (1 - e^2) m m_h/(m + m_h) v^2/2 is lost in the cushion.
    """

    kind: Literal["blows"] = "blows"
    hammer_mass: Annotated[float, Quantity("kg", above=0)]
    height: Annotated[float, Quantity("m", "of fall", above=0, most=5)]
    restitution: Annotated[float, Quantity("1", "of hammer and cushion", least=0, most=1)] = 0.4
    efficiency: Annotated[float, Quantity("1", "energy at the blow over m g h", above=0, most=1)] = 1.0
    count: Annotated[int, Quantity("1", "number of blows", least=1, most=1000)] = 10
    interval: Annotated[float, Quantity("s", "from blow to blow", above=0)] = 0.5
    start: Annotated[float, Quantity("s", "of the first blow", least=0)] = 0.5


Excitation = Annotated[Harmonic | Blows, ByKind()]
