"""Effects of what falls: forces on the striker and its guide, parts of the vehicle that move or give way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground.quantity import Quantity, parameters
from rollover.effects.effect import Effect, Search
from rollover.vehicle import Vehicle

AIR_DENSITY = 1.204  # kg/m3 at 20 degrees and 1013 hPa


@parameters
class GuideFriction(Effect):
    """F = -F_c sign(v): Coulomb friction of the guide that a striker falls on."""

    force: Annotated[float, Quantity("N", "F_c", least=0)] = 80.0

    id = "guide-friction"
    family = "a drag on the falling body"
    equation = "F = -F_c min(max(v/v_c, -1), 1) along the guide, v_c = 5 mm/s"
    source = "20-200 N in drop rigs (M)"
    sentence = "The guide brakes the striker with {force}."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the free fall before contact: it is slower than g",
        "air-drag": "the free fall at small speed: friction is there at once",
        "mass": "the free fall before contact: every mass falls with g",
    }
    acts = ("drop",)
    channels = ("striker/acceleration_z", "striker/velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"force": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"force": Search(5.0, 600.0, "log")}


@parameters
class AirDrag(Effect):
    """F = -1/2 rho C_d A v |v| on the centre of mass of the striker or the chassis."""

    area: Annotated[float, Quantity("m2", "A, frontal", least=0)] = 0.05
    drag_coefficient: Annotated[float, Quantity("1", "C_d", above=0, most=5)] = 1.0
    density: Annotated[float, Quantity("kg/m3", "rho", above=0)] = AIR_DENSITY

    id = "air-drag"
    family = "a drag on the falling body"
    equation = "F = -1/2 rho C_d A v |v|"
    source = "C_d of blunt bodies about 1 (M+); 60 N at 5 m/s on a tractor: as a rule nothing to be seen"
    sentence = "The air brakes the fall like a blunt body of {area}."
    rivals: ClassVar[Mapping[str, str]] = {
        "guide-friction": "the free fall at small speed: air has no part in it",
        "soil-inertial-drag": "the free fall before contact",
    }
    channels = ("striker/acceleration_z", "striker/velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"area": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"area": Search(1e-3, 10.0, "log")}

    @property
    def factor(self) -> float:
        """1/2 rho C_d A, N s2/m2."""
        return 0.5 * self.density * self.drag_coefficient * self.area


@parameters
class StructuralCompliance(Effect):
    """Nose and body of the striker on a spring and a dashpot, in place of one rigid block."""

    stiffness: Annotated[float | None, Quantity("N/m", "between nose and body", above=0)] = 2e6
    damping: Annotated[float, Quantity("N s/m", "between nose and body", least=0)] = 500.0
    nose_share: Annotated[float, Quantity("1", "of the mass in the nose", above=0, below=1)] = 0.1

    id = "structural-compliance"
    family = "a body that is not rigid"
    equation = "S = k (x_body - x_nose) + c (v_body - v_nose)"
    source = "load cells and bolted strikers, 1e6-1e8 N/m (M-)"
    sentence = "The striker gives way by {stiffness} between its nose and its body."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-lag": "a ringing after the first contact: a lag does not ring",
        "co-moving-mass": "a ringing after the first contact",
    }
    acts = ("drop",)
    channels = ("striker/acceleration_z", "ground/force_normal")
    null: ClassVar[Mapping[str, float | None]] = {"stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"stiffness": Search(1e4, 1e8, "log"), "damping": Search(10.0, 1e4, "log")}


@parameters
class RopsElasticity(Effect):
    """Mounts of the ROPS with another stiffness: together k along y, the other directions in proportion."""

    stiffness: Annotated[float | None, Quantity("N/m", "of all mounts together along y", above=0)] = 3e5

    id = "rops-elasticity"
    family = "a structure that gives way"
    equation = "k_i -> k_i stiffness / sum k_y; dashpots by its root"
    source = "two-post frames about 0.3 MN/m at the top (M)"
    sentence = "The ROPS gives way by {stiffness} to the side."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the deflection of the ROPS, which soft ground leaves alone",
        "mount-play": "the force as the deflection goes to zero: play has a dead zone there",
    }
    acts = ("rollover",)
    channels = ("rops/deflection", "rops/force", "rops/force_y")
    null: ClassVar[Mapping[str, float | None]] = {"stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"stiffness": Search(3e4, 3e7, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Stiffness and damping of every mount."""
        rops = scenario.vehicle.rops if isinstance(scenario.vehicle, Vehicle) else None
        if self.stiffness is None or rops is None:
            return {}
        ratio = self.stiffness / sum(mount.stiffness[1] for mount in rops.mounts)
        found: dict[str, Any] = {}
        for mount in rops.mounts:
            at = f"vehicle.rops.mounts.{mount.name}"
            found[f"{at}.stiffness"] = tuple(ratio * k for k in mount.stiffness)
            found[f"{at}.damping"] = tuple(ratio**0.5 * k for k in mount.damping)
        return found


