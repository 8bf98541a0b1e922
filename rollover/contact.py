"""From a scenario to the tables of the kernels: bodies, points, wheels, mounts, joints, ground and its memory."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.array import Elements
from ground.kernel import COLUMNS, STATE_COLUMNS
from ground.law import HIDDEN, REFERENCE_MASS, GroundLaw
from ground.settings import settings
from ground.surface import is_flat, normal
from ground.surface import tables as surface_tables
from rollover import tables as c
from rollover import terms
from rollover.effects import acting
from rollover.effects.vehicle import TankSlosh
from rollover.inertia import MassProperties
from rollover.initiation import Driving
from rollover.scenario import Ground, Patch, Scenario
from rollover.shapes import Disc, Shape, SurfacePoints, cone, rectangle, sample
from rollover.spin import spin_mass
from rollover.tables import Tables
from rollover.vehicle import RigidBody, Striker, Vehicle, Wheel, carried

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body in the design position; `surfaces` are its named patches in vehicle axes."""

    name: str
    inertia: MassProperties
    surfaces: tuple[tuple[str, SurfacePoints], ...]

    @property
    def centre(self) -> Array:
        """Centre of mass in vehicle axes, (3,)."""
        return np.array(self.inertia.centre_of_mass)

    @property
    def tensor(self) -> Array:
        """Inertia tensor about the centre of mass, (3, 3)."""
        xx, yy, zz = self.inertia.inertia
        xy, xz, yz = self.inertia.products
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


POINTS_IN_ELEMENT = 0.8  # contact points are never further apart than this share of an element


def bodies_of(
    vehicle: Vehicle | RigidBody | Striker, elements: Elements, effects: Mapping[str, Any] | None = None
) -> tuple[Body, ...]:
    """Bodies with their contact points: striker, perhaps in two; or chassis, front axle, ROPS as far as there are any.

    Points stand for areas, elements keep the ruts: an element without a point would be a gap under the body.
    """
    spacing = min(vehicle.contact_spacing, POINTS_IN_ELEMENT * min(elements.spacing))
    if isinstance(vehicle, Striker):
        height = 0.5 * (vehicle.face_length + vehicle.face_width)
        half = np.array([0.5 * vehicle.face_length, 0, 0]), np.array([0, 0.5 * vehicle.face_width, 0])
        if vehicle.nose == "cone":
            face = cone(np.zeros(3), vehicle.nose_radius, vehicle.nose_height, spacing)
        else:
            face = rectangle(np.zeros(3), half[0], -half[1], spacing)
        m, a, b = vehicle.mass, vehicle.face_length, vehicle.face_width
        block = (m * (b * b + height**2) / 12, m * (a * a + height**2) / 12, m * (a * a + b * b) / 12)

        def part(name: str, share: float, surfaces: tuple[tuple[str, SurfacePoints], ...]) -> Body:
            j = (share * block[0], share * block[1], share * block[2])
            inertia = MassProperties(mass=share * m, centre_of_mass=(0.0, 0.0, 0.5 * height), inertia=j)
            return Body(name=name, inertia=inertia, surfaces=surfaces)

        nose = nose_share(effects)
        whole = part("striker", nose, (("face", face),))
        return (whole,) if nose == 1.0 else (whole, part("striker_body", 1.0 - nose, ()))

    def sampled(shapes: tuple[Shape, ...]) -> list[tuple[str, SurfacePoints]]:
        return [(shape.name, patch) for shape in shapes for patch in sample(shape, spacing)]

    def loads(carrier: str) -> list[tuple[str, SurfacePoints]]:
        return [patch for a in vehicle.attached if a.carried_by == carrier for patch in sampled(a.outline)]

    def walls(carrier: str) -> list[tuple[str, SurfacePoints]]:
        return [
            (disc.name, patch)
            for wheel in vehicle.wheels
            if wheel.carrier == carrier
            for disc in side_walls(wheel)
            for patch in sample(disc, spacing)
        ]

    found = [
        Body(
            name="chassis",
            inertia=carried(vehicle, "chassis"),
            surfaces=tuple(sampled(vehicle.outline) + loads("chassis") + walls("chassis")),
        )
    ]
    if vehicle.front_axle is not None:
        inertia = carried(vehicle, "front_axle")
        surfaces = tuple(walls("front_axle") + loads("front_axle"))
        found.append(Body(name="front_axle", inertia=inertia, surfaces=surfaces))
    if vehicle.rops is not None:
        for name, (inertia, members) in vehicle.rops.parts.items():
            if name == "rops":
                inertia = carried(vehicle, "rops")
            extra = loads("rops") if name == "rops" else []
            found.append(Body(name=name, inertia=inertia, surfaces=tuple(sampled(members) + extra)))
    for name in loose(effects):
        load = loose_body(effects, name, found[0].inertia)
        rest = without(found[0].inertia, load)
        found[0] = Body(name="chassis", inertia=rest, surfaces=found[0].surfaces)
        found.append(Body(name=name, inertia=load, surfaces=()))
    return tuple(found)


