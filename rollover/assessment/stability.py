"""Static stability: how steep a slope a vehicle stands on, against its heading, with pivot, stop and tyre deflection.

The vehicle stands on a plane that is tilted slowly and comes to rest at every angle: an overdamped relaxation, whose
damping is that of contacts all of one time constant, finds where. Where a balance ends it goes on to the next one, as
the chassis does when it falls from the free pivot onto the axle's stop, or over. Forces are those of the simulation.

Heading, measured in the slope, is 0 facing uphill, 90 degrees with the vehicle's left downhill, 180 facing downhill.
Wheels grip as on a tilt table with stops: what ends is the balance, not the grip. A ROPS stands rigid on the chassis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ground.surface import Plane
from rollover.dynamics.assembly import tables_of
from rollover.dynamics.bodies import bodies_of
from rollover.dynamics.equilibrium import Equilibrium
from rollover.dynamics.posture import AXLE, PITCH, ROLL, SLIDE
from rollover.kernels.forces import generalised_forces
from rollover.kernels.jacobian import stiffness
from rollover.kernels.step import keep_strain, stand
from rollover.kernels.tables import A_IMPACT, A_SWING, E_FORCE_NOW, E_SHEAR, W_MU, W_ROLLS, Tables
from rollover.scenario import Scenario
from rollover.spec.inertia import combined
from rollover.spec.initiation import Standing
from rollover.spec.vehicle import Attached, Vehicle, seated_still
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
COARSE, FINE = math.radians(3.0), math.radians(0.01)  # of the slope: between rests, and of what happens between two
STEEPEST = math.radians(80.0)
GONE = 0.35  # rad against the slope, beyond the axle's swing: further over, it lies rather than stands
GRIP = 1e9  # friction coefficient of a wheel that a stop holds: as long as it carries anything
UNLOADED = 0.002  # share of its load on level ground with which a wheel carries, and holds, nothing
# share of their load on level ground below which wheels that alone hold a vehicle and do not come to rest let it roll
# off: to hold it they would need some fifty times their load as friction; a degree of slope before they lift
SLIPS = 0.02
REST = 1e-5  # residual forces and moments over the weight
NEAR, LEAST, SADDLE = 0.1, 1e-6, 1e-5  # m or rad at a time; damping, and instability, over the contacts' stiffness
PERTURBATION = 1e-4  # m or rad: the first step off a saddle, four times as long each time it leads back; chosen
PATIENCE = 400


@dataclass(frozen=True, kw_only=True)
class StabilityAngle:
    """Slope angles (rad) for one heading (rad) at which things happen, as the slope grows; None if they do not.

    `lift_off`: the first wheel carries nothing. `phase_one`: the balance on the free pivot ends, a rear wheel is off
    the ground and the chassis turns about the line from the other one to the pivot. `stop`: the front axle rests on
    its stop. `overturn`: no stable equilibrium is left; `first_off` names the wheels that lift first.
    """

    heading: float
    lift_off: float
    phase_one: float | None
    stop: float | None
    overturn: float
    first_off: tuple[str, ...]

    @property
    def balance(self) -> float:
        """Slope on which the balance is first lost: on the free pivot, or over."""
        return self.overturn if self.phase_one is None else self.phase_one


@dataclass(frozen=True, kw_only=True)
class Stance:
    """At rest on a slope (rad), or `gone` over: coordinates, tyres' memory, which wheels are off, axle on its stop."""

    slope: float
    u: Array
    memory: Array
    off: NDArray[np.bool_]
    stopped: bool
    gone: bool


