"""Compiled: generalised forces and added mass of one state, tried without writing any memory.

Q = sum over contacts of J' F with J the Jacobian of the point; ground elements, tyres, mounts and axle stop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import (
    AREA,
    BODY,
    MASS_B,
    NORMAL,
    OFFSET,
    OWNER_R,
    PLACE,
    PLOUGHED,
    ROW,
    SHEAR,
    SHEARED,
    SPREAD,
    friction_force,
    normal_force,
)
from ground.shear import shear_force
from rollover.kernels.compliant_joints import try_mounts
from rollover.kernels.inputs import read_inputs, try_inputs
from rollover.kernels.occupant import try_links
from rollover.kernels.stand_devices import try_devices
from rollover.kernels.tables import (
    A_C,
    A_IMPACT,
    A_K,
    A_SWING,
    ACTIVE,
    COHESION,
    E_ANCHOR,
    E_DAMPING,
    E_DAMPING_NOW,
    E_DEPTH,
    E_DEPTH_NOW,
    E_ENERGY,
    E_ENERGY_NOW,
    E_FORCE,
    E_FORCE_NOW,
    E_FRICTION,
    E_FRICTION_NOW,
    E_MOVED,
    E_NORMAL,
    E_NORMAL_NOW,
    E_PLACE,
    E_POINT,
    E_SHEAR,
    E_SLIP,
    E_WHERE,
    FN,
    FT,
    M_ANGLE_NOW,
    M_FREE,
    M_REACH,
    M_TORQUE_NOW,
    MODULUS,
    MOVED,
    MU,
    OMEGA,
    RELAXATION,
    ROT,
    STICK,
    VEL,
    W_AXIS,
    W_BOTTOM,
    W_C,
    W_CENTRE,
    W_CROWN,
    W_HALF,
    W_KB,
    W_KY,
    W_KZ,
    W_MU,
    W_RADIUS,
    W_ROLLS,
    ZDOT,
    X,
    Z,
)
from rollover.kernels.terms import try_terms
from rollover.kernels.tyre_contact import C_DEPTH, C_LEAN, C_NORMAL, CUTS, closing_rate, cut, press, pressing
from rollover.kernels.vectors import (
    add_force,
    centripetal_depth,
    cross,
    depth_row,
    place,
    set_rotation,
    spin,
    to_body,
    to_world,
    velocity,
)
from rollover.kernels.wheel_spin import read_spins, tread_motion, try_spins, turn_by_friction

FLAT = 0.12  # cos^2 of the camber, 70 degrees, from which a tyre begins to lie on its side
TYRE_RELAXATION = 0.002  # s, dashpot over stick spring of a tyre


@leaf
def read_poses(pose: Any, q: Any, qd: Any) -> None:
    """Positions, rotation matrices and velocities of all bodies from the generalised coordinates."""
    for b in range(pose.shape[0]):
        for k in range(3):
            pose[b, X + k] = q[6 * b + k]
            pose[b, VEL + k] = qd[6 * b + k]
            pose[b, OMEGA + k] = qd[6 * b + 3 + k]
        set_rotation(pose[b], q[6 * b + 3], q[6 * b + 4], q[6 * b + 5])


@leaf
def try_elements(t: Any, Q: Any) -> None:
    """Forces of the elements in contact, with what was found for each in `trial`."""
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m, trial = t.memory[i], t.trial[i]
        b = t.state[i, BODY]
        row, law = t.pose[b], t.state[i, ROW]
        mu, stick, relaxation = t.soil[law, MU], t.soil[law, STICK], t.soil[law, RELAXATION]
        r, n = m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3]
        x, y, z = place(row, r[0], r[1], r[2])
        v = velocity(row, r[0], r[1], r[2])
        depth = m[OFFSET] - (n[0] * x + n[1] * y + n[2] * z) + m[SPREAD]
        rate = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        force = normal_force(t.law[law], t.p[law], t.s[i], m, depth, rate)
        trial[Z], trial[ZDOT], trial[FN] = depth, rate, force
        trial[MOVED], trial[MOVED + 1], trial[MOVED + 2] = x - m[PLACE], y - m[PLACE + 1], z - m[PLACE + 2]
        modulus = t.soil[law, MODULUS]
        if modulus > 0.0:
            strength = t.soil[law, COHESION] * m[AREA] + mu * force + m[PLOUGHED] if force > 0.0 else 0.0
            f = shear_force(strength, modulus, m[SHEARED], m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], n)
        else:
            most = mu * force + m[PLOUGHED] if force > 0.0 else 0.0
            f = friction_force(1.0, stick, relaxation, most, m[SHEAR : SHEAR + 3], trial[MOVED : MOVED + 3], v, n)
        trial[FT], trial[FT + 1], trial[FT + 2] = f
        if m[MASS_B] > 0.0:
            # the co-moving mass is in the mass matrix; what its centripetal acceleration takes stands here
            force += m[MASS_B] * centripetal_depth(row, r, n)
        add_force(row, b, r, force * n[0] + f[0], force * n[1] + f[1], force * n[2] + f[2], Q)


@leaf
def tyre_point(row: Any, wheel: Any, n: Any, e: Any, x: Any) -> float:
    """Lowest point of a crowned tread: its place about the carrier's centre of mass (world axes) into x (3,).

    The tread's section is R - c (2y/w)^2 over the width w; at camber g its lowest point stands at
    y = w^2 tan(g)/(8 c), at most at the shoulder. Returns lean = n . e, the sine of the camber; e is the wheel axis.
    """
    e[0], e[1], e[2] = to_world(row, wheel[W_AXIS], wheel[W_AXIS + 1], wheel[W_AXIS + 2])
    lean = n[0] * e[0] + n[1] * e[1] + n[2] * e[2]
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    half, crown = wheel[W_HALF], max(wheel[W_CROWN], 1e-6)
    y = min(max(-half * half * lean / (2.0 * crown * cosine), -half), half)
    radius = wheel[W_RADIUS] - crown * (y / half) ** 2
    centre = to_world(row, wheel[W_CENTRE], wheel[W_CENTRE + 1], wheel[W_CENTRE + 2])
    x[0] = centre[0] + y * e[0] - (n[0] - lean * e[0]) * radius / cosine
    x[1] = centre[1] + y * e[1] - (n[1] - lean * e[1]) * radius / cosine
    x[2] = centre[2] + y * e[2] - (n[2] - lean * e[2]) * radius / cosine
    return lean  # type: ignore[no-any-return]


@leaf
def lying(lean: float) -> Any:
    """Share of the tread's springs that is left when a tyre lies down, 1 up to a camber of 70 degrees, and its slope.

    The slope is that over lean^2.
    """
    s2 = min(lean * lean, 1.0)
    return ((1.0 - s2) / FLAT, -1.0 / FLAT) if 1.0 - s2 < FLAT else (1.0, 0.0)


@leaf
def tyre_stiffness(wheel: Any, lean: float) -> Any:
    """k(lean^2) and its derivative: radial and lateral springs in series, faded out over the last 20 degrees.

    1/k = cos^2/k_z + sin^2/k_y; a tyre flat on its side has no lowest point: its side wall bears, on the elements.
    """
    s2 = min(lean * lean, 1.0)
    series = (1.0 - s2) / wheel[W_KZ] + s2 / wheel[W_KY]
    slope = 1.0 / wheel[W_KY] - 1.0 / wheel[W_KZ]
    fade, fall = lying(lean)
    return fade / series, fall / series - fade * slope / (series * series)


@leaf
def along_axle(e: Any, n: Any, lean: float, v: Any) -> Any:
    """Part of a world vector along the axle's direction in the surface."""
    a, b, c = e[0] - lean * n[0], e[1] - lean * n[1], e[2] - lean * n[2]
    factor = (a * v[0] + b * v[1] + c * v[2]) / max(1.0 - lean * lean, 1e-12)
    return factor * a, factor * b, factor * c


