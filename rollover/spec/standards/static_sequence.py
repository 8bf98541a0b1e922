"""The loads of a static test for one vehicle: which code applies, what it asks of the mass, where the frame is pushed.

Rules of the codes that the simulation needs: what is asked, the end that is loaded first, the place of the beam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rollover.spec.shapes import Box, Point, Shape, Tube
from rollover.spec.stand import Code, From, StaticLoad, StaticTest, Step
from rollover.spec.standards.codes import STANDARDS, Tractor
from rollover.spec.standards.requirement import Requirement
from rollover.spec.vehicle import Vehicle, alone

NARROW = 1.150  # m, track below which Codes 6 and 7 apply instead of Code 4; scope of the codes, recalled
NARROW_MASSES = (400.0, 3500.0)  # kg, of Codes 6 and 7; scope of the codes, recalled
LEAST_MASS = 600.0  # kg, of Code 4; scope of the code, recalled
BEAM = 0.150  # m, height of the loading beam
SIDE_AHEAD: dict[Code, float] = {"code-4": 0.300, "code-6": 0.300, "code-7": 0.200}  # m, ahead of the seat reference
CHOICES = (
    f"'code-4' (track of {NARROW:g} m or more, {LEAST_MASS:g} kg or more), 'code-6' (narrower, two posts ahead of the "
    f"seat) or 'code-7' (narrower, frame at or behind the seat, both {NARROW_MASSES[0]:g} to {NARROW_MASSES[1]:g} kg)"
)
OTHER: dict[str, From] = {"front": "rear", "rear": "front"}


@dataclass(frozen=True, kw_only=True)
class Push:
    """One load as it is applied: `energy` (J) or `force` (N) to be reached, at `point` (m) of the body `body`.

    `asked` is what the code asks for, None for a number of the user's own; a load without energy and force is a step
    that the code does not have. `until_failure`: it goes on until the frame fails.
    """

    name: str
    come_from: From
    point: Point
    body: str
    energy: float | None = None
    force: float | None = None
    asked: Requirement | None = None
    until_failure: bool = False


def tractor_of(vehicle: Vehicle, *, folding: bool | None = None) -> Tractor:
    """What the standards ask of a vehicle: its mass without what is attached and drawn, wheelbase, rear share, widths.

    A ROPS with hinges tilts or folds, unless `folding` says otherwise.
    """
    vehicle = alone(vehicle)
    x = [wheel.centre[0] for wheel in vehicle.wheels]
    wheelbase = max(x) - min(x) if x else 0.0
    sides = [abs(w.centre[1]) + 0.5 * w.tyre.width for w in vehicle.wheels]
    rops = vehicle.rops
    share = 1.0 - (vehicle.whole.centre_of_mass[0] - min(x)) / wheelbase if wheelbase > 0.0 else 0.6
    return Tractor(
        mass=vehicle.whole.mass,
        wheelbase=wheelbase or None,
        rear_share=min(max(share, 0.0), 1.0),
        width=2.0 * max(sides) if sides else None,
        rops_width=2.0 * abs(rops.corner[1]) if rops is not None else None,
        folding=bool(rops is not None and rops.hinges) if folding is None else folding,
    )


def track_of(vehicle: Vehicle) -> float | None:
    """Distance between the middles of the larger tyres, m; None without wheels on both sides."""
    if not vehicle.wheels:
        return None
    largest = max(w.tyre.radius for w in vehicle.wheels)
    y = [w.centre[1] for w in vehicle.wheels if math.isclose(w.tyre.radius, largest, rel_tol=1e-3)]
    return max(y) - min(y) if max(y) > min(y) else None


def code_of(vehicle: Vehicle) -> Code:
    """The code that applies to a vehicle, by frame, track and mass. Raises ``ValueError`` where none does."""
    track, mass = track_of(vehicle), vehicle.whole.mass
    frame = vehicle.rops.frame if vehicle.rops is not None else "none"
    if track is not None and vehicle.rops is not None:
        if track >= NARROW and mass >= LEAST_MASS:
            return "code-4"
        if track < NARROW and NARROW_MASSES[0] <= mass <= NARROW_MASSES[1]:
            return "code-6" if frame == "two-post-front" else "code-7"
    got = "no track" if track is None else f"a track of {track:.3g} m"
    raise ValueError(f"code: does not follow from the vehicle, got {got}, {mass:g} kg, frame {frame!r}; {CHOICES}")


def usual_code(vehicle: Vehicle) -> Code:
    """The code that applies to a vehicle, Code 4 where none does."""
    try:
        return code_of(vehicle)
    except ValueError:
        return "code-4"


def sequence(vehicle: Vehicle, test: StaticTest) -> tuple[Push, ...]:
    """The loads in their order, those after the one that is pushed on left out. Raises ``ValueError``, path first."""
    assert vehicle.rops is not None
    given = test.loads
    by_code = given is None or any(load.asks is not None for load in given)
    code = test.code or (code_of(vehicle) if by_code else "code-4")
    # a frame is given the second lengthways load where the scenario lists it; by itself only where it folds
    tractor = tractor_of(vehicle, folding=True if given is not None else None)
    asked = STANDARDS[code](tractor)
    first: From = "rear" if tractor.rear_share >= 0.5 else "front"
    found: list[Push] = []
    crushed = 0
    for load in _own(asked, first) if given is None else given:
        end = OTHER[first] if load.asks == "second-longitudinal" or (load.asks == "crush" and crushed) else first
        step = None if load.asks is None else _step(asked, load.asks, crushed)
        crushed += load.asks == "crush"
        come_from = load.come_from or _side_of(load.asks, end)
        if step is not None and come_from not in step.come_from:
            raise ValueError(
                f"loads.{load.name}.come_from: {step.standard} asks for the {step.name} of this vehicle "
                f"({100.0 * tractor.rear_share:.0f} % of its mass on the rear axle), got {come_from!r}; "
                f"{' or '.join(map(repr, step.come_from))}, or loads: null for the sequence of the code"
            )
        point = load.point or _point(vehicle, load.asks, come_from, end, SIDE_AHEAD[code])
        energy, force = load.energy, load.force
        if step is not None and energy is force is None:
            value = step.value * (1.0 + test.surplus)
            energy, force = (value, None) if step.quantity == "energy" else (None, value)
        found.append(
            Push(
                name=load.name,
                come_from=come_from,
                point=point,
                body=_body(vehicle, point),
                energy=energy,
                force=force,
                asked=step,
                until_failure=load.name == test.push_on,
            )
        )
    names = [push.name for push in found]
    if test.push_on is None:
        return tuple(found)
    if test.push_on not in names:
        raise ValueError(f"push_on: no such load, got {test.push_on!r}; one of {', '.join(map(repr, names))}")
    return tuple(found[: names.index(test.push_on) + 1])


def _own(asked: tuple[Requirement, ...], first: From) -> list[StaticLoad]:
    """The sequence of a code as loads, named after the end or side that they come from."""
    found = []
    crush = [first, OTHER[first]]
    for step in asked:
        if step.quantity == "force":
            found.append(StaticLoad(name=f"crush-{crush.pop(0)}", asks="crush"))
        elif step.name.startswith("side"):
            found.append(StaticLoad(name="side", asks="side"))
        elif step.quantity == "energy":
            second = step.name.startswith("second")
            end = OTHER[first] if second else first
            found.append(StaticLoad(name=end, asks="second-longitudinal" if second else "longitudinal"))
    return found


def _step(asked: tuple[Requirement, ...], step: Step, crushed: int) -> Requirement | None:
    """The requirement of a step, the crush after `crushed` others; None where the code has no such step."""
    if step == "crush":
        forces = [r for r in asked if r.quantity == "force"]
        return forces[crushed] if crushed < len(forces) else None
    begins = {"longitudinal": "longitudinal load", "side": "side load", "second-longitudinal": "second longitudinal"}
    return next((r for r in asked if r.quantity == "energy" and r.name.startswith(begins[step])), None)


def _side_of(step: Step | None, end: From) -> From:
    return "above" if step == "crush" else "left" if step == "side" else end


def _point(vehicle: Vehicle, step: Step | None, come_from: From, end: From, ahead: float) -> Point:
    """Where the beam meets the top of the frame.

    Lengthways a sixth of the top's width in from a corner, the second time from the other one; from the side `ahead` of
    the seat reference point or, if the top does not reach there, at its nearest part; crushed across the given end.
    """
    assert vehicle.rops is not None
    low, high = _top(tuple(m for _, members in vehicle.rops.parts.values() for m in members))
    inset = 0.5 * min(BEAM, high[0] - low[0])
    at_rear, at_front, half = low[0] + inset, high[0] - inset, min(high[1], -low[1])
    if come_from == "above":
        return (at_rear if end == "rear" else at_front, 0.0, high[2])
    z = 0.5 * (low[2] + high[2])
    if come_from in ("left", "right"):
        zone = vehicle.rops.clearance_zone
        wanted = 0.5 * (at_rear + at_front) if zone is None else zone.seat_reference_point[0] + ahead
        return (min(max(wanted, at_rear), at_front), half if come_from == "left" else -half, z)
    y = half - 2.0 * half / 6.0
    return (low[0] if come_from == "rear" else high[0], -y if step == "second-longitudinal" else y, z)


def _top(members: tuple[Shape, ...]) -> tuple[Point, Point]:
    """Corners of the box about the members that lie within a beam's height of the top, all of them if none does."""
    boxes = [box for member in members if (box := _bounds(member)) is not None]
    highest = max(high[2] for _, high in boxes)
    near = [box for box in boxes if box[0][2] >= highest - BEAM - 1e-9] or boxes
    low, high = zip(*near, strict=True)
    least, most = [min(c) for c in zip(*low, strict=True)], [max(c) for c in zip(*high, strict=True)]
    return (least[0], least[1], max(least[2], highest - BEAM)), (most[0], most[1], most[2])


def _bounds(member: Shape) -> tuple[Point, Point] | None:
    if isinstance(member, Box):
        return member.low, member.high
    if not isinstance(member, Tube):
        return None
    way = [b - a for a, b in zip(member.start, member.end, strict=True)]
    length = math.hypot(*way)
    across = [0.5 * member.diameter * math.sqrt(max(1.0 - (c / length) ** 2, 0.0)) for c in way]
    ends = list(zip(member.start, member.end, across, strict=True))
    low, high = [min(a, b) - r for a, b, r in ends], [max(a, b) + r for a, b, r in ends]
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _body(vehicle: Vehicle, point: Point) -> str:
    """The part of the frame that a point lies on, or nearest to."""
    assert vehicle.rops is not None
    way = {
        name: min((_distance(member, point) for member in members), default=math.inf)
        for name, (_, members) in vehicle.rops.parts.items()
    }
    return min(way, key=way.__getitem__)


def _distance(member: Shape, point: Point) -> float:
    """From the box about a member, m."""
    box = _bounds(member)
    if box is None:
        return math.inf
    return math.hypot(*(max(a - x, x - b, 0.0) for a, b, x in zip(*box, point, strict=True)))
