"""How a scenario begins (data): dropped, tipped over its balance, standing, or on a test stand."""

from __future__ import annotations

from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Quantity, parameters
from rollover.stand import PendulumBlow, StaticTest, TiltTable


@parameters
class Drop:
    """Released so that it first touches the ground at t = 0 with a given vertical speed."""

    kind: Literal["drop"] = "drop"
    speed: Annotated[float, Quantity("m/s", "downward, at first contact", above=0, most=20)]
    lead_time: Annotated[float, Quantity("s", "free fall simulated before t = 0", least=0, most=5)] = 0.0
    roll_deg: Annotated[float, Quantity("deg", "at first contact", least=-180, most=180)] = 0.0
    pitch_deg: Annotated[float, Quantity("deg", "at first contact", least=-90, most=90)] = 0.0
    yaw_deg: Annotated[float, Quantity("deg", "at first contact", least=-360, most=360)] = 0.0


@parameters
class TipOver:
    """Let go on two wheels, just past the balance, with the front axle at its stop."""

    kind: Literal["tip-over"] = "tip-over"
    side: Annotated[Literal["left", "right"], "the side it falls to; on a slope, downhill unless heading turns it"] = (
        "left"
    )
    excess_deg: Annotated[float, Quantity("deg", "roll beyond the balance", least=0, most=30)] = 1.0
    roll_rate: Annotated[float, Quantity("rad/s", "at release, towards the side", least=0, most=10)] = 0.0
    heading_deg: Annotated[float, Quantity("deg", "of the vehicle about z", least=-360, most=360)] = 0.0


@parameters
class Standing:
    """Put down on its wheels in static equilibrium, at rest."""

    kind: Literal["standing"] = "standing"
    heading_deg: Annotated[float, Quantity("deg", "of the vehicle about z", least=-360, most=360)] = 0.0
    roll_rate: Annotated[float, Quantity("rad/s", "at release", least=-10, most=10)] = 0.0


Initiation = Annotated[Drop | TipOver | Standing | StaticTest | PendulumBlow | TiltTable, ByKind()]