@compiled
def try_wheels(t: Any, Q: Any) -> None:
    """Tyre forces on the undisturbed surface: energy k(camber) depth^2/2, a dashpot, friction on a stick spring."""
    e, x, tread, found = np.empty(3), np.empty(3), np.empty(3), np.zeros(CUTS)
    uneven = t.relief.shape[0] > 0
    for w in range(t.wheel_i.size):
        b = t.wheel_i[w]
        row, c, g = t.pose[b], t.wheel_f[w], t.wheel_memory[w]
        n, offset = g[E_NORMAL_NOW : E_NORMAL_NOW + 3], t.plane[3]
        if uneven:
            cut(t, row, c, found)
            n[:] = found[C_NORMAL : C_NORMAL + 3]
        else:
            n[:] = t.plane[:3]
        lean = tyre_point(row, c, n, e, x)
        r = g[E_POINT : E_POINT + 3]
        r[0], r[1], r[2] = to_body(row, x[0], x[1], x[2])
        depth = offset
        for k in range(3):
            g[E_WHERE + k] = row[X + k] + x[k]
            depth -= n[k] * g[E_WHERE + k]
            g[E_FRICTION_NOW + k] = 0.0
        hold = g[E_ANCHOR : E_ANCHOR + 3]
        turning, spinning = (0.0, 0.0, 0.0), t.spin_i[w] >= 0 and t.spin_i[w] < Q.shape[0]
        if spinning:
            hold = tread
            turning = tread_motion(t, w, g[E_ANCHOR : E_ANCHOR + 3], tread)
        held = place(row, hold[0], hold[1], hold[2])
        for k in range(3):
            g[E_MOVED + k] = held[k] - g[E_PLACE + k]
        if uneven:
            depth = found[C_DEPTH]
        g[E_DEPTH_NOW], g[E_FORCE_NOW], g[E_DAMPING_NOW], g[E_ENERGY_NOW] = depth, 0.0, 0.0, 0.0
        if depth <= 0.0:
            continue
        v = velocity(row, r[0], r[1], r[2])
        rate, camber = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2]), lean
        if uneven:
            rate = closing_rate(row, c, e, found)
            camber = found[C_LEAN]
        v = velocity(row, hold[0], hold[1], hold[2])
        if spinning:
            vx, vy, vz = to_world(row, turning[0], turning[1], turning[2])
            v = v[0] + vx, v[1] + vy, v[2] + vz
        stiffness, slope = tyre_stiffness(c, camber)
        spring, energy, beyond = stiffness * depth, 0.5 * stiffness * depth * depth, max(depth - c[W_BOTTOM], 0.0)
        fade, fall = lying(camber)
        if beyond > 0.0:
            # the rim bottoms: a second spring in parallel, with an energy of its own
            spring += fade * c[W_KB] * beyond
            energy += 0.5 * fade * c[W_KB] * beyond * beyond
        damping = max(c[W_C] * stiffness / c[W_KZ] * rate, -spring)  # never a pull
        force = spring + damping
        # the stiffness falls with camber: -dU/d(lean), the moment that keeps the spring conservative
        moment = -slope * camber * depth * depth - fall * c[W_KB] * camber * beyond * beyond
        if uneven:
            press(t, w, e, force, moment, found, Q)
            force *= pressing(found)
        g[E_FORCE_NOW], g[E_DAMPING_NOW], g[E_ENERGY_NOW] = force, damping, energy
        stick = max(c[W_MU] * force / c[W_KY], 1e-9)
        slip = (g[E_MOVED], g[E_MOVED + 1], g[E_MOVED + 2])
        shear = (g[E_SHEAR], g[E_SHEAR + 1], g[E_SHEAR + 2])
        if c[W_ROLLS] > 0.0 and not spinning:
            # a wheel that turns freely holds only along its axle; what goes the other way is rolling
            v, slip, shear = along_axle(e, n, lean, v), along_axle(e, n, lean, slip), along_axle(e, n, lean, shear)
        g[E_SLIP], g[E_SLIP + 1], g[E_SLIP + 2] = slip
        f = friction_force(c[W_MU], stick, TYRE_RELAXATION, force, shear, slip, v, n)
        g[E_FRICTION_NOW], g[E_FRICTION_NOW + 1], g[E_FRICTION_NOW + 2] = f
        if not uneven:
            add_force(row, b, r, force * n[0], force * n[1], force * n[2], Q)
        if spinning:
            turn_by_friction(t, w, hold, f, Q)
        add_force(row, b, hold, f[0], f[1], f[2], Q)  # friction holds the tread where it took hold of it
        if not uneven:
            ex, ey, ez = cross(e[0], e[1], e[2], n[0], n[1], n[2])
            ex, ey, ez = to_body(row, moment * ex, moment * ey, moment * ez)
            Q[6 * b + 3] += ex
            Q[6 * b + 4] += ey
            Q[6 * b + 5] += ez