def stability_angles(
    scenario: Scenario, headings: Array, progress: Callable[[int, int], None] | None = None
) -> tuple[StabilityAngle, ...]:
    """Static stability angles for each heading (rad) of a scenario's vehicle, without the scenario's effects.

    Raises `InputError` for what has no wheels to stand on, or does not stand on level ground.
    """
    vehicle = scenario.vehicle
    sides = [w.centre[1] for w in vehicle.wheels] if isinstance(vehicle, Vehicle) else []
    if not isinstance(vehicle, Vehicle) or len(sides) < 3 or not min(sides) < 0.0 < max(sides):
        message = f"needs wheels to stand on, got {vehicle.name!r}; at least three wheels, on both sides"
        raise InputError(Fault(path="vehicle", message=message))
    if vehicle.trailer is not None:
        message = f"a slope for a heading takes one rigid vehicle, got {vehicle.name!r} with a trailer; one without"
        raise InputError(Fault(path="vehicle.trailer", message=message))
    still = _still(scenario, vehicle)
    bodies = bodies_of(still.vehicle, still.ground.elements)
    t = tables_of(still, bodies)
    t.wheel_f[:, W_MU] = GRIP
    if t.wheel_f[:, W_ROLLS].all():
        t.wheel_f[:, W_ROLLS] = 0.0  # braked: nothing else would hold it on a slope
    if len(t.axle_f):
        t.axle_f[A_IMPACT] = 0.0
    found = []
    for k, heading in enumerate(headings):
        statics = Equilibrium(bodies, t, float(heading), still.gravity, np.zeros(3))
        found.append(_followed(_Tilt(statics, [w.name for w in vehicle.wheels]), float(heading)))
        if progress is not None:
            progress(k + 1, len(headings))
    return tuple(found)


def _still(scenario: Scenario, vehicle: Vehicle) -> Scenario:
    """The vehicle alone on a plane: ROPS and all that it carries fixed to the chassis, no outlines, no effects."""
    vehicle = seated_still(vehicle)
    attached = tuple(replace(a, outline=()) for a in _on_chassis(vehicle.attached))
    alone = replace(vehicle, rops=None, attached=attached, outline=())
    ground = replace(scenario.ground, surface=Plane(), patches=())
    return replace(scenario, vehicle=alone, ground=ground, initiation=Standing(), effects={})


def _on_chassis(attached: tuple[Attached, ...]) -> tuple[Attached, ...]:
    """The same masses, those on the ROPS now on the chassis."""
    return tuple(replace(a, carried_by="chassis") if a.carried_by == "rops" else a for a in attached)


