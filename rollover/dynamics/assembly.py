"""From a scenario to the tables of the kernels: its bodies' points and rows, the ground and its memory."""

from __future__ import annotations

import math
from mmap import mmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.friction import Coulomb
from ground.kernel import COLUMNS, EFFECTS, GROWTH, STATE_COLUMNS
from ground.law import HIDDEN, REFERENCE_MASS, GroundLaw
from ground.settings import settings
from ground.surface import is_flat, normal
from ground.surface import tables as surface_tables
from rollover.dynamics.bodies import Body, bodies_of, nose_share
from rollover.dynamics.links import link_rows
from rollover.dynamics.post_rows import post_rows
from rollover.dynamics.rows import joint_rows, mount_rows, term_rows, turning_rows, upright, wheel_rows
from rollover.effects import acting
from rollover.kernels import links, posts, terms
from rollover.kernels import tables as c
from rollover.kernels.applied_forces import ACCOUNTS, HISTORY, coefficients
from rollover.kernels.tables import Tables
from rollover.kernels.wheel_spin import spin_mass
from rollover.scenario import Ground, Patch, Scenario
from rollover.spec.shapes import SurfacePoints
from rollover.spec.vehicle import Striker

__all__ = ["Body", "bodies_of", "grown", "nose_share", "tables_of"]

Array = NDArray[np.float64]
SLACK = 1e-6  # m by which a box is larger than its points: far beyond rounding, so that none of them is missed
PIECE = 0.2  # m: of a patch over uneven ground, most of which is nowhere near it


