"""Compiled: forces on the bodies beyond ground, tyres and mounts, and the work that they take.

A row of `term_i` says kind and bodies, the same row of `term_f` its numbers. What a term holds as energy and the power
that it takes are kept for the start of the step and for now; the ledger books the difference and the mean.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf
from rollover.kernels.tables import EXTRA_WORK, OMEGA, ROT, VEL, X
from rollover.kernels.vectors import add_between, direction_row, relative_angle, spin, to_body, velocity

GUIDE_BRAKE, AIR_DRAG, BETWEEN, ROTOR, REACTION, BED = 0, 1, 2, 3, 4, 5  # kinds
HELD, POWER, HELD_NOW, POWER_NOW, TERM_MEMORY = 0, 1, 2, 3, 4  # columns of term_memory
# numbers of a bed: place on the chassis (3), stiffness and damping across it, both about it, spring, dashpot and
# coefficient of friction along y, travel to either side
B_PLACE, B_K, B_C, B_KR, B_CR, B_SPRING, B_DASHPOT, B_MU, B_TRAVEL = 0, 3, 4, 5, 6, 7, 8, 9, 10
TERM_NUMBERS = 11
WEIGHT = 10.0  # N/kg, what presses a load on its bed as far as Newton's matrix is concerned
WALL = 0.005  # m, in a wall, over which its dashpot grows to its whole
CRISIS_WIDTH = 0.1  # of the critical speed, over which the drag falls
CREEP = 0.005  # m/s: below it the friction of a bed is a dashpot, so that it has a value at rest
INCHING = 1e-4  # m/s: the same of a guide in a drop by itself, which then holds, see `fall.is_stuck`
STANDING = 2e-6  # m/s: the same of a guide in a full run: what stands on stiff ground gives way over seconds


@inlined
def drag(factor: float, crisis: float, ratio: float, speed: float) -> float:
    """1/2 rho C_d A at a speed: C_d falls to `ratio` of itself about the speed `crisis`, N s2/m2."""
    if crisis == np.inf:
        return factor
    over = (speed / crisis - 1.0) / CRISIS_WIDTH
    return factor * (ratio + (1.0 - ratio) / (1.0 + np.exp(min(over, 100.0))))  # type: ignore[no-any-return]


@inlined
def rub(force: float, creep: float, zone: float, v: float) -> float:
    """Friction of a guide against a speed v, N: F_c tanh(v/v_c) of one that creeps, else F_c beyond a narrow zone."""
    if creep > 0.0:
        return force * math.tanh(v / creep)
    return force * min(max(v / zone, -1.0), 1.0)


@inlined
def free(g: float, mass: float, guide: float, creep: float, air: float, crisis: float, thin: float, v: float) -> float:
    """Downward acceleration of a body that falls with v on a guide through air, m/s2."""
    if guide == 0.0 and air == 0.0:
        return g
    return g - (rub(guide, creep, INCHING, v) + drag(air, crisis, thin, abs(v)) * v * abs(v)) / mass


@leaf
def fall_back(
    g: float, mass: float, guide: float, creep: float, air: float, crisis: float, thin: float, v: float, time: float
) -> Any:
    """Depth (m) and speed (m/s) `time` seconds before a body that falls freely has depth 0 and speed v."""
    if guide == 0.0 and air == 0.0:
        return -(v * time - 0.5 * g * time * time), v - g * time
    x, count = 0.0, max(math.ceil(time / 1e-3), 1)
    h = -time / count
    for _ in range(count):
        k1 = free(g, mass, guide, creep, air, crisis, thin, v)
        k2 = free(g, mass, guide, creep, air, crisis, thin, v + 0.5 * h * k1)
        k3 = free(g, mass, guide, creep, air, crisis, thin, v + 0.5 * h * k2)
        k4 = free(g, mass, guide, creep, air, crisis, thin, v + h * k3)
        x += h * (v + h * (k1 + k2 + k3) / 6.0)
        v += h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    return x, v


@compiled
def try_terms(t: Any, Q: Any) -> None:
    """Forces of all terms at the poses that were read last."""
    for i in range(t.term_i.shape[0]):
        kind, b, other = t.term_i[i]
        f, g, row = t.term_f[i], t.term_memory[i], t.pose[b]
        held, power = 0.0, 0.0
        if kind == GUIDE_BRAKE:
            v = row[VEL + 2]
            force = -rub(f[0], f[1], STANDING, v)
            Q[6 * b + 2] += force
            power = -force * v
        elif kind == AIR_DRAG:
            speed = np.sqrt(row[VEL] ** 2 + row[VEL + 1] ** 2 + row[VEL + 2] ** 2)
            held_back = drag(f[0], f[1], f[2], speed)
            for k in range(3):
                Q[6 * b + k] -= held_back * speed * row[VEL + k]
            power = held_back * speed**3
        elif kind == BETWEEN:
            # nose b below, body `other` above on the same guide
            shut = f[2] - (t.pose[other, X + 2] - row[X + 2])
            rate = row[VEL + 2] - t.pose[other, VEL + 2]
            force = f[0] * shut + f[1] * rate
            Q[6 * b + 2] -= force
            Q[6 * other + 2] += force
            held, power = 0.5 * f[0] * shut * shut, f[1] * rate * rate
        elif kind == ROTOR:
            # the rotor's angular momentum turns with the body: -omega x H, which does no work
            for k in range(3):
                m, n = (k + 1) % 3, (k + 2) % 3
                Q[6 * b + 3 + k] -= row[OMEGA + m] * f[n] - row[OMEGA + n] * f[m]
        elif kind == REACTION:
            Q[6 * b + 4] -= f[0]
            power = f[0] * row[OMEGA + 1]
        elif kind == BED:
            held, power = try_bed(t, i, Q)
        g[HELD_NOW], g[POWER_NOW] = held, power


@compiled
def try_bed(t: Any, i: int, Q: Any) -> Any:
    """Forces between chassis and a mass that moves along its y on a bed; returns energy held and power taken.

    Across the bed stiff springs hold the mass. Along y: spring, dashpot, friction mu N clip(v/v_c, +-1), and beyond the
    travel a stop as stiff as the bed.
    """
    c, b, f = t.term_i[i, 1], t.term_i[i, 2], t.term_f[i]
    chassis, load = t.pose[c], t.pose[b]
    local, force, torque = np.empty(3), np.zeros(3), np.zeros(3)
    local[0], local[1], local[2] = to_body(
        chassis, load[X] - chassis[X], load[X + 1] - chassis[X + 1], load[X + 2] - chassis[X + 2]
    )
    v, w = velocity(load, 0.0, 0.0, 0.0), velocity(chassis, local[0], local[1], local[2])
    rate = to_body(chassis, v[0] - w[0], v[1] - w[1], v[2] - w[2])
    turn = to_body(chassis, *spin(load))
    held, power = 0.0, 0.0
    for k in range(3):
        d = local[k] - f[B_PLACE + k]
        if k != 1:
            force[k] = -f[B_K] * d - f[B_C] * rate[k]
            held += 0.5 * f[B_K] * d * d
            power += f[B_C] * rate[k] * rate[k]
        else:
            beyond = d - min(max(d, -f[B_TRAVEL]), f[B_TRAVEL])
            # the wall's dashpot grows from nothing, so that a load meets it without a jump
            dashpot = f[B_DASHPOT] + f[B_C] * min(abs(beyond) / WALL, 1.0)
            force[1] = -f[B_SPRING] * d - f[B_K] * beyond - dashpot * rate[1]
            held += 0.5 * f[B_SPRING] * d * d + 0.5 * f[B_K] * beyond * beyond
            power += dashpot * rate[1] * rate[1]
        angle, slip = relative_angle(chassis, load, k), turn[k] - chassis[OMEGA + k]
        torque[k] = -f[B_KR] * angle - f[B_CR] * slip
        held += 0.5 * f[B_KR] * angle * angle
        power += f[B_CR] * slip * slip
    normal = np.sqrt(force[0] * force[0] + force[2] * force[2])
    rub = f[B_MU] * normal * min(max(rate[1] / CREEP, -1.0), 1.0)
    force[1] -= rub
    power += rub * rate[1]
    add_between(chassis, c, local, load, b, np.zeros(3), force, torque, Q)
    return held, power


@leaf
def finish_terms(t: Any, h: float) -> None:
    """Book what the terms took in a step, and start the next one."""
    for i in range(t.term_i.shape[0]):
        g = t.term_memory[i]
        t.work[EXTRA_WORK] += g[HELD_NOW] - g[HELD] + 0.5 * h * (g[POWER] + g[POWER_NOW])
        g[HELD], g[POWER] = g[HELD_NOW], g[POWER_NOW]


@compiled
def stiffen_terms(t: Any, f: float, fd: float, K: Any) -> None:
    """What the stiff ones of them add to Newton's matrix."""
    for i in range(t.term_i.shape[0]):
        kind, b, other = t.term_i[i]
        a = 6 * b + 2
        if kind == GUIDE_BRAKE and abs(t.pose[b, VEL + 2]) < max(t.term_f[i, 1], STANDING):
            K[a, a] += fd * t.term_f[i, 0] / max(t.term_f[i, 1], STANDING)
        elif kind == BETWEEN:
            both, c = f * t.term_f[i, 0] + fd * t.term_f[i, 1], 6 * other + 2
            K[a, a] += both
            K[c, c] += both
            K[a, c] -= both
            K[c, a] -= both
        elif kind == BED:
            stiffen_bed(t, i, f, fd, K)