class _Tilt:
    """A vehicle on a plane of its own axes: gravity leans away from the normal, towards -x, by the slope."""

    def __init__(self, statics: Equilibrium, names: list[str]) -> None:
        self.statics, self.names = statics, names
        t: Tables = statics.t
        self.t = t
        self.weight = -statics.weight.reshape(-1, 6)[:, 2]
        has_axle = len(t.axle_f) > 0
        self.free = [k for k in range(statics.size) if k != AXLE or has_axle]
        self.swing = float(t.axle_f[A_SWING]) if has_axle else math.inf
        self.pace = np.where(np.isin(self.free, (SLIDE, SLIDE + 1)), 0.01, 1.0)  # the plane is the same everywhere
        self.holds = t.wheel_f[:, W_ROLLS] == 0.0
        self.by_chassis = t.wheel_i == 0
        self.lower = np.eye(len(self.free))
        self.memory = t.wheel_memory.copy()
        self.loads = np.full(len(t.wheel_i), self.weight.sum() / len(t.wheel_i))  # N, until they are known

    def level(self) -> Stance:
        """At rest on level ground. Raises `InputError` if it is not."""
        statics, t = self.statics, self.t
        self._lean(0.0)
        u = statics.guess()
        statics.residual(u)
        stand(statics.handle)
        statics.residual(u)
        K = np.zeros((statics.weight.size, statics.weight.size))
        stiffness(statics.handle, 1.0, 0.0, K)
        T = statics.tangents(u)[self.free]
        self.lower[:] = np.linalg.cholesky(T @ K @ T.T / statics.scale + 1e-3 * np.eye(len(self.free)))
        self.memory = t.wheel_memory.copy()
        stance = self._rest(0.0, u)
        if stance.gone:
            message = "does not stand on level ground, got no stable equilibrium; check wheels and centre of mass"
            raise InputError(Fault(path="vehicle", message=message))
        self._residual(stance.u)
        self.loads = np.maximum(t.wheel_memory[:, E_FORCE_NOW], 1e-3 * self.weight.sum())
        stand(statics.handle)  # whatever the search has strained
        return replace(stance, memory=t.wheel_memory.copy())

    def at(self, slope: float, before: Stance) -> Stance:
        """Where it comes to rest on a slope (rad) after another one."""
        self.memory = before.memory
        self._lean(slope)
        return self._rest(slope, before.u)

    def _lean(self, slope: float) -> None:
        weight = self.statics.weight.reshape(-1, 6)
        weight[:, 0], weight[:, 2] = -self.weight * math.sin(slope), -self.weight * math.cos(slope)

    def _rest(self, slope: float, start: Array) -> Stance:
        """Relax: D du/dt = r(u), linearly implicit with steps as long as their prediction holds.

        (D/tau + K) du = r predicts r(u + du) = D du/tau. D is the contacts' stiffness on level ground; in coordinates
        that make it 1, 1/tau is a damping over the contacts' stiffness. It stays above what instability there is, so
        that the way goes down, never to a saddle.
        """
        u, damping, perturbation = start.copy(), LEAST, PERTURBATION
        r = self._residual(u)
        for _ in range(PATIENCE):
            K = self._stiffness(u, r)
            least, way = self._softest(K)
            if float(np.max(np.abs(self.lower @ r))) < REST:
                if least > -SADDLE:
                    return self._stance(slope, u, gone=False)
                perturbation *= 4.0  # a saddle
                u[self.free] += perturbation * np.linalg.solve(self.lower.T, way)
                r = self._residual(u)
                continue
            while damping < 1e12:
                damping = max(damping, LEAST, -2.0 * least)
                step = np.linalg.solve(K + damping * np.eye(len(r)), r)
                du = np.linalg.solve(self.lower.T, step)
                trial = u.copy()
                trial[self.free] += du
                found = self._residual(trial)
                miss = float(np.linalg.norm(found - damping * step) / np.linalg.norm(r))
                far = float(np.max(np.abs(du) * self.pace))
                if far < NEAR and miss < 0.6:
                    break
                damping *= 6.0
            if miss < 0.3:
                damping *= 0.1
            u, r = trial, found
            self.memory = self.t.wheel_memory.copy()
            # without a wheel that holds it rolls off
            held = bool((self.memory[:, E_FORCE_NOW] > UNLOADED * self.loads)[self.holds].any())
            if abs(u[PITCH]) > GONE or abs(u[ROLL]) > GONE + min(self.swing, GONE) or not held:
                return self._stance(slope, u, gone=True)
        if (self.memory[:, E_FORCE_NOW] / self.loads)[self.holds].max() < SLIPS:
            return self._stance(slope, u, gone=True)
        raise ArithmeticError(
            f"no rest was found on a slope of {math.degrees(slope):.2f} deg at heading "
            f"{math.degrees(self.statics.heading):g} deg, got a residual of {np.max(np.abs(r)):.1e}"
        )

    def _residual(self, u: Array) -> Array:
        """Virtual work over the weight, in coordinates that make the contacts' stiffness 1.

        Friction acts where the tread is lowest now. The stick springs hold in proportion to the load, so that what
        holds is shared as by equal friction and goes smoothly as a wheel lifts; off the ground it holds nothing.
        """
        statics, memory = self.statics, self.t.wheel_memory
        memory[:] = self.memory
        (q, rows), Q = statics.placed(u), np.zeros(statics.weight.size)
        generalised_forces(statics.handle, q, np.zeros_like(Q), Q)
        keep_strain(statics.handle)
        strain = memory[:, E_SHEAR : E_SHEAR + 3].copy()
        memory[:, E_SHEAR : E_SHEAR + 3] *= (memory[:, E_FORCE_NOW] / self.loads)[:, None]
        generalised_forces(statics.handle, q, np.zeros_like(Q), Q)
        memory[:, E_SHEAR : E_SHEAR + 3] = strain
        r = rows @ (Q + statics.weight) / statics.scale
        return np.asarray(np.linalg.solve(self.lower, r[self.free]))

    def _stiffness(self, u: Array, r: Array) -> Array:
        """-dr/du by differences."""
        eps, K = 1e-7, np.empty((len(r), len(r)))
        for column, k in enumerate(self.free):
            stepped = u.copy()
            stepped[k] += eps
            K[:, column] = (r - self._residual(stepped)) / eps
        return np.asarray(np.linalg.solve(self.lower, K.T).T)

    @staticmethod
    def _softest(K: Array) -> tuple[float, Array]:
        """Least real part of the eigenvalues, and the real part of its direction."""
        values, vectors = np.linalg.eig(K)
        k = int(np.argmin(values.real))
        return float(values[k].real), np.asarray(vectors[:, k].real)

    def _stance(self, slope: float, u: Array, *, gone: bool) -> Stance:
        off = self.memory[:, E_FORCE_NOW] <= UNLOADED * self.loads
        stopped = abs(float(u[AXLE])) >= self.swing
        return Stance(slope=slope, u=u, memory=self.memory, off=off, stopped=stopped, gone=gone)