def tables_of(scenario: Scenario, bodies: tuple[Body, ...]) -> Tables:
    """All tables of a scenario, memory empty, poses not yet set."""
    vehicle, ground = scenario.vehicle, scenario.ground
    row = {body.name: b for b, body in enumerate(bodies)}
    nb = len(bodies)
    mass = np.zeros((6 * nb, 6 * nb))
    for b, body in enumerate(bodies):
        mass[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = body.inertia.mass * np.eye(3)
        mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = body.tensor
    points, owner, members_f, members_i = _point_rows(bodies, uneven=not is_flat(ground.surface))
    blocks = np.concatenate([_blocks(p[0]) for p in points] or [np.zeros((0, 6))])
    wheels = () if isinstance(vehicle, Striker) else vehicle.wheels
    wheel_f = wheel_rows(wheels, bodies, row)
    spin_i, spin_f, drive = turning_rows(scenario, wheel_f, 6 * nb)
    for w in np.flatnonzero(spin_i >= 0).tolist():
        # a turning wheel's inertia about its axle is not its carrier's
        at = 6 * row[wheels[w].hub] + 3
        axle = wheel_f[w, c.W_AXIS : c.W_AXIS + 3]
        mass[at : at + 3, at : at + 3] -= spin_f[w, c.P_INERTIA] * np.outer(axle, axle)
    wheel_i = np.array([row[w.hub] for w in wheels], dtype=np.int64)
    mount_f, mount_i = mount_rows(vehicle, bodies, row)
    joint_i, joint_f, axle_f, axle_i = joint_rows(vehicle, bodies, row)
    term_i, term_f = term_rows(scenario, bodies)
    link_i, link_f, link_out = link_rows(scenario, bodies, row)
    post_i, post_f, section_f = post_rows(None if isinstance(vehicle, Striker) else vehicle.rops)
    n = normal(ground.surface) if is_flat(ground.surface) else np.array([0.0, 0.0, 1.0])
    relief, nodes = surface_tables(ground.surface, ground.elements.spacing)
    nx, ny = ground.elements.count
    elements = ground.elements
    rows: list[tuple[GroundLaw, Ground | Patch]] = [(ground.law, ground), *((p.law, p) for p in ground.patches)]
    number = len(owner)
    capacity = 2 * number + 64
    hidden = HIDDEN + max(law.hidden for law, _ in rows)
    kernel_settings = [settings(law, *acting(scenario.effects)) for law, _ in rows]
    integers = np.array([whole for whole, _ in kernel_settings], dtype=np.int64)
    numbers = np.zeros((len(rows), max(len(p) for _, p in kernel_settings)))
    for k, (_, p) in enumerate(kernel_settings):
        numbers[k, : len(p)] = p
    # nothing of the ground moves along, or could begin to, and it does not remember shear
    still = ground.co_moving_mass.share == 0.0
    memoryless = [
        law.memoryless
        and still
        and p[whole[EFFECTS] + GROWTH] == 0.0
        and isinstance(place.friction or ground.friction, Coulomb)
        for (law, place), (whole, p) in zip(rows, kernel_settings, strict=True)
    ]
    return Tables(
        mass=mass,
        inverse=np.linalg.inv(mass),
        joint_i=joint_i,
        joint_f=joint_f,
        point_r=np.ascontiguousarray(np.concatenate([p[0] for p in points] or [np.zeros((0, 3))])),
        point_n=np.ascontiguousarray(np.concatenate([p[1] for p in points] or [np.zeros((0, 3))])),
        point_a=np.concatenate([p[2] for p in points] or [np.zeros(0)]),
        point_body=owner,
        member_f=np.array(members_f).reshape(-1, 9),
        member_i=np.array(members_i, dtype=np.int64).reshape(-1, 5),
        block_f=blocks,
        block_wake=np.zeros(len(blocks)),
        member_wake=np.zeros(len(members_f)),
        approach=_approach(nb, members_f, members_i),
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
        soil=np.array(
            [
                _soil(ground, law, place, nose_share(scenario.vehicle, scenario.effects), is_free)
                for (law, place), is_free in zip(rows, memoryless, strict=True)
            ]
        ),
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
        slot_of=np.full(nx * ny + (len(rows) * number if any(memoryless) else 0), -1, dtype=np.int32),
        memory=_untouched(capacity, COLUMNS),
        state=_untouched(capacity, STATE_COLUMNS, dtype=np.int64),
        s=_untouched(capacity, hidden),
        active=_untouched(capacity, dtype=np.int64),
        trial=_untouched(capacity, c.TRIAL_COLUMNS),
        found=_untouched(capacity, 7),
        touched=np.zeros(number + 1, dtype=np.int64),
        candidate_i=np.zeros((number + 1, 2), dtype=np.int64),
        candidate_f=np.zeros((number + 1, 2)),
        wheel_memory=upright(len(wheels)),
        spin_memory=np.zeros((len(wheels), c.SPIN_MEMORY)),
        mount_memory=np.zeros((len(mount_f), c.SET_COLUMNS)),
        axle_memory=np.zeros(c.AXLE_MEMORY),
        scheme=np.array([*coefficients(scenario.simulation.spectral_radius), float(any(memoryless))]),
        applied=np.zeros((ACCOUNTS, HISTORY, 6 * nb + int((spin_i >= 0).sum()))),
        velocity=np.zeros(6 * nb + int((spin_i >= 0).sum())),
        clock=np.zeros(3),
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
        input_i=np.zeros((0, 0), dtype=np.int64),
        input_f=np.zeros((0, 0)),
        input_memory=np.zeros((0, 0)),
        input_q=np.zeros((0, 6 * nb)),
        pieces=np.zeros((0, 0)),
        link_i=link_i,
        link_f=link_f,
        link_memory=np.zeros((len(link_i), links.LINK_MEMORY)),
        link_out=link_out,
        post_i=post_i,
        post_f=post_f,
        post_memory=np.zeros((len(post_f), posts.POST_MEMORY)),
        section_f=section_f,
        section_memory=np.zeros((len(section_f), posts.SECTION_MEMORY)),
    )


def _untouched(*shape: int, dtype: type = np.float64) -> NDArray[Any]:
    """Zeros that take memory, and time, page by page as they are written to: most elements never are.

    Those of numpy are so only until it is given memory back that was used.
    """
    return np.frombuffer(mmap(-1, math.prod(shape) * np.dtype(dtype).itemsize), dtype).reshape(shape)


def _point_rows(
    bodies: tuple[Body, ...], uneven: bool
) -> tuple[list[tuple[Array, Array, Array]], NDArray[np.int64], list[list[float]], list[tuple[int, ...]]]:
    """Points of the bodies' patches, whose they are, and the rows of their boxes; of pieces over uneven ground."""
    points: list[tuple[Array, Array, Array]] = []
    owner: list[NDArray[np.int64]] = []
    number, blocks = 0, 0
    members_f: list[list[float]] = []
    members_i: list[tuple[int, ...]] = []
    for b, body in enumerate(bodies):
        for _, whole in body.surfaces:
            pieces = whole.pieces(PIECE) if uneven else ()
            if pieces:  # without points of its own: where it is far from the ground, so are its pieces
                members_f.append(_box(whole, body.centre))
                members_i.append((b, number, number, len(members_i) + 1 + len(pieces), blocks))
            for piece in pieces or (whole,):
                members_f.append(_box(piece, body.centre))
                first, number = number, number + len(piece.area)
                members_i.append((b, first, number, len(members_i) + 1, blocks))
                blocks += -(-len(piece.area) // c.BLOCK)
                points.append((piece.position - body.centre, piece.normal, piece.area))
                owner.append(np.full(len(piece.area), b, dtype=np.int64))
    return points, np.concatenate(owner or [np.zeros(0, dtype=np.int64)]), members_f, members_i


def _blocks(place: Array) -> Array:
    """Rows of `block_f` for a patch's points (n, 3), about the body's centre of mass."""
    first = np.arange(0, len(place), c.BLOCK)
    low, high = np.minimum.reduceat(place, first), np.maximum.reduceat(place, first)
    return np.hstack([0.5 * (low + high), 0.5 * (high - low) + SLACK])


def _approach(nb: int, members_f: list[list[float]], members_i: list[tuple[int, ...]]) -> Array:
    """Rows of `approach` before any search: how far the corners of a body's boxes are from its centre of mass."""
    approach = np.zeros((nb, c.APPROACH_COLUMNS))
    for box, (body, *_) in zip(members_f, members_i, strict=True):
        far = float(np.linalg.norm(np.abs(box[:3]) + box[3:6]))
        approach[body, c.L_FAR] = max(approach[body, c.L_FAR], far)
    return approach


def _box(surface: SurfacePoints, centre: Array) -> list[float]:
    """Row of a patch in `member_f`."""
    low, high = (corner - centre for corner in surface.corners)
    middle, half = 0.5 * (low + high), 0.5 * (high - low) + SLACK
    return [*middle, *half, *(surface.normal[0] if surface.is_flat else (0.0, 0.0, 0.0))]


def _soil(ground: Ground, law: GroundLaw, place: Ground | Patch, share: float, is_free: bool) -> list[float]:
    rule = {"reference": c.RULE_REFERENCE, "effective": c.RULE_EFFECTIVE, "clamped": c.RULE_CLAMPED}
    friction = place.friction or ground.friction
    sticks, shears = (0.0, 0.0), (0.0, 0.0)
    ploughs = (0.0, 0.0) if friction.bulldozing is None else friction.bulldozing.coefficients
    if isinstance(friction, Coulomb):
        sticks = friction.stick_displacement, friction.stick_relaxation
    else:
        shears = friction.cohesion, friction.shear_modulus
    return [
        friction.coefficient,
        *sticks,
        ground.co_moving_mass.share / share,  # of the whole striker, though its nose alone hits
        rule[ground.striker_mass],
        REFERENCE_MASS,
        law.domain.momentum_most,
        float(is_free),
        *shears,
        *ploughs,
    ]


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
