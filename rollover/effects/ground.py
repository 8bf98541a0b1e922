"""Effects of the ground: terms of an element's loading curve, of its way back, of the mass that moves along.

Forces are those of the reference face (140 mm x 45 mm) and grow with the area of contact. "Recalled" in a source: from
memory, not held against the print; sure of it, fairly sure, or unsure: where a search starts, not a truth.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground import kernel as k
from ground.friction import Coulomb
from ground.law import REFERENCE_AREA
from ground.quantity import Quantity, parameters
from rollover.effects.effect import Effect, Form, Search
from rollover.spec.vehicle import Striker

FORCE = ("ground/force_normal", "striker/acceleration_z")
SPEED = "a resistance of the ground that grows with speed"
DEPTH = "a resistance of the ground that changes with depth"
CLINGS = "1: soil that moves along stays on the face that lifts off, and is not hit anew; 0: it stays behind"
USUAL_DENSITY = 1800.0  # kg/m3
POWERS = Search(2e-3, 0.5, "log")
BY_POWER = "The ground is stronger by the power {power} of the speed over {reference_speed}."


def clinging(clings: float) -> dict[int, float]:
    """What the kernel is told of soil that stays on the face; nothing where it stays behind, for another may cling."""
    return {k.CLINGS: 1.0} if clings > 0.0 else {}


@parameters
class SoilViscousDamping(Effect):
    """F += d v^zeta while the ground is pushed deeper: viscous and radiation damping."""

    damping: Annotated[float, Quantity("N s/m", "d on the reference face, at zeta 1", least=0)] = 1500.0
    exponent: Annotated[float, Quantity("1", "zeta", above=0, most=3)] = 1.0
    proportion: Annotated[float, Quantity("s/m", "J, of the soil's force that it adds for each m/s", least=0)] = 0.0

    id = "soil-viscous-damping"
    family = SPEED
    equation = "F = F (1 + J v) + d v^zeta, v > 0, on the loading curve"
    source = (
        "Ye 2006 eq (1); half-space c = 3.4 r0^2 sqrt(rho G)/(1 - nu) gives 1.1-3.0 kN s/m for G 5-40 MPa (recalled); "
        "J of Smith's law 0.5-0.65 s/m (recalled, fairly sure)"
    )
    sentence = "The ground resists in proportion to the speed: {damping} on 63 cm2."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-inertial-drag": "drops over a range of speeds of 4 to 1 or more: v against v^2",
        "soil-rate-hardening": "a slow press test: damping vanishes with v, hardening scales with the force",
        "soil-stiffness": "the force as v goes to zero at the deepest point: damping leaves it alone",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"damping": 0.0, "proportion": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"damping": Search(30.0, 1e4, "log"), "exponent": Search(0.5, 2.0)}
    secondary = ("exponent",)
    forms = (
        Form(
            {"damping": 0.0},
            {"proportion": Search(1e-3, 5.0, "log")},
            "The ground resists the more the faster it is pushed: by {proportion} of what it does at rest.",
        ),
    )
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"damping": (1.0, -1.0)}
    becomes: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {
        "soil-inertial-drag": {"coefficient": ("damping", 2.0 / (USUAL_DENSITY * REFERENCE_AREA))}  # at zeta 2
    }

    def wording(self) -> str:
        """Of d v^zeta at another zeta, d is what it amounts to for each m/s at 1 m/s."""
        by_power = "The ground resists with the speed to the power {exponent}: {damping} on 63 cm2 at 1 m/s."
        return super().wording() if self.proportion or self.exponent == 1.0 else by_power

    def places(self) -> Mapping[int, float]:
        """D and zeta, J."""
        return {k.DAMPING: self.damping, k.DAMPING_EXPONENT: self.exponent, k.PROPORTION: self.proportion}


@parameters
class SoilRateHardening(Effect):
    """F *= 1 + lambda log10(v/v_0) for v > v_0: strength that grows with the logarithm of the rate."""

    per_decade: Annotated[float, Quantity("1", "lambda, gain of strength per decade of rate", least=-0.5, most=1)] = 0.1
    reference_speed: Annotated[float, Quantity("m/s", "v_0, below it the strength is that of the law", above=0)] = 0.01
    power: Annotated[
        float, Quantity("1", "beta, of a strength that goes by a power of the rate", least=-0.5, most=1)
    ] = 0.0
    slowest: Annotated[float | None, Quantity("m/s", "rate below which that power goes no further; v_0", above=0)] = (
        None
    )

    id = "soil-rate-hardening"
    solid = True
    family = SPEED
    equation = "F *= 1 + lambda log10(max(v, v_0)/v_0), or (max(v, v_least)/v_0)^beta"
    source = (
        "s_u = s_u0 (1 + lambda log10(rate/rate_0)), lambda 0.05-0.20; a power of the rate, 0.05-0.1 (recalled, fairly "
        "sure); eq (5) of Ye 2006 softens instead"
    )
    sentence = "The ground is {per_decade} stronger for each tenfold speed."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-viscous-damping": "a slow press test and drops at small speed",
        "soil-stiffness": "two speeds a decade apart",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"per_decade": 0.0, "power": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "per_decade": Search(0.01, 0.5, "log"),
        "reference_speed": Search(1e-3, 2.0, "log"),
    }
    secondary = ("reference_speed",)
    forms = (
        Form({"per_decade": 0.0}, {"power": POWERS, "reference_speed": Search(1e-3, 2.0, "log")}, BY_POWER),
        Form(
            {"per_decade": 0.0, "slowest": 1e-3},
            {"power": POWERS, "reference_speed": Search(0.02, 5.0, "log")},
            BY_POWER,
        ),
    )

    def same_as(self) -> Mapping[str, str]:
        """With another v_0 a stiffness: 1 + a log(v/v_1) = c (1 + b log(v/v_0)), c = 1 - a log(v_1/v_0), b = a/c."""
        usual = type(self)().reference_speed
        factor = 1.0 - self.per_decade * math.log10(self.reference_speed / usual)
        if self.power or self.reference_speed == usual or factor <= 0.0:
            return {}
        again = self.per_decade / factor
        said = (
            f"In drops that is the same as ground that is {factor:.3g} times as stiff, and {again:.3g} stronger for "
            f"each tenfold speed beyond {usual:g} m/s."
        )
        return {"soil-stiffness": said}

    def places(self) -> Mapping[int, float]:
        """Lambda, v_0, beta, and where that ends."""
        slowest = self.reference_speed if self.slowest is None else self.slowest
        return {k.PER_DECADE: self.per_decade, k.SLOW: self.reference_speed, k.POWER: self.power, k.SLOWEST: slowest}


@parameters
class SoilInertialDrag(Effect):
    """F += 1/2 C rho A v^2 while the ground is pushed deeper: soil thrown aside (Poncelet)."""

    coefficient: Annotated[float, Quantity("1", "C", least=0)] = 2.0
    density: Annotated[float, Quantity("kg/m3", "rho of the soil", above=0)] = USUAL_DENSITY

    id = "soil-inertial-drag"
    family = SPEED
    equation = "F += 1/2 C rho A v^2, v > 0, on the loading curve"
    source = "Poncelet; C 1-4.4 (recalled), 70-300 N at 3.5 m/s on the reference face"
    sentence = "Soil that is thrown aside resists with the square of the speed, C = {coefficient}."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-viscous-damping": "drops over a range of speeds of 4 to 1 or more: v^2 against v",
        "soil-added-mass-growth": "the acceleration of the rebound: a mass that moves along stays, drag does not",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"coefficient": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"coefficient": Search(0.2, 50.0, "log")}

    def places(self) -> Mapping[int, float]:
        """1/2 C rho A of the reference face."""
        return {k.DRAG: 0.5 * self.coefficient * self.density * REFERENCE_AREA}


@parameters
class SoilAddedMassGrowth(Effect):
    """m_b1 += rate dz A/A_ref as the element goes deeper, with the force dm_b1/dt v that sets it moving.

    On a face it grows with the depth. On a cone, whose area A grows too, it follows the cube of the wetted radius,
    m_b1 = rate/A_ref pi/3 r^3/tan(half angle), until the cone is in: the accompanying mass of a body entering water.
    Behind its reach the growth dies out over `fade`: the water about the cone is not all in motion when its base is in.
    """

    rate: Annotated[float, Quantity("kg/m", "of the co-moving mass with depth, on the reference face", least=0)] = 20.0
    reach: Annotated[
        float | None, Quantity("m", "sinkage up to which it grows; none: a cone's height, no end on a face", above=0)
    ] = None
    fade: Annotated[float, Quantity("m", "sinkage behind the reach over which the growth dies out", least=0)] = 0.0

    id = "soil-added-mass-growth"
    family = SPEED
    equation = (
        "m_b1(z) = m_b1(0) + rate/A_ref integral of g A dz; F_s += rate g A/A_ref v^2 (momentum (m + m_b1) v); "
        "g = 1, behind the reach exp(-(z - reach)/fade)"
    )
    source = (
        "m_b1 = rho A (beta z + alpha sqrt A), rho 1700-2000 kg/m3, rho A = 11 kg/m on the reference face (recalled); "
        "k rho r^3 of a cone, von Karman 1929, Wagner 1932 (recalled, fairly sure); the fade is a number to be fitted"
    )
    sentence = "The soil or fluid that moves along grows by {rate} of depth."
    rivals: ClassVar[Mapping[str, str]] = {
        "co-moving-mass": "the impulse of the first contact at a high sampling rate",
        "soil-inertial-drag": "the acceleration near the deepest point: a mass acts there, drag does not",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"rate": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"rate": Search(1.0, 300.0, "log"), "fade": Search(3e-4, 0.03, "log")}
    secondary = ("fade",)

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """Growth fades behind a cone; on a face it has no end."""
        striker = None if scenario is None else scenario.vehicle
        has_end = isinstance(striker, Striker) and striker.nose == "cone"
        return search if parameter != "fade" or has_end else None

    def places(self) -> Mapping[int, float]:
        """dm_b1/dz."""
        ends = {} if self.reach is None else {k.GROWTH_END: self.reach, k.FADE: self.fade}
        return {k.GROWTH: self.rate, **ends}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The reach that a cone's height gives."""
        striker = scenario.vehicle
        if self.reach is not None or not isinstance(striker, Striker) or striker.nose != "cone":
            return {}
        return {f"effects.{self.id}.reach": striker.nose_height}


