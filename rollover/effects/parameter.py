"""Effects that are wrong numbers: the scenario says one thing, the test was another."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground import kernel as k
from ground.quantity import Quantity, parameters
from ground.surface import Plane, Slope
from rollover.effects.effect import Effect, Kind, Search
from rollover.spec.initiation import Drop
from rollover.spec.vehicle import Striker


@parameters
class Mass(Effect):
    """m + added: a driver, ballast, fuel or an adapter that was not weighed."""

    added: Annotated[float, Quantity("kg", "at the centre of mass, beyond what the scenario says")] = 5.0

    id = "mass"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong inertia"
    equation = "m -> m + added"
    source = "driver 75-100 kg (recalled)"
    sentence = "The mass is {added:more|less} than stated."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-gain": "the level at rest, which is m g, against a weighed mass",
        "guide-friction": "the free fall before contact",
    }
    channels = ("ground/force_normal", "striker/acceleration_z")
    null: ClassVar[Mapping[str, float | None]] = {"added": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"added": Search(-100.0, 300.0)}
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"added": (1.0, 0.0)}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The mass of the striker or of the whole vehicle."""
        path = "vehicle.mass" if isinstance(scenario.vehicle, Striker) else "vehicle.whole.mass"
        mass = scenario.vehicle.mass if isinstance(scenario.vehicle, Striker) else scenario.vehicle.whole.mass
        return {path: mass + self.added}


@parameters
class CentreOfMass(Effect):
    """The centre of mass lies higher or further to the left than the scenario says."""

    height: Annotated[float, Quantity("m", "further up", least=-2, most=2)] = 0.05
    lateral: Annotated[float, Quantity("m", "further to the left", least=-2, most=2)] = 0.0

    id = "centre-of-mass"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong inertia"
    equation = "(y, z) -> (y + lateral, z + height)"
    source = "loading, tyres, measurement by axle loads (recalled)"
    sentence = "The centre of mass lies {height:higher|lower} and {lateral:further to the left|further to the right}."
    rivals: ClassVar[Mapping[str, str]] = {
        "inertia": "a static tilt test",
        "slope": "the same test downhill the other way",
        "tyre-lateral-stiffness": "a static tilt test",
    }
    acts = ("rollover",)
    channels = ("chassis/roll", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"height": 0.0, "lateral": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"height": Search(-0.3, 0.3), "lateral": Search(-0.2, 0.2)}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The centre of mass of the whole vehicle; a striker on its guide has none that matters."""
        if isinstance(scenario.vehicle, Striker):
            return {}
        x, y, z = scenario.vehicle.whole.centre_of_mass
        return {"vehicle.whole.centre_of_mass": (x, y + self.lateral, z + self.height)}


@parameters
class Inertia(Effect):
    """J -> scale J: moments of inertia of the whole vehicle."""

    scale: Annotated[float, Quantity("1", "of all moments and products of inertia", above=0, most=10)] = 1.1

    id = "inertia"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong inertia"
    equation = "J -> scale J"
    source = "estimates from the size of a vehicle, 10-20 % (recalled)"
    sentence = "The moments of inertia are {scale} times what was stated."
    rivals: ClassVar[Mapping[str, str]] = {"centre-of-mass": "a static tilt test: inertia has no part in it"}
    acts = ("rollover",)
    channels = ("chassis/angular_velocity_x", "chassis/roll")
    null: ClassVar[Mapping[str, float | None]] = {"scale": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"scale": Search(0.5, 2.0, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Moments and products of inertia of the whole vehicle."""
        if isinstance(scenario.vehicle, Striker):
            return {}
        whole = scenario.vehicle.whole
        return {
            "vehicle.whole.inertia": tuple(self.scale * value for value in whole.inertia),
            "vehicle.whole.products": tuple(self.scale * value for value in whole.products),
        }


