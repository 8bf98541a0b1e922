"""Prescribed inputs as the kernels read them, and what they add to the channels of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.dynamics.bodies import Body
from rollover.kernels import inputs as k
from rollover.kernels.stand_devices import D_INPUT, D_KIND, TILT
from rollover.kernels.tables import P_INERTIA, P_STEERED, W_AXIS, Tables
from rollover.scenario import Scenario
from rollover.spec.inputs import BrakeTorque, DriveTorque, Force, Input, Shake, Signal, Steering, TableAngle

Array = NDArray[np.float64]


def lines(time: Array, value: Array) -> Array:
    """Pieces of straight lines through samples, (n, PIECE_COLUMNS); the last value holds."""
    found = np.zeros((len(time), k.PIECE_COLUMNS))
    found[:, 0], found[:, 1] = time, value
    found[:-1, 2] = np.diff(value) / np.diff(time)
    return found


def spline(time: Array, value: Array) -> Array:
    """Pieces of the cubic spline through samples that begins and ends at rest, (n, PIECE_COLUMNS).

    Its acceleration is continuous in between. A monotone (PCHIP) cubic's is not: it leaps at each sample, and to the
    acceleration of a sine of 20 samples a turn it is off by 1.2 times its size, the spline by 1 percent.
    """
    from scipy.interpolate import CubicSpline  # slow to import, and few scenarios shake the ground

    found = lines(time, value)
    if len(time) > 1:
        found[:-1, 1:] = CubicSpline(time, value, bc_type="clamped").c[::-1].T
    return found


def pieces_of(one: Input) -> Array:
    """Pieces of an input's signal, SI."""
    match one:
        case Force():
            return lines(one.force.instants, one.force.values)
        case Shake(displacement=Signal() as way):
            return spline(way.instants, way.values)
        case Shake(acceleration=Signal() as rate):
            return lines(rate.instants, rate.values)
        case TableAngle():
            return spline(one.angle_deg.instants, np.radians(one.angle_deg.values))
        case Steering():
            return lines(one.angle_deg.instants, np.radians(one.angle_deg.values))
        case DriveTorque() | BrakeTorque():
            return lines(one.torque.instants, one.torque.values)
    raise TypeError(f"{one!r}: no input")


def value_at(pieces: Array, time: float) -> float:
    """Value of a signal at an instant, s."""
    row = pieces[max(int(np.searchsorted(pieces[:, 0], time, side="right")) - 1, 0)]
    x = max(time - row[0], 0.0)
    return float(row[1] + x * (row[2] + x * (row[3] + x * row[4])))


def first_angle(inputs: Sequence[Input], kind: type[Steering | TableAngle]) -> float | None:
    """Angle that an input of a kind gives at the start, rad; None where there is none."""
    found = next((i for i in inputs if isinstance(i, kind)), None)
    return None if found is None else value_at(pieces_of(found), 0.0)


def with_inputs(scenario: Scenario, bodies: Sequence[Body], t: Tables) -> Tables:
    """The same tables with the scenario's inputs: until then nothing but its weight acts on what is put down."""
    if not scenario.inputs:
        return t
    rows = np.array([_whole(one, bodies) for one in scenario.inputs], dtype=np.int64)
    numbers = np.array([_numbers(one, bodies) for one in scenario.inputs])
    pieces = [pieces_of(one) for one in scenario.inputs]
    ends = np.cumsum([len(p) for p in pieces])
    rows[:, k.I_FIRST], rows[:, k.I_END] = ends - [len(p) for p in pieces], ends
    memory = np.zeros((len(rows), k.INPUT_MEMORY))
    memory[:, k.V_NOW] = memory[:, k.V_TURNED] = [value_at(p, 0.0) for p in pieces]
    table = np.flatnonzero(rows[:, k.I_KIND] == k.TABLE)
    if table.size:
        t.device_i[t.device_i[:, D_KIND] == TILT, D_INPUT] = 1 + table[0]
    return t._replace(
        input_i=rows,
        input_f=numbers,
        input_memory=memory,
        input_q=np.zeros((2, len(t.mass))),
        pieces=np.concatenate(pieces),
    )


