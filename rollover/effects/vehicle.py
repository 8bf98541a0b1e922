"""Effects of what tips over: parts of the vehicle that move or give way, and what drives it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground.quantity import Quantity, parameters
from rollover.effects.effect import Effect, Search
from rollover.spec.shapes import Point
from rollover.spec.vehicle import Vehicle


@parameters
class RopsElasticity(Effect):
    """Mounts or feet of the ROPS with another stiffness: together k along y, the other directions in proportion."""

    stiffness: Annotated[float | None, Quantity("N/m", "of all mounts together along y", above=0)] = 3e5

    id = "rops-elasticity"
    family = "a compliant structure"
    equation = "k_i -> k_i stiffness / sum k_y; dashpots by its root"
    source = "two-post frames about 0.3 MN/m at the top (recalled)"
    sentence = "The ROPS deflects by {stiffness} to the side."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the deflection of the ROPS, which soft ground leaves alone",
        "mount-play": "the force as the deflection goes to zero: play has a dead zone there",
    }
    acts = ("rollover",)
    needs = "a ROPS"
    channels = ("rops/deflection", "rops/force", "rops/force_y")
    null: ClassVar[Mapping[str, float | None]] = {"stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"stiffness": Search(3e4, 3e7, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Stiffness and damping of every mount; of a foot its post's, whose damping follows."""
        rops = scenario.vehicle.rops if isinstance(scenario.vehicle, Vehicle) else None
        if self.stiffness is None or rops is None:
            return {}
        own = rops.side_stiffness
        ratio = self.stiffness / sum(own.values())
        found: dict[str, Any] = {}
        for mount in rops.mounts:
            at = f"vehicle.rops.mounts.{mount.name}"
            found[f"{at}.stiffness"] = tuple(ratio * k for k in mount.stiffness)
            found[f"{at}.damping"] = tuple(ratio**0.5 * k for k in mount.damping)
        for foot in rops.feet:
            found[f"vehicle.rops.feet.{foot.name}.side_stiffness"] = ratio * own[f"feet.{foot.name}"]
        return found


