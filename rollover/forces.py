"""Compiled: generalised forces and added mass of one state, tried without writing any memory.

Q = sum over contacts of J' F with J the Jacobian of the point; ground elements, tyres, mounts and axle stop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled
from ground.kernel import (
    BODY,
    MASS_B,
    NORMAL,
    OFFSET,
    OWNER_R,
    PLACE,
    SHEAR,
    friction_force,
    normal_force,
)
from rollover.tables import (
    A_C,
    A_K,
    A_SWING,
    ACTIVE,
    E_ANCHOR,
    E_DAMPING_NOW,
    E_DEPTH_NOW,
    E_ENERGY_NOW,
    E_FORCE_NOW,
    E_FRICTION_NOW,
    E_MOVED,
    E_PLACE,
    E_POINT,
    E_SHEAR,
    E_WHERE,
    FN,
    FT,
    M_ANGLE_NOW,
    M_TORQUE_NOW,
    MOVED,
    MU,
    OMEGA,
    RELAXATION,
    ROT,
    S_ANGLE_NOW,
    S_DELTA_NOW,
    S_FORCE_NOW,
    S_SET,
    S_TORQUE_NOW,
    STICK,
    T_C,
    T_CHASSIS,
    T_CR,
    T_K,
    T_KR,
    T_ROPS,
    T_YIELD,
    VEL,
    W_AXIS,
    W_C,
    W_CENTRE,
    W_CROWN,
    W_HALF,
    W_KY,
    W_KZ,
    W_MU,
    W_RADIUS,
    ZDOT,
    X,
    Z,
)

TYRE_RELAXATION = 0.002  # s, dashpot over stick spring of a tyre's tread edge


@compiled
def rotation(a: float, b: float, c: float, out: Any) -> None:
    """Rotation matrix of the rotation vector (a, b, c), row by row into out (9,)."""
    angle = math.sqrt(a * a + b * b + c * c)
    if angle < 1e-6:
        s, k = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    else:
        s, k = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    out[0] = 1.0 - k * (b * b + c * c)
    out[1] = k * a * b - s * c
    out[2] = k * a * c + s * b
    out[3] = k * a * b + s * c
    out[4] = 1.0 - k * (a * a + c * c)
    out[5] = k * b * c - s * a
    out[6] = k * a * c - s * b
    out[7] = k * b * c + s * a
    out[8] = 1.0 - k * (a * a + b * b)


@compiled
def read_poses(pose: Any, q: Any, qd: Any) -> None:
    """Positions, rotation matrices and velocities of all bodies from the generalised coordinates."""
    for b in range(pose.shape[0]):
        for k in range(3):
            pose[b, X + k] = q[6 * b + k]
            pose[b, VEL + k] = qd[6 * b + k]
            pose[b, OMEGA + k] = qd[6 * b + 3 + k]
        rotation(q[6 * b + 3], q[6 * b + 4], q[6 * b + 5], pose[b, ROT : ROT + 9])


@compiled
def to_world(row: Any, r: Any, out: Any) -> None:
    """R r."""
    for k in range(3):
        out[k] = row[ROT + 3 * k] * r[0] + row[ROT + 3 * k + 1] * r[1] + row[ROT + 3 * k + 2] * r[2]


@compiled
def to_body(row: Any, v: Any, out: Any) -> None:
    """R' v."""
    for k in range(3):
        out[k] = row[ROT + k] * v[0] + row[ROT + 3 + k] * v[1] + row[ROT + 6 + k] * v[2]