@leaf
def keep_tyres(t: Any) -> None:
    """What was found of the tyres is what the next step starts from."""
    for w in range(t.wheel_i.size):
        g = t.wheel_memory[w]
        g[E_DEPTH], g[E_FORCE], g[E_DAMPING] = g[E_DEPTH_NOW], g[E_FORCE_NOW], g[E_DAMPING_NOW]
        g[E_ENERGY] = g[E_ENERGY_NOW]
        for k in range(3):
            g[E_FRICTION + k] = g[E_FRICTION_NOW + k]
            g[E_NORMAL + k] = g[E_NORMAL_NOW + k]


@leaf
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
    x, y, z = spin(axle)
    rate = to_body(chassis, x, y, z)[0] - chassis[OMEGA]
    torque = 0.0
    # a stop that has been struck holds from where that was; before, it is the impact that turns the axle round
    swing = max(t.axle_f[A_SWING], t.axle_memory[M_REACH])
    if t.axle_f[A_IMPACT] > 0.0 and t.axle_memory[M_FREE] > 0.0:
        swing = math.inf
    if angle > swing:
        torque = min(-t.axle_f[A_K] * (angle - swing) - t.axle_f[A_C] * rate, 0.0)
    elif angle < -swing:
        torque = max(-t.axle_f[A_K] * (angle + swing) - t.axle_f[A_C] * rate, 0.0)
    t.axle_memory[M_ANGLE_NOW], t.axle_memory[M_TORQUE_NOW] = angle, torque
    Q[6 * c + 3] -= torque
    x, y, z = to_world(chassis, torque, 0.0, 0.0)
    on_axle = to_body(axle, x, y, z)
    for k in range(3):
        Q[6 * b + 3 + k] += on_axle[k]


