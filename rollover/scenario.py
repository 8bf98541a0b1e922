"""Scenario: everything one run needs, from a YAML file or from Python, checked alike."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from ground.array import CoMovingMass, Elements
from ground.friction import Coulomb, Friction
from ground.kinds import ByKey, ByKind
from ground.law import GroundLaw
from ground.quantity import Later, Quantity, parameters
from ground.surface import Plane, Surface
from rollover.effects import EFFECTS, entries, nothing
from rollover.recording.filters import least_rate
from rollover.recording.signal_file import read_signal
from rollover.spec import document
from rollover.spec.estimates import Estimate, wheel_estimates
from rollover.spec.excitation import Excitation
from rollover.spec.footing import check_standing, check_turning
from rollover.spec.initiation import Driving, Drop, Initiation, Release, Standing, Throw, TipOver
from rollover.spec.inputs import Input, check_inputs
from rollover.spec.inputs.signal import READERS
from rollover.spec.laws import laws
from rollover.spec.rops import Rops
from rollover.spec.stand import PendulumBlow, StaticTest, TiltTable
from rollover.spec.standards.machine_codes import outside
from rollover.spec.standards.static_sequence import sequence
from rollover.spec.steel import Steel
from rollover.spec.vehicle import RigidBody, Striker, Vehicle
from rollover.system import own_code

READERS["file"] = read_signal  # signals out of recordings, which `spec` knows nothing of

AnyVehicle = Annotated[Vehicle | Striker | RigidBody, ByKind()]
AnyLaw = Annotated[GroundLaw, ByKind(laws)]  # whatever law stands in the folder `ground` or in a file of one's own

MOST_STEPS = 100_000_000  # of a run: at 10 us, the least that a step costs, a quarter of an hour
MOST_ROWS = 5_000_000  # of the channels, of which a tractor has a hundred: 4 GB


@parameters
class Patch:
    """A rectangle of the array with a soil of its own: what has its centre inside, edges with low x and y included."""

    low: Annotated[tuple[float, float], Quantity("m", "corner with the smallest x and y")]
    high: Annotated[tuple[float, float], Quantity("m", "corner with the largest x and y")]
    law: AnyLaw
    friction: Annotated[Friction | None, "null: that of the ground around it"] = None

    def validate(self) -> None:
        """Refuse a rectangle turned inside out."""
        if self.low[0] >= self.high[0] or self.low[1] >= self.high[1]:
            got = f"got {list(self.high)} against {list(self.low)}"
            raise ValueError(f"high: must lie beyond low on both axes, {got}; larger x and y than those are needed")


@parameters
class Ground:
    """Surface, array of impact elements and their laws."""

    surface: Surface = Plane()
    elements: Elements
    law: AnyLaw
    friction: Friction = Coulomb()
    co_moving_mass: CoMovingMass = CoMovingMass()
    striker_mass: Annotated[
        Literal["reference", "effective", "clamped"],
        "m_s in the law: the drop test's 132 kg per reference area, the element's share of the effective mass, "
        "or the latter with m v clamped to the calibrated momentum",
    ] = "reference"
    patches: Annotated[tuple[Patch, ...], "parts with another soil; the last one counts where they overlap"] = ()

    def validate(self) -> None:
        """Refuse soil that is pushed aside where the ground keeps no rut to tell what is ahead from what is behind."""
        places = [("", self.friction, self.law)]
        places += [(f"patches.{i}.", p.friction or self.friction, p.law) for i, p in enumerate(self.patches)]
        for name, friction, law in places:
            if friction.bulldozing is not None and law.memoryless:
                kind = getattr(law, "kind", "")  # of one's own laws too
                raise ValueError(
                    f"{name}friction.bulldozing: ground that keeps no rut, got law.kind {kind!r}; a soil that "
                    "sinks in, such as 'bekker-wong' or 'ye-2006', or no bulldozing"
                )

    @property
    def every_law(self) -> list[GroundLaw]:
        """The law of the array, and those of its patches."""
        return [self.law, *(patch.law for patch in self.patches)]


@parameters
class Simulation:
    """Time, step and solver."""

    duration: Annotated[float, Quantity("s", "simulated after t = 0", above=0, most=120)]
    step: Annotated[float, Quantity("s", "of the solver", above=0, most=0.01)] = 0.001
    output_step: Annotated[float, Quantity("s", "between rows of the channels; a multiple of step", above=0)] = 0.001
    spectral_radius: Annotated[float, Quantity("1", "of generalized-alpha at infinity", least=0, most=1)] = 0.7
    integrator: Annotated[
        Literal["auto", "exudyn", "compiled"],
        "who makes the steps: Exudyn, or the same scheme with the same contact forces in one compiled loop, which "
        "takes no test stand and no excitation; auto: Exudyn for a single run, the loop for one of many where it can",
        Later(),
    ] = "auto"
    stop_at_rest: Annotated[bool, "end early once everything has come to rest"] = False

    def validate(self) -> None:
        """Refuse rows that fall between two steps, and a run without any."""
        steps = self.output_step / self.step
        if not self.duration / self.step <= MOST_STEPS:
            least = self.duration / MOST_STEPS
            raise ValueError(
                f"step: too small for the duration, got {self.step!r} s; at least {least:.3g} s is allowed"
            )
        if not self.duration / self.output_step <= MOST_ROWS:
            least = self.duration / MOST_ROWS
            raise ValueError(f"output_step: too small, got {self.output_step!r} s; at least {least:.3g} s is allowed")
        if not steps <= MOST_STEPS:
            raise ValueError(f"output_step: beyond any duration, got {self.output_step!r} s; at most the duration")
        if round(steps) < 1 or abs(steps - round(steps)) > 1e-6 * steps:
            raise ValueError(
                f"output_step: not a multiple of step ({self.step!r} s), got {self.output_step!r}; "
                f"such as {max(1, round(steps)) * self.step:.12g}"
            )
        if self.duration < self.output_step:
            raise ValueError(f"duration: less than output_step ({self.output_step!r} s), got {self.duration!r}; longer")


Standard = Literal[
    "code-3", "code-4", "code-6", "code-7", "sae-j1194", "sae-j2194", "code-8", "iso-8082-1", "iso-12117-2"
]


@parameters
class Loads:
    """How loads are reported."""

    cfc: Annotated[Literal[60, 180, 600, 1000], "filter class of the filtered peaks, SAE J211"] = 60
    standards: Annotated[
        tuple[Standard, ...] | None,
        "whose requirements the run is held against; null: the OECD code that applies to the vehicle",
    ] = None


@parameters
class Scenario:
    """One drop or rollover."""

    format: Literal["rollover-scenario/1"] = "rollover-scenario/1"
    title: Annotated[str, "one line that says what happens"]
    vehicle: AnyVehicle
    ground: Ground
    initiation: Initiation
    simulation: Simulation
    excitation: Annotated[Excitation | None, "what drives a striker besides its weight"] = None
    inputs: Annotated[tuple[Input, ...], Later(), "what is prescribed over time, by signals"] = ()
    loads: Loads = Loads()
    gravity: Annotated[float, Quantity("m/s2", "acceleration of free fall, along -z", least=0, most=30)] = 9.81
    effects: Annotated[
        Mapping[str, Any],
        ByKey("effect", entries, elsewhere="one of your own: `rollover --effects FILE ...`"),
        "terms beyond the basic model, by effect id, with their parameters",
    ] = field(default_factory=dict, hash=False)

    def validate(self) -> None:
        """Refuse parts that do not fit together."""
        for name, parameters_ in self.effects.items():
            if type(parameters_) is EFFECTS.get(name):
                continue  # as nearly all, and a fit makes a hundred thousand of them
            known = entries()
            if name not in known:
                raise ValueError(f"effects: unknown effect, got {name!r}; allowed: {', '.join(known) or 'none'}")
            if not isinstance(parameters_, known[name]):
                raise ValueError(f"effects: not parameters of {name}, got {parameters_!r}; {known[name].__name__}")
        rate = 1.0 / self.simulation.output_step
        if rate < least_rate(self.loads.cfc) * (1.0 - 1e-9):
            raise ValueError(
                f"simulation.output_step: too coarse for filter class CFC {self.loads.cfc}, got {rate:.6g} rows/s; "
                f"at most {1.0 / least_rate(self.loads.cfc):.3g} s is allowed"
            )
        if self.excitation is not None and not isinstance(self.vehicle, Striker):
            raise ValueError(
                f"excitation: drives a striker only, got a vehicle of kind {self.vehicle.kind!r}; 'striker' is allowed"
            )
        _check_start(self.vehicle, self.initiation)
        for i, code in enumerate(self.loads.standards or ()):
            if isinstance(self.vehicle, Vehicle) and (fault := outside(code, self.vehicle.whole.mass)):
                raise ValueError(f"loads.standards.{i}: {fault}")
        check_inputs(self.inputs, self.vehicle, self.initiation)
        if self.simulation.integrator == "compiled" and (fault := _beyond_loop(self.initiation, self.excitation)):
            raise ValueError(f"simulation.integrator: 'compiled' {fault}; 'exudyn' is allowed")

    @property
    def integrator(self) -> Literal["exudyn", "compiled"]:
        """Who makes the steps of this scenario, run as it is."""
        return "exudyn" if self.simulation.integrator == "auto" else self.simulation.integrator

    def of_many(self) -> Scenario:
        """Return this scenario as one of many runs: with the quicker integrator that can run it, unless it states one.

        Every study, ensemble, fit and diagnosis asks here, so that all of them keep to one rule.
        """
        if self.simulation.integrator != "auto":
            return self
        chosen: Literal["exudyn", "compiled"] = (
            "exudyn" if _beyond_loop(self.initiation, self.excitation) else "compiled"
        )
        return replace(self, simulation=replace(self.simulation, integrator=chosen))

    @property
    def own_code(self) -> dict[str, dict[str, dict[str, str]]]:
        """What a result states of files of one's own under `own_code`: SHA-256 by name, of each kind made use of.

        Empty where no effect or law of this scenario is one's own.
        """
        used = {"effects": list(self.effects.values()), "laws": self.ground.every_law}
        found = {k: own_code.hashes(k) for k, things in used.items() if any(own_code.is_own(k, t) for t in things)}
        return {"own_code": found} if found else {}

    def replaced(self, changes: Mapping[str, object], *, origin: str = "replaced") -> Scenario:
        """Return this scenario with values replaced by path, checked exactly like a file.

        Parameters
        ----------
        changes
            ``{"ground.law.stiffness_scale": 1.2, "vehicle.wheels.rear_left.tyre.friction": 0.6}``, SI; elements of a
            list by name or place, a new `kind` starts its part afresh.
        origin
            Where they come from, for messages.

        Returns
        -------
        Scenario

        Raises
        ------
        InputError
            For a path that is none, and a value out of bounds.
        """
        return document.replaced(self, changes, origin)

    @property
    def idle(self) -> tuple[str, ...]:
        """A line for each effect that is switched on, though nothing here need feel it: a striker has no tyres."""
        kind = "drop" if isinstance(self.vehicle, Striker) else "rollover"
        which = "overturns" if kind == "drop" else "drop tests"
        found = []
        for e in (e for e in self.effects.values() if e != nothing(type(e))):
            if kind not in e.acts:
                found.append(f"effects.{e.id}: made for {which}; nothing need feel it here")
            elif e.needs and not e.changes(self):
                found.append(f"effects.{e.id}: needs {e.needs}; nothing feels it here")
        return tuple(found)

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Values that the run needs and no file states; they are worked out from others."""
        if isinstance(self.initiation, Driving) and isinstance(self.vehicle, Vehicle):
            return wheel_estimates(self.vehicle)
        return ()

    def applied(self) -> Scenario:
        """Return this scenario with the values that its effects replace; the effects stay, for their other terms."""
        changed = self
        for effect in self.effects.values():
            changes = effect.changes(changed)
            if changes:
                changed = document.exchanged(changed, changes)
        return changed


