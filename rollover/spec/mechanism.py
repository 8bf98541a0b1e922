"""Whether springs hold the parts of a structure, or leave it a motion: the singular values of their stiffness."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.spec.connector import Connector
from rollover.spec.inertia import MassProperties

Array = NDArray[np.float64]
STANDARD_GRAVITY = 9.80665  # m/s2
# of a motion, what is none: where it is not quite free, stiff joints give by W/L over their own stiffness, below 1/20
SMALL = 0.05
DIGITS = 3  # of directions and places in a sentence


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A connector between two parts, by their names; `path` is where its values stand in a file."""

    path: str
    below: str
    above: str
    connector: Connector


@dataclass(frozen=True, kw_only=True)
class FreeMotion:
    """A turn about an axis, or a shift along it, that nothing holds.

    `stiffness` is that of the motion (N m/rad, N/m), `needed` what its own weight asks for, `joints` move with it.
    """

    parts: tuple[str, ...]
    turns: bool
    axis: tuple[float, float, float]
    point: tuple[float, float, float]
    stiffness: float
    needed: float
    joints: tuple[Joint, ...]


def free_motions(
    parts: Mapping[str, MassProperties], joints: Sequence[Joint], gravity: float = STANDARD_GRAVITY
) -> tuple[FreeMotion, ...]:
    """Motions of the parts that no joint holds; what a joint names and is no part stands still.

    Of each part: shift of the joints' middle, and turn times a length L. A motion is free where its stiffness, the
    square of a singular value of the joints' root stiffness, is no more than W/L. L is the parts' radius of gyration
    about the joints' middle and W their weight: their centre of mass lies no further than L from there, a weight W
    at a height h takes W h from the stiffness of a turn, so that below W/L it may fall over instead of standing.
    Without gravity only what is nothing but round-off is free.
    """
    names = list(parts)
    middle = np.mean([j.connector.position for j in joints], axis=0)
    mass = sum(p.mass for p in parts.values())
    squares = [
        p.mass * float(np.sum((np.array(p.centre_of_mass) - middle) ** 2)) + 0.5 * sum(p.inertia)
        for p in parts.values()
    ]
    length = math.sqrt(sum(squares) / mass)
    roots = np.concatenate([_root(j, names, middle, length) for j in joints])
    _, sigma, modes = np.linalg.svd(np.vstack([roots, np.zeros((6 * len(names), 6 * len(names)))]))
    weight = gravity * mass / length
    # beyond W/L, what the decomposition itself cannot tell from zero
    least = max(math.sqrt(weight), len(roots) * np.finfo(np.float64).eps * float(sigma[0]))
    free = modes[sigma <= least]
    found = []
    carried = _carried(names, joints)
    for z in _echelon(free @ np.linalg.inv(carried).T) @ carried.T:
        stiffness, needed = float(np.sum((roots @ z) ** 2)), weight * float(z @ z)
        found.append(_free_motion(z, names, joints, middle, length, (stiffness, needed)))
    return tuple(found)


def sentence(motions: Sequence[FreeMotion]) -> str:
    """Path and fault as `validate` tells them: what moves freely, about what, which values are missing.

    Motions through the same joints are told together, others once these are held. Raises ``IndexError`` for none.
    """
    first = motions[0]
    alike = [m for m in motions if (m.parts, m.turns, m.point, m.joints) == _key(first)]
    paths = [j.path for j in first.joints]
    group = paths[0].rpartition(".")[0]
    what, unit, way = ("rotational_stiffness", "N m/rad", "about") if first.turns else ("stiffness", "N/m", "along")
    axes, motion = _listed([_direction(m.axis) for m in alike]), in_words(alike)
    got = _listed([f"{v:g}" for v in sorted({v for j in first.joints for v in _own(j, alike)})])
    need = f"more than {max(m.needed for m in alike):.4g} {unit}"
    if len(paths) == 1:
        motion_line = f"{paths[0]}.{what}: {motion}, got {got} {unit} {way} {axes}; {need}"
    else:
        names = _listed([j.connector.name for j in first.joints])
        motion_line = f"{group}: {motion}, got {what} {got} {unit} {way} {axes} at {names}; {need} together"
    other = f", or a further one of {group} off this {'axis' if len(alike) == 1 else 'point'}" if first.turns else ""
    return f"{motion_line} against its weight{other}"


def in_words(alike: Sequence[FreeMotion]) -> str:
    """What moves freely, about or along which axes; of motions with the same parts and joints."""
    first, axes = alike[0], _listed([_direction(m.axis) for m in alike])
    parts = " with ".join(first.parts)
    if first.turns:
        return f"{parts} turns freely about {axes} through {_vector(first.point)} m"
    return f"{parts} shifts freely along {axes}"