@parameters
class SoilElasticRebound(Effect):
    """F = F_max - K_u (z_max - z) with K_u = K'(z_max)/recovery and a light dashpot: ground that springs back."""

    recovery: Annotated[
        float, Quantity("1", "share of z_max that springs back; none below the law's own", least=0, below=1)
    ] = 0.1
    damping_ratio: Annotated[float, Quantity("1", "damping ratio of the unloading path", least=0, most=2)] = 0.1
    clings: Annotated[float, Quantity("1", CLINGS, least=0, most=1)] = 0.0

    id = "soil-elastic-rebound"
    family = "an unloading path that is not the plastic one"
    equation = "K_u = K'(z_max)/max(recovery, that of the law); c_u = 2 damping_ratio sqrt(K_u (m_s + m_b1))"
    source = "rebound of 2-10 % of z_max in clay (recalled); the damping ratio is a guess (recalled, unsure)"
    sentence = "The ground springs back by {recovery} of the deepest sinkage."
    rivals: ClassVar[Mapping[str, str]] = {"soil-adhesion": "the sign of the force at lift-off"}
    channels = ("ground/sinkage", "striker/velocity_z", "ground/force_normal")
    null: ClassVar[Mapping[str, float | None]] = {"recovery": 0.0, "damping_ratio": 1.0}
    search: ClassVar[Mapping[str, Search]] = {"recovery": Search(0.02, 0.6, "log"), "damping_ratio": Search(0.0, 1.0)}
    forms = (Form({"clings": 1.0}, {}),)

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """No less than the law's own share: what changes nothing shows no fit its way."""
        if parameter != "recovery" or scenario is None:
            return search
        least = scenario.ground.law.recovery
        return search._replace(low=least) if search.low < least < search.high else search

    def places(self) -> Mapping[int, float]:
        """The least share that springs back, the dashpot over the critical one, and whether soil clings."""
        return {k.RECOVERY: self.recovery, k.REBOUND_DAMPING: self.damping_ratio, **clinging(self.clings)}