@parameters
class SlopeError(Effect):
    """The ground is inclined by more than the scenario says."""

    angle: Annotated[float, Quantity("rad", "further up towards the slope's direction", least=-0.5, most=0.5)] = 0.02

    id = "slope"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong direction of gravity"
    equation = "inclination -> inclination + angle, towards y on level ground"
    source = "1 deg is 0.17 m/s2 (computed)"
    sentence = "The ground is inclined by {angle:more|less} than stated."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-bias": "turn the vehicle round: gravity stays, a bias turns",
        "centre-of-mass": "the same test downhill the other way",
    }
    acts = ("rollover",)
    needs = "a surface of kind plane or slope"
    channels = ("chassis/acceleration_y", "chassis/roll")
    null: ClassVar[Mapping[str, float | None]] = {"angle": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"angle": Search(-0.1, 0.1)}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The surface."""
        surface = scenario.ground.surface
        if self.angle == 0.0 or not isinstance(surface, (Plane, Slope)):
            return {}
        if isinstance(surface, Plane):
            return {"ground.surface": Slope(angle_deg=math.degrees(self.angle))}
        return {"ground.surface.angle_deg": surface.angle_deg + math.degrees(self.angle)}


@parameters
class ImpactSpeed(Effect):
    """v_s -> scale v_s: the drop was from another height than stated."""

    scale: Annotated[float, Quantity("1", "of the speed at first contact", above=0, most=3)] = 1.02

    id = "impact-speed"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong start"
    equation = "v_s -> scale v_s"
    source = "definition"
    sentence = "The speed at first contact is {scale} times what was stated."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-viscous-damping": "the integral of the acceleration before contact",
        "sensor-scale": "the double integral of the acceleration against the displacement",
    }
    needs = "an initiation of kind drop"
    channels = ("striker/velocity_z", "ground/sinkage", "ground/force_normal")
    null: ClassVar[Mapping[str, float | None]] = {"scale": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"scale": Search(0.8, 1.25, "log")}

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """Of what drops, striker or vehicle."""
        return search if scenario is None or isinstance(scenario.initiation, Drop) else None

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The speed of a drop."""
        start = scenario.initiation
        return {"initiation.speed": self.scale * start.speed} if isinstance(start, Drop) else {}


@parameters
class SoilStiffness(Effect):
    """F_law -> scale F_law: ground that is stiffer than its law says at every depth and speed."""

    scale: Annotated[float, Quantity("1", "of the law's force", above=0, most=100)] = 1.2

    id = "soil-stiffness"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong stiffness of the ground"
    equation = "F -> scale F"
    source = "scatter of K' about 27 % (from the correlation of 0.923 in Ye 2006)"
    sentence = "The ground is {scale} times as stiff as its law says."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-viscous-damping": "the force as v goes to zero at the deepest point",
        "guide-friction": "the free fall before contact",
    }
    channels = ("ground/force_normal", "ground/sinkage")
    null: ClassVar[Mapping[str, float | None]] = {"scale": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"scale": Search(0.3, 3.0, "log")}

    def places(self) -> Mapping[int, float]:
        """Factor on the law."""
        return {k.STIFFNESS: self.scale}


@parameters
class CoMovingMassFraction(Effect):
    """m_b1 = fraction m_eff in place of the scenario's."""

    fraction: Annotated[float | None, Quantity("1", "m_b1/m_s", least=0, most=10)] = 0.15

    id = "co-moving-mass"
    kind: ClassVar[Kind] = "parameter"
    family = "a wrong mass of the soil"
    equation = "m_b1 = fraction m_s"
    source = "Ye 2006, Table 1: 0.10 to 0.33, Lorenz 4 to 10"
    sentence = "The soil that moves along is {fraction} of the mass that hits it."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-added-mass-growth": "the impulse of the first contact at a high sampling rate",
        "sensor-scale": "the double integral of the acceleration against the displacement",
        "soil-crust": "the impulse of the first contact at a high sampling rate",
    }
    channels = ("ground/impulse_normal", "striker/velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"fraction": None}
    search: ClassVar[Mapping[str, Search]] = {"fraction": Search(0.005, 2.0, "log")}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The fraction, instead of whatever gave it before."""
        if self.fraction is None:
            return {}
        path = "ground.co_moving_mass"
        return {f"{path}.estimate": None, f"{path}.loss_share": None, f"{path}.fraction": self.fraction}