def _key(m: FreeMotion) -> tuple[object, ...]:
    return m.parts, m.turns, m.point, m.joints


def _own(joint: Joint, motions: Sequence[FreeMotion]) -> list[float]:
    """The joint's stiffness along or about the axis of each motion, x, y or z by which it is nearest to."""
    c = joint.connector
    values = c.rotational_stiffness if motions[0].turns else c.stiffness
    return [float(values[int(np.argmax(np.abs(m.axis)))]) for m in motions]


def _root(joint: Joint, names: Sequence[str], middle: Array, length: float) -> Array:
    """Root of a joint's stiffness times its deflection for each coordinate, (6, 6 parts)."""
    c, B = joint.connector, np.zeros((6, 6 * len(names)))
    x, y, z = np.array(c.position) - middle
    lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # turn x lever
    for name, sign in ((joint.below, -1.0), (joint.above, 1.0)):
        if name in names:
            at = 6 * names.index(name)
            B[:3, at : at + 3], B[3:, at + 3 : at + 6] = sign * np.eye(3), sign * np.eye(3) / length
            B[:3, at + 3 : at + 6] = sign * lever / length
    return np.asarray(np.sqrt([*c.stiffness, *c.rotational_stiffness])[:, None] * B)


def _carried(names: Sequence[str], joints: Sequence[Joint]) -> Array:
    """Motions of the parts, each row, from those against the part below, of which each carries what is above it."""
    carried = np.eye(6 * len(names))
    for k, name in enumerate(names):  # from below
        below = next((j.below for j in joints if j.above == name and j.below in names[:k]), None)
        if below is not None:
            carried[6 * k : 6 * k + 6] += carried[6 * names.index(below) : 6 * names.index(below) + 6]
    return carried


def _echelon(free: Array) -> Array:
    """A basis of the same motions, turns about x, y and z of one part after another first, wherever there are such."""
    rows, count = free.copy(), len(free)
    parts = free.shape[1] // 6
    order = [6 * p + k for p in range(parts) for k in (3, 4, 5)] + [6 * p + k for p in range(parts) for k in (0, 1, 2)]
    done = 0
    for column in order:
        if done == count:
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[pivot, column]) < SMALL:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        for k in range(count):
            if k != done:
                rows[k] -= rows[k, column] * rows[done]
        done += 1
    return rows


def _free_motion(
    z: Array,
    names: Sequence[str],
    joints: Sequence[Joint],
    middle: Array,
    length: float,
    stiffness: tuple[float, float],
) -> FreeMotion:
    """The free motion of coordinates z: what moves, how, at which joints; the stiffness for a unit turn or shift."""
    moves = {name: (z[6 * k : 6 * k + 3], z[6 * k + 3 : 6 * k + 6] / length) for k, name in enumerate(names)}
    still = (np.zeros(3), np.zeros(3))

    def across(j: Joint) -> tuple[Array, Array]:
        (u, a), (v, b) = moves.get(j.below, still), moves.get(j.above, still)
        return v - u, b - a

    size = float(np.max(np.abs(z)))
    gives = [j for j in joints if max(np.abs(np.concatenate([across(j)[0], length * across(j)[1]]))) > SMALL * size]
    shift, turn = across(gives[0])
    rate = float(np.linalg.norm(turn))
    turns = rate * length > SMALL * size
    way = turn if turns else shift
    scale = float(np.linalg.norm(way))
    centre = np.mean([j.connector.position for j in gives], axis=0) - middle
    point = centre
    if turns:  # of the axis, the point nearest to the joints
        at = np.cross(turn, shift) / rate**2
        point = at + turn * (turn @ (centre - at)) / rate**2
    axis = way / scale * np.sign(way[int(np.argmax(np.abs(way)))])
    moving = [n for n, (u, a) in moves.items() if max(np.abs(np.concatenate([u, length * a]))) > SMALL * size]
    return FreeMotion(
        parts=tuple(moving),
        turns=turns,
        axis=_rounded(axis),
        point=_rounded(point + middle),
        stiffness=stiffness[0] / scale**2,
        needed=stiffness[1] / scale**2,
        joints=tuple(gives),
    )


def _rounded(v: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(c), DIGITS) + 0.0 for c in v)
    return x, y, z


def _vector(v: Sequence[float]) -> str:
    return f"[{', '.join(f'{c:g}' for c in v)}]"


def _direction(axis: Sequence[float]) -> str:
    """An axis by its letter, or as a vector."""
    letters = [name for name, c in zip("xyz", axis, strict=True) if abs(c) > math.cos(SMALL)]
    return letters[0] if letters else _vector(axis)


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