def _beyond_loop(start: Initiation, excitation: Excitation | None) -> str:
    """What the compiled loop does not do, or nothing: a stand and an exciter look in after each step, in Python."""
    if isinstance(start, (StaticTest, PendulumBlow, TiltTable)):
        return f"runs no test stand, got initiation.kind {start.kind!r}"
    return "" if excitation is None else f"drives no striker, got excitation.kind {excitation.kind!r}"


def _check_start_of_striker(start: Initiation) -> None:
    if isinstance(start, Release):
        return
    if not isinstance(start, Drop):
        raise ValueError(
            f"initiation.kind: a striker cannot begin so, got {start.kind!r}; 'drop' or 'release' is allowed"
        )
    for name in ("roll_deg", "pitch_deg", "yaw_deg"):
        if getattr(start, name) != 0.0:
            raise ValueError(
                f"initiation.{name}: a striker keeps level on its guide, got {getattr(start, name)!r}; 0 is allowed"
            )


def _check_start(vehicle: Vehicle | Striker | RigidBody, start: Initiation) -> None:
    if isinstance(vehicle, Striker):
        _check_start_of_striker(start)
        return
    if isinstance(start, (StaticTest, PendulumBlow)) and (vehicle.rops is None or not vehicle.rops.members):
        raise ValueError(f"initiation.kind: {start.kind!r} loads a ROPS, got a vehicle without; one with members")
    if isinstance(start, StaticTest) and isinstance(vehicle, Vehicle):
        try:
            sequence(vehicle, start)
        except ValueError as e:
            raise ValueError(f"initiation.{e}") from None
    if isinstance(start, Throw):
        if not isinstance(vehicle, RigidBody):
            raise ValueError(f"initiation.kind: only a rigid body is thrown, got {start.kind!r}; vehicle.kind: body")
        return
    sides = [w.centre[1] for w in vehicle.wheels]
    left, right = sum(y > 0.0 for y in sides), sum(y < 0.0 for y in sides)
    if isinstance(start, TipOver):
        count = left if start.side == "left" else right
        if count < 2 or left + right <= count:
            raise ValueError(
                f"initiation.side: nothing to tip over, got {count} wheels on the {start.side} "
                f"and {left + right - count} on the other side; at least 2 and 1 are needed"
            )
    elif isinstance(start, (Standing, Driving, PendulumBlow, TiltTable)):
        if len(sides) < 3 or not left or not right:
            raise ValueError(
                f"initiation.kind: {start.kind!r} needs at least 3 wheels on both sides, "
                f"got {left} left and {right} right; a vehicle on wheels, or 'drop'"
            )
        if isinstance(vehicle, Vehicle):
            check_standing(vehicle)
            if isinstance(start, Driving):
                check_turning(vehicle)
    elif isinstance(start, (Drop, Release)) and not (
        vehicle.outline or vehicle.wheels or (vehicle.rops and vehicle.rops.members)
    ):
        raise ValueError("vehicle.outline: nothing can touch the ground, got no outline, wheels or ROPS members")


