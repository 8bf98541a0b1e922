"""How a scenario begins (data): dropped, released, tipped over, standing, driving, thrown, or on a test stand."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Quantity, parameters
from rollover.spec.stand import PendulumBlow, StaticTest, TiltTable


@parameters
class Drop:
    """Released so that it first touches the ground at t = 0 with a given vertical speed."""

    kind: Literal["drop"] = "drop"
    speed: Annotated[float, Quantity("m/s", "downward, at first contact", above=0, most=20)]
    lead_time: Annotated[float, Quantity("s", "free fall simulated before t = 0", least=0, most=5)] = 0.0
    roll_deg: Annotated[float, Quantity("deg", "at first contact", least=-180, most=180)] = 0.0
    pitch_deg: Annotated[float, Quantity("deg", "at first contact", least=-90, most=90)] = 0.0
    yaw_deg: Annotated[float, Quantity("deg", "at first contact", least=-360, most=360)] = 0.0
    position: Annotated[tuple[float, float], Quantity("m", "of the vehicle's origin, world x and y")] = (0.0, 0.0)


@parameters
class Release:
    """Let go at a height at t = 0, at rest or with a vertical speed; when it lands follows from the fall."""

    kind: Literal["release"] = "release"
    height: Annotated[float, Quantity("m", "of the lowest point above the ground, along z", above=0, most=1000)]
    speed: Annotated[float, Quantity("m/s", "downward, at release", least=-50, most=50)] = 0.0


@parameters
class TipOver:
    """Let go on two wheels, just past the balance, with the front axle at its stop.

    Where the surface is too steep to stand on there is no balance: then it is let go from rest as it would stand.
    """

    kind: Literal["tip-over"] = "tip-over"
    side: Annotated[Literal["left", "right"], "the side it falls to; on a slope, downhill unless heading turns it"] = (
        "left"
    )
    excess_deg: Annotated[float, Quantity("deg", "roll beyond the balance", least=0, most=30)] = 1.0
    roll_rate: Annotated[float, Quantity("rad/s", "at release, towards the side", least=0, most=10)] = 0.0
    heading_deg: Annotated[float, Quantity("deg", "of the vehicle about z", least=-360, most=360)] = 0.0
    position: Annotated[tuple[float, float], Quantity("m", "of the vehicle's origin, world x and y")] = (0.0, 0.0)


@parameters
class Standing:
    """Put down on its wheels in static equilibrium, at rest."""

    kind: Literal["standing"] = "standing"
    heading_deg: Annotated[float, Quantity("deg", "of the vehicle about z", least=-360, most=360)] = 0.0
    roll_rate: Annotated[float, Quantity("rad/s", "at release", least=-10, most=10)] = 0.0
    position: Annotated[tuple[float, float], Quantity("m", "of the vehicle's origin, world x and y")] = (0.0, 0.0)


@parameters
class Throw:
    """In flight: position, orientation and velocities at t = 0, as a camera saw them."""

    kind: Literal["throw"] = "throw"
    position: Annotated[tuple[float, float, float], Quantity("m", "of the centre of mass, world")]
    velocity: Annotated[tuple[float, float, float], Quantity("m/s", "of the centre of mass, world")] = (0.0, 0.0, 0.0)
    quaternion: Annotated[
        tuple[float, float, float, float] | None,
        Quantity("1", "w, x, y, z of the turn from body to world axes; instead of the angles", least=-1.01, most=1.01),
    ] = None
    roll_deg: Annotated[float, Quantity("deg", least=-180, most=180)] = 0.0
    pitch_deg: Annotated[float, Quantity("deg", least=-90, most=90)] = 0.0
    yaw_deg: Annotated[float, Quantity("deg", least=-360, most=360)] = 0.0
    angular_velocity: Annotated[tuple[float, float, float], Quantity("rad/s", "body axes")] = (0.0, 0.0, 0.0)

    def validate(self) -> None:
        """Refuse two orientations, and a quaternion that is none; rounding is put right by its length."""
        if self.quaternion is None:
            return
        size = math.hypot(*self.quaternion)
        if abs(size - 1.0) > 0.01:
            raise ValueError(f"quaternion: not of length 1, got {size:.4g}; 0.99 to 1.01 is allowed")
        if (self.roll_deg, self.pitch_deg, self.yaw_deg) != (0.0, 0.0, 0.0):
            raise ValueError("quaternion: got one beside roll_deg, pitch_deg or yaw_deg; one of both")


@parameters
class Drive:
    """What turns the wheels of an axle: a torque that rises from zero and is taken back at the engine's limit."""

    torque: Annotated[
        float | None,
        Quantity("N m", "on the axle's wheels together, forward; null: by an input", least=-1e6, most=1e6),
    ] = None
    axle: Annotated[Literal["rear", "front", "all"], "whose wheels it drives"] = "rear"
    differential: Annotated[Literal["open", "locked"], "open: equal torques; locked: equal rates"] = "open"
    rise_time: Annotated[float, Quantity("s", "from zero to all of it", least=0)] = 0.1
    until: Annotated[float | None, Quantity("s", "time at which the clutch is let go", above=0)] = None
    limit_rate: Annotated[
        float | None, Quantity("rad/s", "of the wheels, at which the engine gives nothing more", above=0)
    ] = None


@parameters
class Brake:
    """Holds wheels up to a limit; a large one locks them."""

    torque: Annotated[float | None, Quantity("N m", "limit, of each wheel; null: by an input", above=0)] = None
    axle: Annotated[Literal["rear", "front", "all"], "whose wheels it holds"] = "all"
    against: Annotated[
        Literal["vehicle", "ground"], "what it holds them to: the ground, where they are dug in, frozen in or chained"
    ] = "vehicle"


@parameters
class Driving:
    """Put down in static equilibrium where it stands, then sent forward along the ground with its wheels rolling."""

    kind: Literal["driving"] = "driving"
    speed: Annotated[float, Quantity("m/s", "forward, along the ground", least=-20, most=20)]
    sideways: Annotated[float, Quantity("m/s", "sliding, to the left", least=-20, most=20)] = 0.0
    position: Annotated[tuple[float, float], Quantity("m", "of the vehicle's origin, world x and y")] = (0.0, 0.0)
    heading_deg: Annotated[float, Quantity("deg", "of the vehicle about z", least=-360, most=360)] = 0.0
    steer_deg: Annotated[float, Quantity("deg", "of the front wheels, to the left", least=-60, most=60)] = 0.0
    drive: Drive | None = None
    brake: Brake | None = None


Initiation = Annotated[
    Drop | Release | TipOver | Standing | Driving | Throw | StaticTest | PendulumBlow | TiltTable, ByKind()
]