@parameters
class SoilAdhesion(Effect):
    """F >= -c_a A (1 - gap/reach) on the way out: ground that holds the face until a gap has opened."""

    stress: Annotated[float, Quantity("Pa", "c_a, pull-off stress", least=0)] = 5000.0
    reach: Annotated[float, Quantity("m", "gap at which nothing is held any more", above=0)] = 0.005

    id = "soil-adhesion"
    solid = True
    family = "a pull at lift-off"
    equation = "F = max(line, -c_a A max(1 - gap/reach, 0)); gap = rut - z"
    source = "c_a 1-10 kPa in the field, suction up to 80-100 kPa (recalled); the reach is a guess (recalled, unsure)"
    sentence = "The ground holds on to the face with {stress} when it is pulled out."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-bias": "the level before contact: a bias stands there too",
        "soil-elastic-rebound": "a pull-out: lift the striker and watch the sign of the force",
    }
    channels = ("ground/force_normal",)
    null: ClassVar[Mapping[str, float | None]] = {"stress": 0.0}
    search: ClassVar[Mapping[str, Search]] = {"stress": Search(500.0, 2e5, "log"), "reach": Search(5e-4, 0.05, "log")}
    secondary = ("reach",)
    is_discontinuous = True  # what moves along stays on the face until it lets go
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"stress": (1.0, -1.0)}

    def places(self) -> Mapping[int, float]:
        """The pull of the reference face, and its reach."""
        return {k.ADHESION: self.stress * REFERENCE_AREA, k.REACH: self.reach}


