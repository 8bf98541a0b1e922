"""`rollover rops` between reading and writing: a frame alone under a static test's sequence, load after load."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rollover.assessment.clearance import signed_distance
from rollover.assessment.criterion import Criterion, judged
from rollover.assessment.virtual_tests import concluded, overload, pairs
from rollover.dynamics.frame.connected import connected
from rollover.dynamics.frame.equilibrium import Frame, Support
from rollover.dynamics.frame.mesh import mesh
from rollover.dynamics.frame.push import Point, State, at_rest, let_go, push
from rollover.dynamics.frame.yielding import yielding
from rollover.dynamics.stands.static_load import (
    OVERLOAD_DROP,
    OVERLOAD_LEAST_FORCE,
    OVERLOAD_MOST,
    OVERLOAD_STEP,
    fall,
)
from rollover.scenario import Scenario
from rollover.spec.feet import REACH
from rollover.spec.rops import Rops
from rollover.spec.stand import DIRECTION, StaticTest
from rollover.spec.standards.codes import STANDARDS, STATIC
from rollover.spec.standards.static_sequence import BEAM, Push, sequence, tractor_of, usual_code
from rollover.spec.vehicle import Vehicle
from rollover.system.arguments import SEGMENTS
from rollover.system.errors import Fault, InputError

STEP = 0.004  # m of deflection; a standard asks for points 0.015 m apart at most


@dataclass(frozen=True, kw_only=True)
class FrameTest:
    """The frame, what each load did to it, and what that says of the standard."""

    scenario: Scenario
    rops: Rops
    frame: Frame
    clamped: bool
    segments: int
    speed: float  # m/s of each load, 0 without the rate of strain
    tests: tuple[dict[str, Any], ...]
    criteria: tuple[Criterion, ...]
    last: State


def frame_test(
    scenario: Scenario,
    *,
    segments: int = SEGMENTS,
    clamped: bool = False,
    speed: float = 0.0,
    progress: Callable[[int, int], None] | None = None,
) -> FrameTest:
    """The static sequence of a scenario's vehicle on its ROPS alone; `progress(done, of)` is told.

    `clamped` holds the feet still instead of on their mounts; at a `speed` (m/s) of the loads steels with a rate factor
    yield higher. Raises `InputError` for a ROPS without sections, in two parts, with a mount where there is no member,
    and for a speed where no rate factor is.
    """
    vehicle = scenario.vehicle
    rops = vehicle.rops if isinstance(vehicle, Vehicle) else None
    if rops is None or not isinstance(vehicle, Vehicle):
        raise InputError(Fault(path="vehicle.rops", message="none given, got a vehicle without one; a ROPS"))
    _refuse(rops, speed)
    test = scenario.initiation if isinstance(scenario.initiation, StaticTest) else StaticTest()
    try:
        loads = sequence(vehicle, test)
        frame = _frame(rops, loads, segments, clamped)
    except ValueError as e:
        path, _, message = str(e).partition(": ")
        raise InputError(Fault(path=path, message=message)) from None
    state, tests = at_rest(frame), []
    for k, load in enumerate(loads):
        entry, state = _loaded(frame, state, load, test, rops, speed)
        tests.append(entry)
        if progress is not None:
            progress(k + 1, len(loads))
    # as the sequence: a listed second lengthways load is asked, a frame of itself is only asked where it folds
    tractor = tractor_of(vehicle, folding=True if test.loads is not None else None)
    names = scenario.loads.standards or (test.code or usual_code(vehicle),)
    asked = [r for name in names for r in STANDARDS[name](tractor)]
    rows: list[Criterion] = []
    for load, requirement in pairs(loads, asked):
        entry = tests[[e["name"] for e in tests].index(load.name)]
        broken = (e for e in tests[: tests.index(entry)] if e.get("broken"))
        before = next((f"{e['broken']} gave way in load {e['name']!r}" for e in broken), "")
        rows.append(_judged(load, entry, requirement, before))
        if entry["overload"] and requirement.source == STATIC:
            rows.append(overload(load, entry, requirement))
    return FrameTest(
        scenario=scenario,
        rops=rops,
        frame=frame,
        clamped=clamped,
        segments=segments,
        speed=speed,
        tests=tuple(tests),
        criteria=tuple(rows),
        last=state,
    )


def _refuse(rops: Rops, speed: float) -> None:
    if not rops.beams:
        message = (
            "no member has a section, got tubes and boxes alone; members with `section` and `material`, as "
            "{name: post, start: [0, 0.5, 0.8], end: [0, 0.5, 2.4], section: {tube: [80, 80, 5]}, material: S355}"
        )
        raise InputError(Fault(path="vehicle.rops.members", message=message))
    if rops.upper is not None:
        message = "a frame in two parts is not calculated alone, got an upper part on hinges; null, or `rollover run`"
        raise InputError(Fault(path="vehicle.rops.upper", message=message))
    factors = [*(b.material.rate_factor for b in rops.beams), *(m.rate_factor for m in rops.mounts)]
    if speed > 0.0 and not any(factors):
        names = ", ".join(sorted({b.material.name for b in rops.beams}))
        cure = "`material: {base: S355, rate_factor: {rate: 3200, exponent: 5}}` for one that has"
        message = f"no steel has a rate factor, got {names}; {cure}"
        raise InputError(Fault(path="--speed", message=message))


def _frame(rops: Rops, loads: Sequence[Push], segments: int, clamped: bool) -> Frame:
    beams = rops.beams
    points = {f"vehicle.rops.mounts.{m.name}": m.position for m in rops.mounts}
    points |= {f"vehicle.rops.feet.{f.name}": f.position for f in rops.feet}
    mesh(beams, points, 2, REACH)  # a mount away from every member is refused
    whole = mesh(beams, points | {load.name: load.point for load in loads}, segments)
    supports = [
        Support(name=m.name, node=whole.at[f"vehicle.rops.mounts.{m.name}"], connector=None if clamped else m)
        for m in rops.mounts
    ]
    supports += [Support(name=f.name, node=whole.at[f"vehicle.rops.feet.{f.name}"]) for f in rops.feet]
    return Frame(whole, supports)


def _pressed(frame: Frame, load: Push) -> dict[int, float]:
    """Nodes that a beam presses, with their shares.

    A crushing beam lies across the frame on a universal joint: it shares its force between the outermost joints at the
    top near that end. Any other beam meets the place that is named.
    """
    if load.come_from == "above":
        nodes = frame.mesh.nodes
        top = nodes[:, 2].max()
        near = [k for k in frame.mesh.joints if nodes[k, 2] >= top - BEAM and abs(nodes[k, 0] - load.point[0]) <= BEAM]
        if near:
            y = nodes[near, 1]
            left, right = near[int(np.argmax(y))], near[int(np.argmin(y))]
            if left != right:
                return {left: 0.5, right: 0.5}
    return {frame.mesh.at[load.name]: 1.0}


class _Goal:
    """Says when a load has gone far enough: its energy or force, the overload test after it, failure where asked."""

    def __init__(self, load: Push) -> None:
        self.load = load
        self.over: dict[str, Any] = {}
        self.target = float(load.energy or load.force or 0.0)
        self.before = 0.0  # force at the energy before
        self.there: Point | None = None
        self.absorbed = False
        self.failed = ""

    @property
    def size(self) -> float:
        """What is asked for now, J or N."""
        return self.target

    def missing(self, point: Point) -> float:
        """What a point still lacks."""
        return math.inf if self.absorbed else self.target - (point.force if self.load.energy is None else point.energy)

    def reached(self, points: list[Point]) -> bool:
        """Whether the load ends with the last point."""
        now = points[-1]
        if self.absorbed and now.force < OVERLOAD_LEAST_FORCE * max(p.force for p in points):
            self.failed = "the force fell below 0.8 of its greatest"
            return True
        if self.missing(now) > 0.0 or (self.load.energy is not None and self._overloaded(points)):
            return False
        self.absorbed = self.load.until_failure
        return not self.absorbed

    def _overloaded(self, points: list[Point]) -> bool:
        """Whether the overload test asks for more energy; its report goes into `over`."""
        assert self.load.energy is not None
        x, y = np.array([(p.deflection, p.force) for p in points]).T
        extra, now = self.target / self.load.energy - 1.0, points[-1]
        if not self.over:
            drop = fall(x, y)
            self.there = now
            self.over = {"fall": drop, "required": drop > OVERLOAD_DROP, "extra_energy": 0.0, "passed": None}
        elif self.over["required"]:
            drop = 1.0 - now.force / self.before
            self.over["extra_energy"] = extra
            self.over["passed"] = bool(drop <= OVERLOAD_DROP and now.force > OVERLOAD_LEAST_FORCE * y.max())
        if self.over["required"] and not self.over["passed"] and extra < OVERLOAD_MOST - 1e-9:
            self.target, self.before = self.target + OVERLOAD_STEP * self.load.energy, now.force
            return True
        return False


def _loaded(
    frame: Frame, state: State, load: Push, test: StaticTest, rops: Rops, speed: float
) -> tuple[dict[str, Any], State]:
    """What one load did, as a static test of `rollover run` says it, with where the frame yielded; the frame let go."""
    energy = load.energy is not None
    asked = load.asked.value if load.asked is not None else load.energy if energy else load.force
    entry: dict[str, Any] = {
        "kind": "static-load",
        "name": load.name,
        "come_from": load.come_from,
        "required_energy": asked if energy else None,
        "required_force": None if energy else asked,
        "given": load.energy if energy else load.force,
        "by": None if load.asked is None else f"{load.asked.standard}: {load.asked.formula}",
        "overload": {},
    }
    if not (load.energy or load.force):
        return entry | {"status": "not a step of the code"}, state
    c = frame.pattern(_pressed(frame, load), DIRECTION[load.come_from])
    goal = _Goal(load)
    first = float(c @ state.u)
    points, how = push(frame, state, c, step=STEP, most=test.most_deflection, goal=goal, speed=speed)
    if goal.failed or (goal.absorbed and load.until_failure):
        how = f"pushed on until it failed: {goal.failed or how.removeprefix('given up: ')}"
    last = points[-1]
    entry |= {
        "status": how,
        "energy": last.energy,
        "deflection": last.deflection,
        "force": last.force,
        "peak_force": max(p.force for p in points),
        "overload": goal.over,
        "curve": [[p.deflection, p.force] for p in points],
        **({"energy_at": goal.there.deflection} if goal.there is not None else {}),
        **yielding(frame, points),
        **_intrusion(frame, points, rops),
        **connected(frame, rops.connections, points),
    }
    try:
        # back at the same speed, as far as a spring of the first stiffness would go
        h = last.force / entry["stiffness"] / speed if speed > 0.0 else math.inf
        after = let_go(frame, last.state, c, last.force, h)
        entry["permanent_set"] = float(c @ after.u) - first
    except ArithmeticError:
        after = last.state  # nothing stands any more to spring back
        entry["permanent_set"] = last.deflection
    return entry, after


def _intrusion(frame: Frame, points: Sequence[Point], rops: Rops) -> dict[str, Any]:
    """Least distance of the members from the clearance zone, and the first point inside it that was not before."""
    if rops.clearance_zone is None:
        return {"zone_distance": None, "entered": None}
    radius = np.zeros(len(frame.mesh.nodes))
    for i, b in enumerate(frame.mesh.beams):
        own = frame.mesh.ends[frame.mesh.beam == i].ravel()
        radius[own] = np.maximum(radius[own], 0.5 * b.tube.diameter)
    away = []
    for p in points:
        at = frame.mesh.nodes + p.state.u.reshape(-1, 6)[:, :3]
        away.append(float((signed_distance(rops.clearance_zone, at) - radius).min()))
    inside = [k for k, d in enumerate(away) if d < 0.0]
    entered = None
    if inside and away[0] >= 0.0:
        p = points[inside[0]]
        entered = {"deflection": p.deflection, "force": p.force, "energy": p.energy}
    return {"zone_distance": min(away), "entered": entered}


def _judged(load: Push, entry: Mapping[str, Any], requirement: Any, before: str) -> Criterion:
    """The verdict on a load; `before` says which connection gave way before it, if one did."""
    simulated = float(entry.get(requirement.quantity, 0.0))
    note = f"load {load.name!r} {entry['status']}"
    if "deflection" in entry:
        note += f" at {1e3 * entry['deflection']:.0f} mm and {1e-3 * entry['force']:.1f} kN"
        note += f", {round(1e3 * entry['permanent_set']) + 0:d} mm permanent set"
    if (entered := entry.get("entered")) is not None:
        note += f"; a member entered the clearance zone at {1e3 * entered['deflection']:.0f} mm"
        return judged(requirement, min(simulated, entered[requirement.quantity]), note)
    if before:
        return judged(requirement, 0.0, f"{note}; {before}")
    if entry.get("broken") is not None:
        at = next(row["failed"] for row in entry["connections"] if row["name"] == entry["broken"])
        note += f"; {entry['broken']} gives way at {1e3 * at['deflection']:.0f} mm and {1e-3 * at['force']:.1f} kN"
        return judged(requirement, min(simulated, at[requirement.quantity]), note)
    row = concluded(load, entry, requirement, simulated, note)
    if entry.get("strain_over_uniform", 0.0) > 1.0:
        more = f"{row.note}; {entry['strained']} is strained beyond the tensile test's uniform strain: it may tear"
        return replace(row, note=more)
    return row