def loose(effects: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Effects whose mass moves in the vehicle."""
    return tuple(n for n in ("tank-slosh", "payload-shift") if effects and n in effects and effects[n].mass > 0.0)


def loose_body(effects: Mapping[str, Any] | None, name: str, chassis: MassProperties) -> MassProperties:
    """A mass that moves in the vehicle: a cube of water's density, at its place or the chassis' centre of mass."""
    assert effects is not None
    mass, place = effects[name].mass, effects[name].position
    j = mass * (mass / 1000.0) ** (2.0 / 3.0) / 6.0
    return MassProperties(mass=mass, centre_of_mass=place or chassis.centre_of_mass, inertia=(j, j, j))


def without(whole: MassProperties, part: MassProperties) -> MassProperties:
    """Mass properties of the rest. Raises ``ValueError`` if there is none that a body can have."""
    if part.mass >= whole.mass:
        raise ValueError(f"mass: more than the chassis has, got {part.mass:g} kg; less than {whole.mass:g} kg")
    mass = whole.mass - part.mass
    centre, taken = np.array(whole.centre_of_mass), np.array(part.centre_of_mass)
    middle = (whole.mass * centre - part.mass * taken) / mass

    def tensor(p: MassProperties) -> Array:
        (xx, yy, zz), (xy, xz, yz) = p.inertia, p.products
        r = np.array(p.centre_of_mass) - middle
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return np.asarray(J + p.mass * (r @ r * np.eye(3) - np.outer(r, r)))

    J = tensor(whole) - tensor(part)
    return MassProperties(
        mass=mass,
        centre_of_mass=(float(middle[0]), float(middle[1]), float(middle[2])),
        inertia=(float(J[0, 0]), float(J[1, 1]), float(J[2, 2])),
        products=(float(J[0, 1]), float(J[0, 2]), float(J[1, 2])),
    )


def side_walls(wheel: Wheel) -> tuple[Disc, Disc]:
    """Both side walls of a tyre, within the radius that does not bend away; the tread's edges are the tyre's own."""
    x, y, z = wheel.centre
    half, radius = 0.5 * wheel.tyre.width, wheel.tyre.side_wall * wheel.tyre.radius

    def side(word: str, sign: float) -> Disc:
        name = f"{wheel.name}_{word}_wall"
        return Disc(name=name, centre=(x, y + sign * half, z), normal=(0.0, sign, 0.0), radius=radius)

    return side("left", 1.0), side("right", -1.0)


def tables_of(scenario: Scenario, bodies: tuple[Body, ...]) -> Tables:
    """All tables of a scenario, memory empty, poses not yet set."""
    vehicle, ground = scenario.vehicle, scenario.ground
    row = {body.name: b for b, body in enumerate(bodies)}
    nb = len(bodies)
    mass = np.zeros((6 * nb, 6 * nb))
    for b, body in enumerate(bodies):
        mass[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = body.inertia.mass * np.eye(3)
        mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = body.tensor
    points, members_f, members_i, owner = [], [], [], []
    start = 0
    for b, body in enumerate(bodies):
        for _, surface in body.surfaces:
            r = surface.position - body.centre
            middle, half = 0.5 * (r.min(axis=0) + r.max(axis=0)), 0.5 * (r.max(axis=0) - r.min(axis=0)) + 1e-6
            members_f.append([*middle, *half, *(surface.normal[0] if surface.is_flat else (0.0, 0.0, 0.0))])
            members_i.append([b, start, start + len(r)])
            points.append((r, surface.normal, surface.area))
            owner += [b] * len(r)
            start += len(r)
    wheels = () if isinstance(vehicle, Striker) else vehicle.wheels
    wheel_f = np.zeros((len(wheels), c.WHEEL_COLUMNS))
    for w, wheel in enumerate(wheels):
        tyre = wheel.tyre
        centre = np.array(wheel.centre) - bodies[row[wheel.carrier]].centre
        wheel_f[w] = [
            *centre,
            *(0.0, 1.0, 0.0),
            tyre.radius,
            0.5 * tyre.width,
            tyre.crown,
            tyre.vertical_stiffness,
            tyre.lateral_stiffness,
            tyre.vertical_damping,
            tyre.friction,
            float(wheel.rolls),
            math.inf if tyre.bottoming is None else tyre.bottoming * tyre.radius,
            tyre.bottoming_stiffness,
        ]
    spin_i, spin_f, drive = _turning(scenario, wheel_f, 6 * nb)
    for w in np.flatnonzero(spin_i >= 0).tolist():
        # a turning wheel's inertia about its axle is not its carrier's
        at = 6 * row[wheels[w].carrier] + 3
        axle = wheel_f[w, c.W_AXIS : c.W_AXIS + 3]
        mass[at : at + 3, at : at + 3] -= spin_f[w, c.P_INERTIA] * np.outer(axle, axle)
    wheel_i = np.array([row[w.carrier] for w in wheels], dtype=np.int64)
    mount_f, mount_i = _mounts(vehicle, bodies, row)
    joint_i, joint_f, axle_f, axle_i = _joints(vehicle, bodies, row)
    term_i, term_f = _terms(scenario, bodies)
    n = normal(ground.surface) if is_flat(ground.surface) else np.array([0.0, 0.0, 1.0])
    relief, nodes = surface_tables(ground.surface)
    nx, ny = ground.elements.count
    elements = ground.elements
    rows: list[tuple[GroundLaw, Ground | Patch]] = [(ground.law, ground), *((p.law, p) for p in ground.patches)]
    number = start
    capacity = 2 * number + 64
    hidden = HIDDEN + max(law.hidden for law, _ in rows)
    told = [settings(law, *acting(scenario.effects)) for law, _ in rows]
    integers = np.array([whole for whole, _ in told], dtype=np.int64)
    numbers = np.zeros((len(rows), max(len(p) for _, p in told)))
    for k, (_, p) in enumerate(told):
        numbers[k, : len(p)] = p
    return Tables(
        mass=mass,
        inverse=np.linalg.inv(mass),
        joint_i=joint_i,
        joint_f=joint_f,
        point_r=np.ascontiguousarray(np.concatenate([p[0] for p in points] or [np.zeros((0, 3))])),
        point_n=np.ascontiguousarray(np.concatenate([p[1] for p in points] or [np.zeros((0, 3))])),
        point_a=np.concatenate([p[2] for p in points] or [np.zeros(0)]),
        point_body=np.array(owner, dtype=np.int64),
        member_f=np.array(members_f).reshape(-1, 9),
        member_i=np.array(members_i, dtype=np.int64).reshape(-1, 3),
        wheel_f=wheel_f,
        wheel_i=wheel_i,
        spin_i=spin_i,
        spin_f=spin_f,
        spin_mass=spin_mass(6 * nb + int((spin_i >= 0).sum()), spin_i, spin_f, wheel_f, wheel_i),
        drive=drive,
        mount_f=mount_f,
        mount_i=mount_i,
        axle_f=axle_f,
        axle_i=axle_i,
        term_i=term_i,
        term_f=term_f,
        law=integers,
        p=numbers,
        soil=np.array([_soil(ground, law, place, nose_share(scenario.effects)) for law, place in rows]),
        domain=np.array([law.domain.vector for law, _ in rows]),
        patch_f=np.array([[p.low[0], p.high[0], p.low[1], p.high[1]] for p in ground.patches]).reshape(-1, 4),
        plane=np.array([*n, 0.0]),
        relief=relief,
        nodes=nodes,
        grid_f=np.array(
            [
                elements.centre[0] - 0.5 * nx * elements.spacing[0],
                elements.centre[1] - 0.5 * ny * elements.spacing[1],
                *elements.spacing,
            ]
        ),
        grid_i=np.array([nx, ny], dtype=np.int64),
        slot_of=np.full(nx * ny, -1, dtype=np.int32),
        memory=np.zeros((capacity, COLUMNS)),
        state=np.zeros((capacity, STATE_COLUMNS), dtype=np.int64),
        s=np.zeros((capacity, hidden)),
        active=np.zeros(capacity, dtype=np.int64),
        trial=np.zeros((capacity, c.TRIAL_COLUMNS)),
        found=np.zeros((capacity, 7)),
        touched=np.zeros(number + 1, dtype=np.int64),
        candidate_i=np.zeros((number + 1, 2), dtype=np.int64),
        candidate_f=np.zeros((number + 1, 2)),
        wheel_memory=_upright(len(wheels)),
        spin_memory=np.zeros((len(wheels), c.SPIN_MEMORY)),
        mount_memory=np.zeros((len(mount_f), c.SET_COLUMNS)),
        axle_memory=np.zeros(c.AXLE_MEMORY),
        clock=np.zeros(2),
        term_memory=np.zeros((len(term_i), terms.TERM_MEMORY)),
        pose=np.zeros((nb, c.POSE_COLUMNS)),
        counts=np.zeros(c.COUNTS, dtype=np.int64),
        work=np.zeros(c.WORKS),
        resultant=np.zeros((nb, c.RESULTANT_COLUMNS)),
        event=np.zeros((number + 256, c.EVENT_COLUMNS)),
        device_i=np.zeros((0, 0), dtype=np.int64),
        device_f=np.zeros((0, 0)),
        device_memory=np.zeros((0, 0)),
        device_q=np.zeros((0, 6 * nb)),
        device_x=np.zeros((nb, 6)),
        device_out=np.zeros(c.OUT_COLUMNS),
    )


def grown(t: Tables) -> Tables:
    """The same tables with room for as many new elements as there are points, or `t` itself if there is room."""
    capacity, need = len(t.memory), int(t.counts[c.SLOTS]) + len(t.point_a) + 1
    if need <= capacity:
        return t
    more = 2 * need

    def longer(a: NDArray[np.generic]) -> NDArray[np.generic]:
        return np.concatenate([a, np.zeros((more - capacity, *a.shape[1:]), dtype=a.dtype)])

    return t._replace(
        **{name: longer(getattr(t, name)) for name in ("memory", "state", "s", "active", "trial", "found")}
    )


def nose_share(effects: Mapping[str, Any] | None) -> float:
    """Share of a striker's mass in its nose: all of it, unless it gives way."""
    gives = (effects or {}).get("structural-compliance")
    return 1.0 if gives is None or gives.stiffness is None else float(gives.nose_share)


def _terms(scenario: Scenario, bodies: tuple[Body, ...]) -> tuple[NDArray[np.int64], Array]:
    """Rows for `rollover.terms`; forces on a striker in two parts go by their masses, so that it falls as one."""
    effects = scenario.effects
    rows: list[tuple[tuple[int, int, int], list[float]]] = []
    falling = range(len(bodies)) if isinstance(scenario.vehicle, Striker) else range(1)
    mass = sum(bodies[b].inertia.mass for b in falling)
    for b in falling:
        share = bodies[b].inertia.mass / mass
        if "guide-friction" in effects and isinstance(scenario.vehicle, Striker):
            rows.append(((terms.GUIDE_BRAKE, b, b), [share * effects["guide-friction"].force]))
        if "air-drag" in effects:
            rows.append(((terms.AIR_DRAG, b, b), [share * effects["air-drag"].factor]))
    if "gyroscopic-rotor" in effects and not isinstance(scenario.vehicle, Striker):
        rows.append(((terms.ROTOR, 0, 0), list(effects["gyroscopic-rotor"].vector)))
    if "drive-torque" in effects and not isinstance(scenario.vehicle, Striker):
        rows.append(((terms.REACTION, 0, 0), [effects["drive-torque"].torque]))
    if not isinstance(scenario.vehicle, Striker):
        for b, body in enumerate(bodies):
            if body.name in loose(effects):
                rows.append(((terms.BED, 0, b), _bed(effects[body.name], body, bodies[0], scenario.gravity)))
    if isinstance(scenario.vehicle, Striker) and len(bodies) > 1:
        gives = effects["structural-compliance"]
        rows.append(((terms.BETWEEN, 0, 1), [gives.stiffness, gives.damping, 0.0]))
    f = np.zeros((len(rows), terms.TERM_NUMBERS))
    for i, (_, numbers) in enumerate(rows):
        f[i, : len(numbers)] = numbers
    return np.array([row for row, _ in rows], dtype=np.int64).reshape(-1, 3), f


BED_FREQUENCY = 200.0  # rad/s, of a load on its bed: it sags by a quarter of a millimetre


def _bed(effect: Any, body: Body, chassis: Body, gravity: float) -> list[float]:
    """Numbers of `terms.BED` for a mass that moves across the chassis."""
    m, j, w = body.inertia.mass, body.inertia.inertia[0], BED_FREQUENCY
    held = [*(body.centre - chassis.centre), m * w * w, 1.4 * m * w, j * w * w, 1.4 * j * w]
    if isinstance(effect, TankSlosh):
        slow = math.sqrt(gravity / effect.length)
        return [*held, m * slow * slow, 2.0 * effect.damping * m * slow, 0.0, math.inf]
    return [*held, 0.0, 0.0, effect.friction, effect.travel]


def _upright(wheels: int) -> Array:
    """Empty memory of tyres over level ground."""
    memory = np.zeros((wheels, c.EDGE_COLUMNS))
    memory[:, c.E_NORMAL + 2] = memory[:, c.E_NORMAL_NOW + 2] = 1.0
    return memory


LOCK_STIFFNESS, LOCK_DAMPING = 1e5, 200.0  # N m/rad and N m s/rad of the shafts between the wheels of a locked axle


def _turning(scenario: Scenario, wheel_f: Array, first: int) -> tuple[NDArray[np.int64], Array, Array]:
    """Coordinates and numbers of wheels that turn, and of their drive; steers the front wheels. None unless driving."""
    start, vehicle = scenario.initiation, scenario.vehicle
    spin_i, spin_f = np.full(len(wheel_f), -1, dtype=np.int64), np.zeros((len(wheel_f), c.SPIN_COLUMNS))
    drive = np.array([0.0, 1e9, 0.0, 0.0])
    if not isinstance(start, Driving) or not isinstance(vehicle, Vehicle):
        return spin_i, spin_f, drive
    steer = math.radians(start.steer_deg)
    for w, wheel in enumerate(vehicle.wheels):
        assert wheel.inertia is not None  # the scenario has seen to it
        spin_i[w] = first + w
        spin_f[w] = [
            wheel.inertia,
            start.brake.torque if start.brake and vehicle.on_axle(wheel, start.brake.axle) else 0.0,
            float(start.drive is not None and vehicle.on_axle(wheel, start.drive.axle)),
            float(start.brake is not None and start.brake.against == "ground"),
        ]
        wheel_f[w, c.W_ROLLS] = 0.0
        if vehicle.on_axle(wheel, "front"):
            wheel_f[w, c.W_AXIS : c.W_AXIS + 3] = [-math.sin(steer), math.cos(steer), 0.0]
    if start.drive is not None:
        drive[c.D_RATE] = start.drive.limit_rate or 1e9
        if start.drive.differential == "locked":
            drive[c.D_STIFFNESS], drive[c.D_DAMPING] = LOCK_STIFFNESS, LOCK_DAMPING
    return spin_i, spin_f, drive


def _soil(ground: Ground, law: GroundLaw, place: Ground | Patch, share: float) -> list[float]:
    rule = {"reference": c.RULE_REFERENCE, "effective": c.RULE_EFFECTIVE, "clamped": c.RULE_CLAMPED}
    friction = place.friction or ground.friction
    return [
        friction.coefficient,
        friction.stick_displacement,
        friction.stick_relaxation,
        ground.co_moving_mass.share / share,  # of the whole striker, though its nose alone hits
        rule[ground.striker_mass],
        REFERENCE_MASS,
        law.domain.momentum_most,
    ]


def _mounts(
    vehicle: Vehicle | RigidBody | Striker, bodies: tuple[Body, ...], row: dict[str, int]
) -> tuple[Array, NDArray[np.int64]]:
    if isinstance(vehicle, Striker) or vehicle.rops is None:
        return np.zeros((0, c.MOUNT_COLUMNS)), np.zeros((0, 2), dtype=np.int64)
    rows, pairs = [], []
    for joints, below, above in (
        (vehicle.rops.mounts, "chassis", "rops"),
        (vehicle.rops.hinges, "rops", "rops_upper"),
    ):
        for joint in joints:
            a, b, place = row[below], row[above], np.array(joint.position)
            far = float(joint.turns_far)
            rows.append([*(place - bodies[b].centre), *(place - bodies[a].centre), *joint.row, far])
            pairs.append([a, b])
    return np.array(rows), np.array(pairs, dtype=np.int64)


def _joints(
    vehicle: Vehicle | RigidBody | Striker, bodies: tuple[Body, ...], row: dict[str, int]
) -> tuple[NDArray[np.int64], Array, Array, NDArray[np.int64]]:
    axle_f, axle_i = np.zeros(0), np.zeros(2, dtype=np.int64)
    if isinstance(vehicle, Striker):
        guides = [[c.GUIDE, b, -1] for b in range(len(bodies))]
        return np.array(guides, dtype=np.int64), np.zeros((len(bodies), 6)), axle_f, axle_i
    if vehicle.front_axle is None:
        return np.zeros((0, 3), dtype=np.int64), np.zeros((0, 6)), axle_f, axle_i
    a, b = row["chassis"], row["front_axle"]
    axle, pivot = vehicle.front_axle, np.array(vehicle.front_axle.pivot)
    points = np.array([[*(pivot - bodies[a].centre), *(pivot - bodies[b].centre)]])
    impact = float(axle.stop == "impact")
    axle_f = np.array([axle.swing, axle.stop_stiffness, axle.stop_damping, impact, axle.stop_restitution])
    return np.array([[c.PIVOT, a, b]], dtype=np.int64), points, axle_f, np.array([a, b], dtype=np.int64)