@compiled
def generalised_forces(t: Any, q: Any, qd: Any, Q: Any) -> None:
    """All of the above at the state (q, qd), into Q (n,); wheels do not turn where q is that of the bodies alone."""
    for k in range(Q.shape[0]):
        Q[k] = 0.0
    read_poses(t.pose, q, qd)
    read_spins(t, q, qd)
    read_inputs(t)
    try_elements(t, Q)
    try_wheels(t, Q)
    try_spins(t, Q)
    try_mounts(t, Q)
    try_axle(t, Q)
    try_devices(t, Q)
    try_terms(t, Q)
    try_links(t, Q)
    try_inputs(t, Q)


@compiled
def added_mass(t: Any, q: Any, M: Any) -> None:
    """Sum of m_b1 J J' over the elements in contact and what turning wheels add, into M (n, n)."""
    M[:, :] = t.spin_mass
    J = np.empty(6)
    for b in range(t.pose.shape[0]):
        set_rotation(t.pose[b], q[6 * b + 3], q[6 * b + 4], q[6 * b + 5])
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        m = t.memory[i]
        if m[MASS_B] > 0.0:
            b = t.state[i, BODY]
            depth_row(t.pose[b], m[OWNER_R : OWNER_R + 3], m[NORMAL : NORMAL + 3], J)
            for j in range(6):
                for k in range(6):
                    M[6 * b + j, 6 * b + k] += m[MASS_B] * J[j] * J[k]