@compiled
def stiffen_bed(t: Any, i: int, f: float, fd: float, K: Any) -> None:
    """Springs of a bed, along and about the chassis' axes."""
    c, b, n = t.term_i[i, 1], t.term_i[i, 2], t.term_f[i]
    chassis, load = t.pose[c], t.pose[b]
    local, zero, J = np.empty(3), np.zeros(3), np.zeros((2, 6))
    local[0], local[1], local[2] = to_body(
        chassis, load[X] - chassis[X], load[X + 1] - chassis[X + 1], load[X + 2] - chassis[X + 2]
    )
    for k in range(3):
        x, y, z = chassis[ROT + k], chassis[ROT + 3 + k], chassis[ROT + 6 + k]
        along = f * n[B_K] + fd * n[B_C]
        if k == 1:
            along = f * n[B_SPRING] + fd * n[B_DASHPOT]
            if abs(local[1] - n[B_PLACE + 1]) > n[B_TRAVEL]:
                along += f * n[B_K] + fd * n[B_C]
            v, w = velocity(load, 0.0, 0.0, 0.0), velocity(chassis, local[0], local[1], local[2])
            if abs(x * (v[0] - w[0]) + y * (v[1] - w[1]) + z * (v[2] - w[2])) < CREEP:
                along += fd * n[B_MU] * WEIGHT * t.mass[6 * b, 6 * b] / CREEP
        direction_row(load, zero, x, y, z, J[0])
        direction_row(chassis, local, x, y, z, J[1])
        add_both(K, along, J, 6 * b, 6 * c)
        J[:, :] = 0.0
        J[0, 3], J[0, 4], J[0, 5] = to_body(load, x, y, z)
        J[1, 3 + k] = 1.0
        add_both(K, f * n[B_KR] + fd * n[B_CR], J, 6 * b, 6 * c)


@leaf
def add_both(K: Any, factor: float, J: Any, at: int, bt: int) -> None:
    """K += factor (a - b)(a - b)' with the rows a and b of J at two bodies."""
    for j in range(6):
        for k in range(6):
            K[at + j, at + k] += factor * J[0, j] * J[0, k]
            K[bt + j, bt + k] += factor * J[1, j] * J[1, k]
            K[at + j, bt + k] -= factor * J[0, j] * J[1, k]
            K[bt + j, at + k] -= factor * J[1, j] * J[0, k]