@parameters
class RopsPlasticity(Effect):
    """Mounts of the ROPS that yield along y, all together at F_y, each by its share of the stiffness."""

    yield_force: Annotated[float | None, Quantity("N", "F_y of all mounts together along y", above=0)] = 34_000.0

    id = "rops-plasticity"
    family = "a structure that gives way"
    equation = "|F_i| <= F_y k_i / sum k"
    source = "F_y 34 kN for a two-post frame of some 3 t (M); faster loading raises it (Cowper and Symonds, M+)"
    sentence = "The ROPS yields at {yield_force} to the side."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the set that stays in the frame",
        "sensor-clipping": "the deflection: it goes on while the force stays",
    }
    acts = ("rollover",)
    channels = ("rops/force", "rops/force_y", "rops/deflection")
    null: ClassVar[Mapping[str, float | None]] = {"yield_force": None}
    search: ClassVar[Mapping[str, Search]] = {"yield_force": Search(3e3, 3e5, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The yield force along y of every mount."""
        rops = scenario.vehicle.rops if isinstance(scenario.vehicle, Vehicle) else None
        if self.yield_force is None or rops is None:
            return {}
        whole = sum(mount.stiffness[1] for mount in rops.mounts)
        found: dict[str, Any] = {}
        for mount in rops.mounts:
            x, _, z = mount.yield_force
            part = self.yield_force * mount.stiffness[1] / whole
            found[f"vehicle.rops.mounts.{mount.name}.yield_force"] = (x, part, z)
        return found


@parameters
class TyreDamping(Effect):
    """Another dashpot along the radius of every tyre."""

    damping: Annotated[float | None, Quantity("N s/m", "of each tyre", least=0)] = 2500.0

    id = "tyre-damping"
    family = "a tyre that is not the one written down"
    equation = "c_z = damping"
    source = "1-5 kN s/m for tractor tyres (M)"
    sentence = "Each tyre is damped by {damping}."
    rivals: ClassVar[Mapping[str, str]] = {"inertia": "a bounce on the spot", "axle-stop": "the angle of the axle"}
    acts = ("rollover",)
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
    source = "0.3-0.7 of the vertical stiffness (M)"
    sentence = "Each tyre gives way to the side by {stiffness}."
    rivals: ClassVar[Mapping[str, str]] = {"centre-of-mass": "a static tilt test with the tyres blocked"}
    acts = ("rollover",)
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

    angle: Annotated[float | None, Quantity("rad", "free swing to either side", above=0, most=0.78)] = 0.2
    stiffness: Annotated[float | None, Quantity("N m/rad", "of a stop", above=0)] = None

    id = "axle-stop"
    family = "a joint that stops elsewhere"
    equation = "torque = stiffness (theta - angle) beyond the angle"
    source = "stops at 8-15 deg (M)"
    sentence = "The front axle meets its stops at {angle}."
    rivals: ClassVar[Mapping[str, str]] = {"inertia": "the angle of the axle at the step in roll acceleration"}
    acts = ("rollover",)
    channels = ("axle/front/angle", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"angle": None, "stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {"angle": Search(0.02, 0.5), "stiffness": Search(1e4, 1e7, "log")}

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
    sentence = "Something spins in the chassis with {angular_momentum}: turning it over turns it aside."
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
