"""Effects of what drops: the guide that it falls on, the air, a nose that gives way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground.quantity import Quantity, parameters
from rollover.effects.effect import Effect, Form, Search
from rollover.effects.ground import CLINGS, clinging
from rollover.spec.initiation import Release
from rollover.spec.vehicle import Striker

AIR_DENSITY = 1.204  # kg/m3 at 20 degrees and 1013 hPa
AIR_VISCOSITY = 1.51e-5  # m2/s
CRITICAL = (1e5, 4e5)  # Reynolds numbers of the drag crisis of a sphere, rough and smooth (Achenbach, recalled)


@parameters
class GuideFriction(Effect):
    """F = -F_c sign(v): Coulomb friction of the guide that a striker falls on.

    A guide that is oiled or shakes creeps under less than F_c: F = -F_c tanh(v/v_c).
    """

    force: Annotated[float, Quantity("N", "F_c", least=0)] = 80.0
    creep: Annotated[float, Quantity("m/s", "v_c below which it gives way; 0: it holds", least=0)] = 0.0

    id = "guide-friction"
    family = "a drag on the falling body"
    equation = "F = -F_c sign(v) along the guide, at rest as much of it as holds; with creep F = -F_c tanh(v/v_c)"
    source = "20-200 N in drop rigs (recalled)"
    sentence = "The guide brakes the striker with {force}."
    rivals: ClassVar[Mapping[str, str]] = {
        "soil-stiffness": "the free fall before contact: it is slower than g",
        "air-drag": "the free fall at small speed: friction is there at once",
        "mass": "the free fall before contact: every mass falls with g",
    }
    acts = ("drop",)
    channels = ("striker/acceleration_z", "striker/velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"force": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "force": Search(5.0, 600.0, "log"),
        "creep": Search(5e-4, 0.05, "log"),
    }
    secondary = ("creep",)
    is_abrupt = True
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"force": (1.0, 0.0)}


@parameters
class AirDrag(Effect):
    """F = -1/2 rho C_d A v |v| on the centre of mass of the striker or the chassis.

    Behind a round body the flow closes above a critical speed: with `crisis_speed` C_d falls there to `crisis_ratio`
    of itself, C_d (r + (1 - r)/(1 + exp((v/v_c - 1)/0.1))).
    """

    area: Annotated[float, Quantity("m2", "A, frontal", least=0)] = 0.05
    drag_coefficient: Annotated[float, Quantity("1", "C_d", above=0, most=5)] = 1.0
    density: Annotated[float, Quantity("kg/m3", "rho", above=0)] = AIR_DENSITY
    crisis_speed: Annotated[float | None, Quantity("m/s", "v_c of the drag crisis; none: no crisis", above=0)] = None
    crisis_ratio: Annotated[float, Quantity("1", "C_d above v_c over that below", above=0, most=1)] = 0.25

    id = "air-drag"
    family = "a drag on the falling body"
    equation = "F = -1/2 rho C_d A v |v|"
    source = (
        "C_d of blunt bodies about 1 (recalled, fairly sure); 60 N at 5 m/s on a tractor: as a rule not observable; "
        "C_d of a smooth sphere 0.5, beyond Re 2e5 to 4e5 0.1 to 0.2 (Achenbach, J. Fluid Mech. 54, 1972; recalled, "
        "fairly sure)"
    )
    sentence = "The air brakes the fall like a blunt body of {area}."
    rivals: ClassVar[Mapping[str, str]] = {
        "guide-friction": "the free fall at small speed: air has no part in it",
        "soil-inertial-drag": "the free fall before contact",
    }
    channels = ("striker/acceleration_z", "striker/velocity_z")
    null: ClassVar[Mapping[str, float | None]] = {"area": 0.0}
    search: ClassVar[Mapping[str, Search]] = {
        "area": Search(1e-3, 10.0, "log"),
        "crisis_speed": Search(5.0, 40.0, "log"),
    }
    secondary = ("crisis_speed",)
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"area": (2.0 / 3.0, 0.0)}

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """A drag crisis where the Reynolds number of a sphere as large as the face is critical, and in a fall alone."""
        if parameter != "crisis_speed":
            return search
        body = None if scenario is None else scenario.vehicle
        if not isinstance(body, Striker) or not isinstance(scenario.initiation, Release):
            return None
        across = 2.0 * math.sqrt(body.face_length * body.face_width / math.pi)
        low, high = (re * AIR_VISCOSITY / across for re in CRITICAL)
        return Search(low, high, "log")

    @property
    def factor(self) -> float:
        """1/2 rho C_d A, N s2/m2."""
        return 0.5 * self.density * self.drag_coefficient * self.area

    @property
    def critical(self) -> float:
        """Speed of the drag crisis, m/s; infinite without one."""
        return math.inf if self.crisis_speed is None else self.crisis_speed


@parameters
class StructuralCompliance(Effect):
    """Nose and body of the striker on a spring and a dashpot, in place of one rigid block."""

    stiffness: Annotated[float | None, Quantity("N/m", "between nose and body", above=0)] = 2e6
    damping: Annotated[float, Quantity("N s/m", "between nose and body", least=0)] = 500.0
    nose_share: Annotated[float, Quantity("1", "of the mass in the nose", above=0, below=1)] = 0.1
    clings: Annotated[float, Quantity("1", CLINGS, least=0, most=1)] = 0.0

    id = "structural-compliance"
    family = "a body that is not rigid"
    equation = "S = k (x_body - x_nose) + c (v_body - v_nose)"
    source = "load cells and bolted strikers, 1e6-1e8 N/m (recalled, unsure)"
    sentence = "The striker is compliant by {stiffness} between its nose and its body."
    rivals: ClassVar[Mapping[str, str]] = {
        "sensor-lag": "a ringing after the first contact: a lag does not ring",
        "co-moving-mass": "a ringing after the first contact",
    }
    acts = ("drop",)
    channels = ("striker/acceleration_z", "ground/force_normal")
    null: ClassVar[Mapping[str, float | None]] = {"stiffness": None}
    search: ClassVar[Mapping[str, Search]] = {
        "stiffness": Search(1e4, 1e8, "log"),
        "damping": Search(10.0, 1e4, "log"),
        "nose_share": Search(0.02, 0.6, "log"),
    }
    secondary = ("nose_share",)
    forms = (Form({"clings": 1.0}, {}),)
    is_abrupt = True
    grows: ClassVar[Mapping[str, tuple[float, float]]] = {"stiffness": (1.0, 0.0), "damping": (1.0, 0.0)}

    @classmethod
    def looked_for(cls, parameter: str, search: Search, scenario: Any) -> Search | None:
        """Of a nose that was weighed its share is known."""
        is_known = scenario is not None and cls.id in scenario.effects
        return None if parameter == "nose_share" and is_known else search

    @classmethod
    def reshaped(cls, numbers: Mapping[str, float], shape: str, value: float) -> Mapping[str, float]:
        """Frequency and damping stay, k and c in proportion to the reduced mass M s (1 - s) of nose and body."""
        more = value * (1.0 - value) / (numbers[shape] * (1.0 - numbers[shape]))
        return {**{name: more * v for name, v in numbers.items() if name != shape}, shape: value}

    def places(self) -> Mapping[int, float]:
        """Whether soil clings to the nose that lifts off."""
        return clinging(self.clings)