def _followed(tilt: _Tilt, heading: float) -> StabilityAngle:
    """Tilt until it goes over; close in on each thing that happened between two slopes."""
    stances = [tilt.level()]
    while not stances[-1].gone:
        if stances[-1].slope >= STEEPEST:
            message = f"stands on {math.degrees(STEEPEST):g} deg, got heading {math.degrees(heading):g} deg"
            raise InputError(Fault(path="vehicle", message=f"{message}; a vehicle that can go over"))
        stances.append(tilt.at(stances[-1].slope + COARSE, stances[-1]))

    def first(happened: Callable[[Stance], bool]) -> Stance | None:
        while True:
            k = next((k for k, s in enumerate(stances) if happened(s)), None)
            if k is None or k == 0:
                return None if k is None else stances[0]
            low, high = stances[k - 1], stances[k]
            if high.slope - low.slope <= FINE:
                return high
            stances.insert(k, tilt.at(0.5 * (low.slope + high.slope), low))

    over = first(lambda s: s.gone)
    lifted = first(lambda s: bool(s.off.any()) or s.gone)
    assert over is not None
    assert lifted is not None
    stop = phase_one = None
    met = first(lambda s: s.stopped or s.gone)
    if met is not None and met.stopped:
        stop = None if met.gone else met.slope
        turned = (met.off & tilt.by_chassis).any()
        phase_one = met.slope if turned else None
    return StabilityAngle(
        heading=heading,
        lift_off=lifted.slope,
        phase_one=phase_one,
        stop=stop,
        overturn=over.slope,
        first_off=tuple(name for name, off in zip(tilt.names, lifted.off, strict=True) if off),
    )


@dataclass(frozen=True, kw_only=True)
class Loss:
    """What a part costs: the slope (rad) that the vehicle stands on across it, its weaker side, without it and with."""

    part: str
    mass: float
    without: float
    beside: float  # with it

    @property
    def share(self) -> float:
        """Of the angle without it."""
        return 1.0 - self.beside / self.without


DRIVER = 75.0  # kg, as in the standards' reference mass
SEATED = 0.25  # m, of a seated driver's centre of mass above the seat reference point; estimate


def losses(scenario: Scenario) -> tuple[Loss, ...]:
    """What the ROPS, each attached mass and a driver cost; none for what the vehicle does not have.

    The ROPS is part of the vehicle's mass and taken off it. A driver of 75 kg is added where there is a seat reference
    point and nothing attached is called driver. Raises `InputError` as `stability_angles`.
    """
    vehicle = scenario.vehicle
    assert isinstance(vehicle, Vehicle)

    def side(vehicle: Vehicle) -> float:
        both = stability_angles(replace(scenario, vehicle=vehicle), np.array([0.5, 1.5]) * math.pi)
        return min(a.balance for a in both)

    given = side(vehicle)
    found = []
    if vehicle.rops is not None:
        parts = [body for body, _ in vehicle.rops.parts.values()]
        bare = replace(
            vehicle, whole=combined([vehicle.whole], less=parts), rops=None, attached=_on_chassis(vehicle.attached)
        )
        mass = sum(p.mass for p in parts)
        found.append(Loss(part="ROPS", mass=mass, without=side(bare), beside=given))
    if (occupant := vehicle.occupant) is not None:
        empty = replace(vehicle, occupant=None)
        found.append(Loss(part="occupant", mass=occupant.mass, without=side(empty), beside=given))
    for a in vehicle.attached:
        rest = replace(vehicle, attached=tuple(b for b in vehicle.attached if b is not a))
        found.append(Loss(part=a.name, mass=a.mass, without=side(rest), beside=given))
    zone = vehicle.rops.clearance_zone if vehicle.rops is not None else None
    if zone is not None and vehicle.occupant is None and all("driver" not in a.name for a in vehicle.attached):
        x, y, z = zone.seat_reference_point
        driver = Attached(name="driver", mass=DRIVER, centre_of_mass=(x, y, z + SEATED), size=(0.4, 0.4, 0.9))
        manned = side(replace(vehicle, attached=(*vehicle.attached, driver)))
        found.append(Loss(part=f"driver of {DRIVER:g} kg", mass=DRIVER, without=given, beside=manned))
    return tuple(found)