def _whole(one: Input, bodies: Sequence[Body]) -> list[int]:
    match one:
        case Force():
            kind = k.FORCE_WORLD if one.axes == "world" else k.FORCE_BODY
            return [kind, _body(one, bodies), 0, 0]
        case Shake():
            return [k.SHAKEN_BY_PLACE if one.displacement is not None else k.SHAKEN_BY_ACCELERATION, -1, 0, 0]
    kinds = {TableAngle: k.TABLE, Steering: k.STEERING, DriveTorque: k.DRIVE_TORQUE, BrakeTorque: k.BRAKE_TORQUE}
    return [kinds[type(one)], -1, 0, 0]


def _body(force: Force, bodies: Sequence[Body]) -> int:
    names = [body.name for body in bodies]
    return names.index(force.body) if force.body in names else len(names) - 1  # of a striker in parts, the upper


def _numbers(one: Input, bodies: Sequence[Body]) -> list[float]:
    point, way = np.zeros(3), np.zeros(3)
    if isinstance(one, (Force, Shake)):
        way = np.array(one.direction) / math.hypot(*one.direction)
    if isinstance(one, Force) and one.point is not None:
        point = np.array(one.point) - bodies[_body(one, bodies)].centre
    if isinstance(one, TableAngle):
        point[1:] = one.axis
    return [*point.tolist(), *way.tolist()]


def quantity(one: Input) -> str:
    """What an input prescribes, the last part of its channel's name."""
    match one:
        case Force():
            return "force"
        case Shake():
            return "displacement" if one.displacement is not None else "acceleration"
        case TableAngle() | Steering():
            return "angle"
    return "torque"


def over(inputs: Sequence[Input]) -> float:
    """When the last of them stops changing, s: before that nothing is at rest for good."""
    return max((float(pieces_of(one)[-1, 0]) for one in inputs), default=-math.inf)


def ground_acceleration(inputs: Sequence[Input], time: Array) -> Array:
    """Acceleration of the shaken ground, world axes, (n, 3), m/s2."""
    found = np.zeros((len(time), 3))
    for one in inputs:
        if isinstance(one, Shake):
            pieces = pieces_of(one)
            row = pieces[np.maximum(np.searchsorted(pieces[:, 0], time, side="right") - 1, 0)]
            x = np.maximum(time - row[:, 0], 0.0)
            a = 2.0 * row[:, 3] + 6.0 * x * row[:, 4] if one.displacement is not None else row[:, 1] + x * row[:, 2]
            if one.displacement is not None:
                a[time < pieces[0, 0]] = 0.0
            found += np.outer(a, np.array(one.direction) / math.hypot(*one.direction))
    return found


def steered_kinetic(t: Tables, prescribed: Array, qd: Array, spin: Array) -> Array:
    """What the kinetic energy of steered wheels differs by from that with their axles as they ended, (n,), J.

    I s omega . (e - e_end), see `rollover.kernels.steering`; `prescribed` (n, ni), `qd` (n, nb, 6), `spin` (n, ns).
    """
    found = np.zeros(len(qd))
    for i in np.flatnonzero(t.input_i[:, k.I_KIND] == k.STEERING) if len(t.input_i) else ():
        angle = prescribed[:, i]
        e = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(len(angle))])
        for w in np.flatnonzero(t.spin_f[:, P_STEERED] > 0.0):
            turned = np.einsum("nk,nk->n", qd[:, t.wheel_i[w], 3:], e - t.wheel_f[w, W_AXIS : W_AXIS + 3])
            found += t.spin_f[w, P_INERTIA] * spin[:, t.spin_i[w] - len(t.mass)] * turned
    return found