@parameters
class RopsPlasticity(Effect):
    """Mounts or feet of the ROPS that yield along y, together at F_y, each by its share of the stiffness."""

    yield_force: Annotated[float | None, Quantity("N", "F_y of all mounts together along y", above=0)] = 34_000.0

    id = "rops-plasticity"
    family = "a compliant structure"
    equation = "|F_i| <= F_y k_i / sum k"
    source = (
        "F_y 34 kN for a two-post frame of some 3 t (recalled); faster loading raises it (Cowper and Symonds; "
        "recalled, fairly sure)"
    )
    sentence = "The ROPS yields at {yield_force} to the side."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the set that stays in the frame",
        "sensor-clipping": "the deflection: it goes on while the force stays",
    }
    acts = ("rollover",)
    needs = "a ROPS"
    channels = ("rops/force", "rops/force_y", "rops/deflection")
    null: ClassVar[Mapping[str, float | None]] = {"yield_force": None}
    search: ClassVar[Mapping[str, Search]] = {"yield_force": Search(3e3, 3e5, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The yield force along y of every mount, and of every foot to the side."""
        rops = scenario.vehicle.rops if isinstance(scenario.vehicle, Vehicle) else None
        if self.yield_force is None or rops is None:
            return {}
        own = rops.side_stiffness
        whole = sum(own.values())
        found: dict[str, Any] = {}
        for mount in rops.mounts:
            x, _, z = mount.yield_force
            part = self.yield_force * mount.stiffness[1] / whole
            found[f"vehicle.rops.mounts.{mount.name}.yield_force"] = (x, part, z)
        for foot in rops.feet:
            part = self.yield_force * own[f"feet.{foot.name}"] / whole
            found[f"vehicle.rops.feet.{foot.name}.side_yield"] = part
        return found


@parameters
class TyreDamping(Effect):
    """Another dashpot along the radius of every tyre."""

    damping: Annotated[float | None, Quantity("N s/m", "of each tyre", least=0)] = 2500.0

    id = "tyre-damping"
    family = "a tyre that is not the one written down"
    equation = "c_z = damping"
    source = "1-5 kN s/m for tractor tyres (recalled)"
    sentence = "Each tyre is damped by {damping}."
    rivals: ClassVar[Mapping[str, str]] = {"inertia": "a bounce on the spot", "axle-stop": "the angle of the axle"}
    acts = ("rollover",)
    needs = "wheels"
    channels = ("wheel/rear_left/force_normal", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"damping": None}
    search: ClassVar[Mapping[str, Search]] = {"damping": Search(100.0, 3e4, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The dashpot of every tyre."""
        wheels = scenario.vehicle.wheels if isinstance(scenario.vehicle, Vehicle) else ()
        if self.damping is None:
            return {}
        return {f"vehicle.wheels.{w.name}.tyre.vertical_damping": self.damping for w in wheels}


@parameters
class TyreLateralStiffness(Effect):
    """Another lateral stiffness of every tyre."""

    stiffness: Annotated[float | None, Quantity("N/m", "k_y of each tyre", above=0)] = 1.5e5

    id = "tyre-lateral-stiffness"
    family = "a tyre that is not the one written down"
    equation = "k_y = stiffness"
    source = "0.3-0.7 of the vertical stiffness (recalled)"
    sentence = "Each tyre deflects laterally by {stiffness}."
    rivals: ClassVar[Mapping[str, str]] = {"centre-of-mass": "a static tilt test with the tyres blocked"}
    acts = ("rollover",)
    needs = "wheels"
    channels = ("chassis/position_y", "chassis/roll")
    null: ClassVar[Mapping[str, float | None]] = {"stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"stiffness": Search(1e4, 3e6, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The lateral stiffness of every tyre."""
        wheels = scenario.vehicle.wheels if isinstance(scenario.vehicle, Vehicle) else ()
        if self.stiffness is None:
            return {}
        return {f"vehicle.wheels.{w.name}.tyre.lateral_stiffness": self.stiffness for w in wheels}


@parameters
class AxleStop(Effect):
    """Stops of the front axle at another angle or with another stiffness."""

    angle: Annotated[float | None, Quantity("rad", "free pivot angle to either side", above=0, most=0.78)] = 0.2
    stiffness: Annotated[float | None, Quantity("N m/rad", "of a stop", above=0)] = None

    id = "axle-stop"
    family = "a joint that stops elsewhere"
    equation = "torque = stiffness (theta - angle) beyond the angle"
    source = "stops at 8-15 deg (recalled)"
    sentence = "The front axle meets its stops at {angle}."
    rivals: ClassVar[Mapping[str, str]] = {"inertia": "the angle of the axle at the step in roll acceleration"}
    acts = ("rollover",)
    needs = "a front axle that swings"
    channels = ("axle/front/angle", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"angle": None, "stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"angle": Search(0.02, 0.5), "stiffness": Search(1e4, 1e7, "log")}
    secondary = ("stiffness",)

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Swing and stiffness of the stops."""
        axle = scenario.vehicle.front_axle if isinstance(scenario.vehicle, Vehicle) else None
        if axle is None:
            return {}
        found: dict[str, Any] = {}
        if self.angle is not None:
            found["vehicle.front_axle.swing_deg"] = math.degrees(self.angle)
        if self.stiffness is not None:
            found["vehicle.front_axle.stop_stiffness"] = self.stiffness
        return found


@parameters
class GyroscopicRotor(Effect):
    """M = -omega x H on the chassis: a flywheel or another part that spins while the vehicle turns over."""

    angular_momentum: Annotated[float, Quantity("kg m2/s", "H along the axis")] = 345.0
    axis: Annotated[tuple[float, float, float], Quantity("1", "of the rotor, vehicle axes")] = (1.0, 0.0, 0.0)

    id = "gyroscopic-rotor"
    family = "a moment that couples roll, pitch and yaw"
    equation = "M = -omega x H"
    source = "flywheel of 1.5 kg m2 at 2200 rpm: 345 N m s; 1.7 kN m at 5 rad/s (computed)"
    sentence = "A part that spins in the chassis with {angular_momentum} acts on it as a gyroscope."
    rivals: ClassVar[Mapping[str, str]] = {"ground-friction": "the same test with the engine off"}
    acts = ("rollover",)
    channels = ("chassis/yaw", "chassis/pitch", "chassis/angular_velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"angular_momentum": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"angular_momentum": Search(-3e3, 3e3)}

    @property
    def vector(self) -> tuple[float, float, float]:
        """H in vehicle axes, kg m2/s."""
        x, y, z = self.axis
        factor = self.angular_momentum / math.sqrt(x * x + y * y + z * z)
        return (factor * x, factor * y, factor * z)

    def validate(self) -> None:
        """Refuse an axis that points nowhere."""
        if not any(self.axis):
            raise ValueError(f"axis: points nowhere, got {list(self.axis)}; any other direction")


@parameters
class MountPlay(Effect):
    """Mounts or feet of the ROPS with play: no force until the gap to either side is taken up."""

    gap: Annotated[float, Quantity("m", "to either side along x, y, z", least=0)] = 0.008

    id = "mount-play"
    family = "a compliant structure"
    equation = "F = k (delta - clip(delta, +-gap))"
    source = "5-15 mm in worn or silent-block mounts (recalled, unsure)"
    sentence = "The mounts of the ROPS have a play of {gap} before they bear."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-clock-offset": "the force against the deflection: play has a dead zone",
        "rops-elasticity": "the force as the deflection goes to zero",
    }
    acts = ("rollover",)
    needs = "a ROPS"
    channels = ("rops/deflection", "rops/force")
    null: ClassVar[Mapping[str, float | None]] = {"gap": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"gap": Search(5e-4, 0.05, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The play of every mount and foot, beyond what it has; posts that bend have none."""
        rops = scenario.vehicle.rops if isinstance(scenario.vehicle, Vehicle) else None
        if rops is None or self.gap == 0.0:
            return {}
        mounts = {f"vehicle.rops.mounts.{m.name}.play": tuple(p + self.gap for p in m.play) for m in rops.mounts}
        feet = () if rops.segments is not None else rops.feet
        return mounts | {f"vehicle.rops.feet.{foot.name}.play": foot.play + self.gap for foot in feet}


@parameters
class TankSlosh(Effect):
    """Part of a liquid as a mass on a spring across the vehicle: k = m g/length, as a pendulum of that length has."""

    mass: Annotated[float, Quantity("kg", "that moves, part of the whole vehicle's", least=0)] = 100.0
    length: Annotated[float, Quantity("m", "of the pendulum with the same frequency", above=0)] = 0.35
    damping: Annotated[float, Quantity("1", "over critical", least=0, most=2)] = 0.02
    position: Annotated[Point | None, Quantity("m", "vehicle axes; none: the chassis' centre of mass")] = None

    id = "tank-slosh"
    family = "a mass that moves in the vehicle"
    equation = "m (u'' + a_y - g_y) + 2 damping m w u' + m w^2 u = 0, w^2 = g/length"
    source = "tanks of 0.8-1.2 m: 0.75-0.95 Hz, length 0.28-0.44 m, half of it (computed); damping 0.5-5 % (recalled)"
    sentence = "{mass} of liquid slosh across the vehicle like a pendulum of {length}."
    rivals: ClassVar[Mapping[str, str]] = {"payload-shift": "a tank filled to the brim, or another level"}
    acts = ("rollover",)
    channels = ("chassis/roll", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"mass": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "mass": Search(10.0, 1500.0, "log"),
        "length": Search(0.05, 3.0, "log"),
        "damping": Search(0.0, 0.3),
    }
    secondary = ("damping",)


@parameters
class PayloadShift(Effect):
    """A load that slides across the vehicle with Coulomb friction until it meets a wall."""

    mass: Annotated[float, Quantity("kg", "that slides, part of the whole vehicle's", least=0)] = 150.0
    friction: Annotated[float, Quantity("1", "mu on its bed", least=0, most=2)] = 0.3
    travel: Annotated[float, Quantity("m", "to the wall on either side", least=0)] = 0.2
    position: Annotated[Point | None, Quantity("m", "vehicle axes; none: the chassis' centre of mass")] = None

    id = "payload-shift"
    family = "a mass that moves in the vehicle"
    equation = "m (u'' + a_y - g_y) = -mu N sign(u'), |u| <= travel"
    source = "mu 0.2-0.5, 5-30 % of the mass (recalled)"
    sentence = "{mass} of load slide by {travel} to the side before they meet a wall."
    rivals: ClassVar[Mapping[str, str]] = {
        "tank-slosh": "the load lashed down",
        "centre-of-mass": "the moment at which it moves: a wrong centre of mass is there from the start",
    }
    acts = ("rollover",)
    channels = ("chassis/roll", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"mass": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "mass": Search(10.0, 1500.0, "log"),
        "travel": Search(0.02, 1.0, "log"),
        "friction": Search(0.0, 1.0),
    }
    local_starts: ClassVar[Mapping[str, tuple[float, ...]]] = {  # it meets its wall at a moment that its travel sets
        "travel": tuple(0.1 + 0.022 * k for k in range(36)),
        "friction": (0.25, 0.5),
    }


@parameters
class DriveTorque(Effect):
    """M = -torque about the chassis' y: an engine that goes on driving wheels which the ground holds."""

    torque: Annotated[float, Quantity("N m", "on the rear axle, forward")] = 1500.0

    id = "drive-torque"
    family = "a moment on the chassis"
    equation = "M_y = -torque on the chassis; wheels that are held pass it on to the ground"
    source = "rear upset; some kN m in a low gear (recalled, unsure)"
    sentence = "The engine goes on driving with {torque} and lifts the front."
    rivals: ClassVar[Mapping[str, str]] = {"gyroscopic-rotor": "the clutch open with the engine running"}
    acts = ("rollover",)
    channels = ("chassis/pitch", "chassis/angular_velocity_y")
    null: ClassVar[Mapping[str, float | None]] = {"torque": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"torque": Search(-2e4, 2e4)}