def load(path: str | Path) -> Scenario:
    """Scenario from a file or, by its name, one of the shipped ones. Raises `InputError`."""
    scenario: Scenario = document.load(document.find(path), Scenario)
    return scenario


def given(scenario: str | Path | Scenario) -> tuple[Scenario, Path | None]:
    """A scenario with its file, None where it is one already. Raises `InputError`."""
    if isinstance(scenario, Scenario):
        return scenario, None
    path = document.find(scenario)
    return load(path), path


def schema(part: Literal["scenario", "vehicle", "rops", "steel", "soil"] = "scenario") -> dict[str, Any]:
    """JSON Schema of a scenario file, or of a vehicle, ROPS or soil file on its own."""
    kind: Any = {"scenario": Scenario, "vehicle": AnyVehicle, "rops": Rops, "steel": Steel, "soil": AnyLaw}[part]
    return document.schema(kind, f"rollover {part}")


def with_effects_at(scenario: Scenario, changes: Mapping[str, Any]) -> Scenario:
    """A scenario with values of its effects exchanged, ``{"effects.mass.added": 3.0}``, for the many runs of a fit.

    Effects keep to their own bounds; what does not hang on them is not checked again. Raises as `document.exchanged`
    does.
    """
    found = copy(scenario)
    object.__setattr__(found, "effects", document.exchanged_below(scenario, "effects", changes))
    return found