@parameters
class SoilLayer(Effect):
    """K' *= ratio below a depth: a hardpan or plough sole, or a soft layer."""

    depth: Annotated[float, Quantity("m", "of the layer's top; sinkage", above=0)] = 0.25
    stiffness_ratio: Annotated[float, Quantity("1", "of K' below to K' above", above=0)] = 3.0
    onset: Annotated[float, Quantity("1", "0: the force jumps at the top; 1: it sets in there", least=0, most=1)] = 0.0
    width: Annotated[float, Quantity("m", "over which K' changes, about the top; 0: at once", least=0)] = 0.0
    stiffness: Annotated[float, Quantity("N/m", "k_h that the layer adds of its own; reference face", least=0)] = 0.0

    id = "soil-layer"
    solid = True
    family = DEPTH
    equation = (
        "F = K'(z) (z + (ratio - 1) (z - onset depth)) + k_h (z - depth) for z > depth; onset 0: F = ratio K'(z) z"
    )
    source = "hardpan at 0.2-0.35 m, cone index ratio 2-4 (recalled)"
    sentence = "Below {depth} the ground is {stiffness_ratio} times as stiff."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-viscous-damping": "two speeds: a layer keeps its depth, damping does not",
        "soil-crust": "a drop that ends above the step in depth",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"stiffness_ratio": 1.0, "stiffness": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "depth": Search(0.005, 0.6, "log"),
        "stiffness_ratio": Search(0.2, 8.0, "log"),
        "width": Search(1e-3, 0.1, "log"),
    }
    secondary = ("width",)
    becomes: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {
        "soil-stiffness": {"scale": ("stiffness_ratio", 1.0)}
    }
    mirrors: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {
        "soil-crust": {"thickness": ("depth", 1.0), "stiffness_ratio": ("stiffness_ratio", -1.0)}
    }
    forms = (
        Form({"onset": 1.0}, {}),
        Form(
            {"stiffness_ratio": 1.0},
            {"stiffness": Search(50.0, 2e6, "log")},
            "Below {depth} the ground pushes back with another {stiffness}.",
        ),
    )

    def places(self) -> Mapping[int, float]:
        """Depth, ratio, how it sets in, and what stiffness it has of its own."""
        whole = {k.LAYER_DEPTH: self.depth, k.LAYER_RATIO: self.stiffness_ratio, k.LAYER_SPRING: self.stiffness}
        return {**whole, k.LAYER_ONSET: self.onset, k.LAYER_WIDTH: self.width}