@compiled
def cross(a: Any, b: Any, out: Any) -> None:
    """A x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def place_and_velocity(row: Any, r: Any, x: Any, v: Any) -> None:
    """World position and velocity of the point r of a body."""
    t = np.empty(3)
    to_world(row, r, x)
    cross(row[OMEGA : OMEGA + 3], r, t)
    to_world(row, t, v)
    for k in range(3):
        x[k] += row[X + k]
        v[k] += row[VEL + k]


@compiled
def add_force(row: Any, b: int, r: Any, force: Any, Q: Any) -> None:
    """Add a world force at the point r of body b to the generalised forces (torque about body axes)."""
    local, torque = np.empty(3), np.empty(3)
    to_body(row, force, local)
    cross(r, local, torque)
    for k in range(3):
        Q[6 * b + k] += force[k]
        Q[6 * b + 3 + k] += torque[k]


@compiled
def depth_row(row: Any, r: Any, n: Any, J: Any) -> None:
    """J (6,) with dz/dt = J [v, omega]: z the depth of the point r along -n."""
    local, arm = np.empty(3), np.empty(3)
    to_body(row, n, local)
    cross(r, local, arm)
    for k in range(3):
        J[k] = -n[k]
        J[3 + k] = -arm[k]


@compiled
def centripetal_depth(row: Any, r: Any, n: Any) -> float:
    """J' [v, omega]: the part of the depth's acceleration that does not come from accelerations."""
    a, b, c = np.empty(3), np.empty(3), np.empty(3)
    w = row[OMEGA : OMEGA + 3]
    cross(w, r, a)
    cross(w, a, b)
    to_world(row, b, c)
    return -(n[0] * c[0] + n[1] * c[1] + n[2] * c[2])  # type: ignore[no-any-return]


@compiled
def try_elements(t: Any, Q: Any) -> None:
    """Forces of the elements in contact, with what was found for each in `trial`."""
    x, v, f = np.empty(3), np.empty(3), np.empty(3)
    mu, stick, relaxation = t.soil[MU], t.soil[STICK], t.soil[RELAXATION]
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m, trial = t.memory[i], t.trial[i]
        b = t.state[i, BODY]
        row = t.pose[b]
        r, n = m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3]
        place_and_velocity(row, r, x, v)
        z = m[OFFSET] - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])
        zdot = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        force = normal_force(t.law, t.p, t.s[i], m, z, zdot)
        trial[Z], trial[ZDOT], trial[FN] = z, zdot, force
        for k in range(3):
            trial[MOVED + k] = x[k] - m[PLACE + k]
        friction_force(
            mu, stick, relaxation, force, m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], v, n, trial[FT : FT + 3]
        )
        if m[MASS_B] > 0.0:
            # the co-moving mass is in the mass matrix; what its centripetal acceleration takes stands here
            force += m[MASS_B] * centripetal_depth(row, r, n)
        for k in range(3):
            f[k] = force * n[k] + trial[FT + k]
        add_force(row, b, r, f, Q)


@compiled
def tyre_point(row: Any, wheel: Any, n: Any, e: Any, x: Any) -> float:
    """Lowest point of a crowned tread: its place about the carrier's centre of mass (world axes) into x (3,).

    The tread's section is R - c (2y/w)^2 over the width w; at camber g its lowest point stands at
    y = w^2 tan(g)/(8 c), at most at the shoulder. Returns lean = n . e, the sine of the camber; e is the wheel axis.
    """
    to_world(row, wheel[W_AXIS : W_AXIS + 3], e)
    lean = n[0] * e[0] + n[1] * e[1] + n[2] * e[2]
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    half = wheel[W_HALF]
    y = -half
    if abs(lean) * half < 2.0 * max(wheel[W_CROWN], 1e-6) * cosine:
        y = -half * half * lean / (2.0 * max(wheel[W_CROWN], 1e-6) * cosine)
    elif lean < 0.0:
        y = half
    radius = wheel[W_RADIUS] - wheel[W_CROWN] * (y / half) ** 2
    to_world(row, wheel[W_CENTRE : W_CENTRE + 3], x)
    for k in range(3):
        x[k] += y * e[k] - (n[k] - lean * e[k]) * radius / cosine
    return lean  # type: ignore[no-any-return]


@compiled
def tyre_stiffness(wheel: Any, lean: float) -> Any:
    """k(lean^2) and its derivative: radial and lateral springs in series, faded out from 60 degrees of camber.

    1/k = cos^2/k_z + sin^2/k_y; a tyre on its side bears on its side wall, which the ground's elements carry.
    """
    s2 = min(lean * lean, 1.0)
    series = (1.0 - s2) / wheel[W_KZ] + s2 / wheel[W_KY]
    slope = 1.0 / wheel[W_KY] - 1.0 / wheel[W_KZ]
    fade, fall = 1.0, 0.0
    if s2 > 0.75:
        fade, fall = 4.0 * (1.0 - s2), -4.0
    return fade / series, fall / series - fade * slope / (series * series)


@compiled
def try_wheels(t: Any, Q: Any) -> None:
    """Tyre forces on the undisturbed surface: energy k(camber) depth^2/2, a dashpot, friction on a stick spring."""
    e, r, x, v, f, place, torque = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    n, offset = t.plane[:3], t.plane[3]
    for w in range(t.wheel_i.size):
        b = t.wheel_i[w]
        row, c, g = t.pose[b], t.wheel_f[w], t.wheel_memory[w]
        lean = tyre_point(row, c, n, e, x)
        to_body(row, x, r)
        for k in range(3):
            g[E_POINT + k] = r[k]
        place_and_velocity(row, r, x, v)
        depth = offset - (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])
        rate = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        for k in range(3):
            g[E_WHERE + k] = x[k]
        g[E_DEPTH_NOW], g[E_FORCE_NOW], g[E_DAMPING_NOW], g[E_ENERGY_NOW] = depth, 0.0, 0.0, 0.0
        place_and_velocity(row, g[E_ANCHOR : E_ANCHOR + 3], place, f)
        for k in range(3):
            g[E_MOVED + k] = place[k] - g[E_PLACE + k]
            g[E_FRICTION_NOW + k] = 0.0
        if depth <= 0.0:
            continue
        stiffness, slope = tyre_stiffness(c, lean)
        spring = stiffness * depth
        damping = max(c[W_C] * stiffness / c[W_KZ] * rate, -spring)  # never a pull
        force = spring + damping
        g[E_FORCE_NOW], g[E_DAMPING_NOW], g[E_ENERGY_NOW] = force, damping, 0.5 * spring * depth
        stick = max(c[W_MU] * force / c[W_KY], 1e-9)
        friction_force(
            c[W_MU],
            stick,
            TYRE_RELAXATION,
            force,
            g[E_SHEAR : E_SHEAR + 3],
            g[E_MOVED : E_MOVED + 3],
            v,
            n,
            g[E_FRICTION_NOW : E_FRICTION_NOW + 3],
        )
        for k in range(3):
            f[k] = force * n[k] + g[E_FRICTION_NOW + k]
        add_force(row, b, r, f, Q)
        # the stiffness falls with camber: the moment that goes with it keeps the spring conservative
        cross(e, n, f)
        for k in range(3):
            f[k] *= -slope * lean * depth * depth
        to_body(row, f, torque)
        for k in range(3):
            Q[6 * b + 3 + k] += torque[k]


@compiled
def relative_angle(a: Any, b: Any, out: Any) -> None:
    """Rotation of body b against body a, as a vector in a's axes; exact to second order in the angle."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        ji, ij = 0.0, 0.0
        for m in range(3):
            ji += a[ROT + 3 * m + j] * b[ROT + 3 * m + i]
            ij += a[ROT + 3 * m + i] * b[ROT + 3 * m + j]
        out[k] = 0.5 * (ji - ij)