@parameters
class SoilCrust(Effect):
    """K' *= ratio above a depth: a dry crust, or a soft or wet top."""

    thickness: Annotated[float, Quantity("m", "of the crust; sinkage", above=0)] = 0.04
    stiffness_ratio: Annotated[float, Quantity("1", "of K' in the crust to K' below", above=0)] = 2.0
    width: Annotated[float, Quantity("m", "over which K' changes, about the crust's end; 0: at once", least=0)] = 0.0
    remains: Annotated[float, Quantity("1", "share of what it adds that stays below it", least=0, most=1)] = 0.0

    id = "soil-crust"
    solid = True
    family = DEPTH
    equation = "F = ratio K'(z) z for z < thickness; K'(z) (z + (ratio - 1) remains thickness) below"
    source = "20-80 mm (recalled)"
    sentence = "The upper {thickness} of the ground are {stiffness_ratio} times as stiff as what lies below."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-layer": "a drop that goes deeper than the step in depth",
        "co-moving-mass": "the impulse of the first contact: a crust has none",
    }
    channels = FORCE
    null: ClassVar[Mapping[str, float | None]] = {"stiffness_ratio": 1.0}
    search: ClassVar[Mapping[str, Search]] = {
        "thickness": Search(0.005, 0.2, "log"),
        "stiffness_ratio": Search(0.2, 8.0, "log"),
        "width": Search(1e-3, 0.1, "log"),
    }
    secondary = ("width",)
    becomes: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {
        "soil-stiffness": {"scale": ("stiffness_ratio", 1.0)}
    }
    mirrors: ClassVar[Mapping[str, Mapping[str, tuple[str, float]]]] = {
        "soil-layer": {"depth": ("thickness", 1.0), "stiffness_ratio": ("stiffness_ratio", -1.0)}
    }
    forms = (Form({"remains": 1.0}, {}),)

    def places(self) -> Mapping[int, float]:
        """Depth, ratio, how sharply it ends, and what of it stays below."""
        whole = {k.CRUST_DEPTH: self.thickness, k.CRUST_RATIO: self.stiffness_ratio, k.CRUST_WIDTH: self.width}
        return {**whole, k.CRUST_REMAINS: self.remains}


@parameters
class GroundFriction(Effect):
    """|F_t| <= mu F_n: sliding resistance of the ground's elements, in place of the scenario's coefficient."""

    coefficient: Annotated[float | None, Quantity("1", "mu", least=0, most=2)] = 0.4

    id = "ground-friction"
    family = "a force along the surface"
    equation = "|F_t| <= mu F_n"
    source = "mu 0.13-0.85 in the literature on rollover and skid tests (recalled)"
    sentence = "Friction between structure and ground with mu = {coefficient}."
    rivals: ClassVar[Mapping[str, str]] = {"slope": "the lateral acceleration before contact: friction has none there"}
    acts = ("rollover",)
    channels = ("ground/force_tangential", "chassis/yaw", "chassis/angular_velocity_x")
    null: ClassVar[Mapping[str, float | None]] = {"coefficient": None}
    search: ClassVar[Mapping[str, Search]] = {"coefficient": Search(0.05, 1.2)}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """The scenario's coefficient of friction; Coulomb friction in the place of ground that shears."""
        if self.coefficient is None:
            return {}
        if isinstance(scenario.ground.friction, Coulomb):
            return {"ground.friction.coefficient": self.coefficient}
        return {"ground.friction": Coulomb(coefficient=self.coefficient)}