@compiled
def try_mounts(t: Any, Q: Any) -> None:
    """Loads through the mounts: on the ROPS, and their reaction on the chassis at the same point."""
    if t.mount_f.shape[0] == 0:
        return
    c, b = t.mount_i[0], t.mount_i[1]
    chassis, rops = t.pose[c], t.pose[b]
    x, v, place, speed = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    local, delta, rate, force, angle, spin, torque = (
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    relative_angle(chassis, rops, angle)
    to_world(rops, rops[OMEGA : OMEGA + 3], x)
    to_body(chassis, x, spin)
    for k in range(3):
        spin[k] -= chassis[OMEGA + k]
    for i in range(t.mount_f.shape[0]):
        f, g = t.mount_f[i], t.mount_memory[i]
        place_and_velocity(rops, f[T_ROPS : T_ROPS + 3], x, v)
        for k in range(3):
            place[k] = x[k] - chassis[X + k]
        to_body(chassis, place, local)  # the ROPS' mounting point, in chassis axes about its centre of mass
        place_and_velocity(chassis, local, place, speed)
        for k in range(3):
            speed[k] = v[k] - speed[k]
            delta[k] = local[k] - f[T_CHASSIS + k]
        to_body(chassis, speed, rate)
        for k in range(3):
            spring = f[T_K + k] * (delta[k] - g[S_SET + k])
            spring = min(max(spring, -f[T_YIELD + k]), f[T_YIELD + k])
            force[k] = -spring - f[T_C + k] * rate[k]
            torque[k] = -f[T_KR + k] * angle[k] - f[T_CR + k] * spin[k]
            g[S_DELTA_NOW + k] = delta[k]
            g[S_FORCE_NOW + k] = force[k]
            g[S_ANGLE_NOW + k] = angle[k]
            g[S_TORQUE_NOW + k] = torque[k]
        to_world(chassis, force, x)
        add_force(rops, b, f[T_ROPS : T_ROPS + 3], x, Q)
        for k in range(3):
            x[k] = -x[k]
        add_force(chassis, c, local, x, Q)
        to_world(chassis, torque, x)
        to_body(rops, x, v)
        for k in range(3):
            Q[6 * b + 3 + k] += v[k]
            Q[6 * c + 3 + k] -= torque[k]


@compiled
def try_axle(t: Any, Q: Any) -> None:
    """Torque of the front axle's stops about the pivot (chassis x)."""
    if t.axle_f.size == 0:
        return
    c, b = t.axle_i[0], t.axle_i[1]
    chassis, axle = t.pose[c], t.pose[b]
    r11, r21 = 0.0, 0.0
    for m in range(3):
        r11 += chassis[ROT + 3 * m + 1] * axle[ROT + 3 * m + 1]
        r21 += chassis[ROT + 3 * m + 2] * axle[ROT + 3 * m + 1]
    angle = math.atan2(r21, r11)
    x, v = np.empty(3), np.empty(3)
    to_world(axle, axle[OMEGA : OMEGA + 3], x)
    to_body(chassis, x, v)
    rate = v[0] - chassis[OMEGA]
    torque = 0.0
    if angle > t.axle_f[A_SWING]:
        torque = min(-t.axle_f[A_K] * (angle - t.axle_f[A_SWING]) - t.axle_f[A_C] * rate, 0.0)
    elif angle < -t.axle_f[A_SWING]:
        torque = max(-t.axle_f[A_K] * (angle + t.axle_f[A_SWING]) - t.axle_f[A_C] * rate, 0.0)
    t.axle_memory[M_ANGLE_NOW], t.axle_memory[M_TORQUE_NOW] = angle, torque
    Q[6 * c + 3] -= torque
    v[0], v[1], v[2] = torque, 0.0, 0.0
    to_world(chassis, v, x)
    to_body(axle, x, v)
    for k in range(3):
        Q[6 * b + 3 + k] += v[k]


@compiled
def generalised_forces(t: Any, q: Any, qd: Any, Q: Any) -> None:
    """All of the above at the state (q, qd), into Q (6 nb,)."""
    Q[:] = 0.0
    read_poses(t.pose, q, qd)
    try_elements(t, Q)
    try_wheels(t, Q)
    try_mounts(t, Q)
    try_axle(t, Q)


@compiled
def added_mass(t: Any, q: Any, M: Any) -> None:
    """Sum of m_b1 J J' over the elements in contact, into M (6 nb, 6 nb)."""
    M[:] = 0.0
    J = np.empty(6)
    for b in range(t.pose.shape[0]):
        rotation(q[6 * b + 3], q[6 * b + 4], q[6 * b + 5], t.pose[b, ROT : ROT + 9])
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m = t.memory[i]
        if m[MASS_B] > 0.0:
            b = t.state[i, BODY]
            depth_row(t.pose[b], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)
            for j in range(6):
                for k in range(6):
                    M[6 * b + j, 6 * b + k] += m[MASS_B] * J[j] * J[k]
