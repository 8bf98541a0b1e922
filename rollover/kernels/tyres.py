"""Compiled: forces of the tyres: radial and lateral springs, the ring of a tyre that lies on its side, friction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.kernel import friction_force
from rollover.kernels.tables import (
    E_ANCHOR,
    E_COSINE,
    E_COSINE_NOW,
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
    E_INWARD,
    E_INWARD_NOW,
    E_MOVED,
    E_NORMAL,
    E_NORMAL_NOW,
    E_PLACE,
    E_POINT,
    E_SHEAR,
    E_SLIP,
    E_WHERE,
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
    W_SIDE,
    X,
)
from rollover.kernels.tyre_contact import (
    C_DEPTH,
    C_LEAN,
    C_NORMAL,
    CUTS,
    closing_rate,
    cut,
    leaning_rate,
    lying,
    press,
    pressing,
)
from rollover.kernels.vectors import add_force, cross, place, to_body, to_world, velocity
from rollover.kernels.wheel_spin import tread_motion, turn_by_friction

TYRE_RELAXATION = 0.002  # s, dashpot over stick spring of a tyre


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
def tyre_stiffness(wheel: Any, lean: float) -> Any:
    """k(lean^2) and its derivative: radial and lateral springs in series, faded out over the last 20 degrees.

    1/k = cos^2/k_z + sin^2/k_y; a tyre flat on its side has no lowest point: its side wall bears, on the elements, or
    as the ring of `laid`, which needs no fading.
    """
    s2 = min(lean * lean, 1.0)
    series = (1.0 - s2) / wheel[W_KZ] + s2 / wheel[W_KY]
    slope = 1.0 / wheel[W_KY] - 1.0 / wheel[W_KZ]
    fade, fall = lying(lean) if wheel[W_SIDE] == 0.0 else (1.0, 0.0)
    return fade / series, fall / series - fade * slope / (series * series)


@leaf
def laid(wheel: Any, depth: float, cosine: float) -> Any:
    """Spring force and twice the energy, both over k, and how far within the ring the pressure's centre lies, m.

    The shoulder's ring, of radius R, is rigid and yields on the rim by kappa k as a whole. It is pressed at its lowest
    point, where it gives by d, until it has tilted by its own slope s; then it lies flat, shifted by z = d - R s, and

        2 U/k = d^2                                            for d <= R s kappa/(kappa - 1),
        2 U/k = kappa z^2 + R^2 s^2 kappa/(kappa - 1)          beyond: the pressure's centre is R^2 s/((kappa - 1) z)

    from the ring's: U and its slopes do not jump. With kappa = 3, s small: a uniform foundation, c R^2/2 of a tilt.
    """
    radius, more = wheel[W_RADIUS] - max(wheel[W_CROWN], 1e-6), wheel[W_SIDE] - 1.0
    reach = radius * cosine
    if wheel[W_SIDE] == 0.0 or depth * more <= reach * wheel[W_SIDE]:
        return depth, depth * depth, 0.0
    shift = depth - reach
    twice = wheel[W_SIDE] * (shift * shift + reach * reach / more)
    return wheel[W_SIDE] * shift, twice, radius * (1.0 - reach / (more * shift))


@leaf
def along_axle(e: Any, n: Any, lean: float, v: Any) -> Any:
    """Part of a world vector along the axle's direction in the surface."""
    a, b, c = e[0] - lean * n[0], e[1] - lean * n[1], e[2] - lean * n[2]
    factor = (a * v[0] + b * v[1] + c * v[2]) / max(1.0 - lean * lean, 1e-12)
    return factor * a, factor * b, factor * c


@leaf
def mixed(a: Any, b: Any, part: float) -> Any:
    """A + (b - a) part."""
    if part == 0.0:
        return a
    return a[0] + (b[0] - a[0]) * part, a[1] + (b[1] - a[1]) * part, a[2] + (b[2] - a[2]) * part


@leaf
def within(row: Any, n: Any, e: Any, lean: float, inward: float, g: Any, x: Any) -> None:
    """Move the place of a tyre's contact from the lowest point towards the ring's middle, in `x` and the memory `g`."""
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    for k in range(3):
        x[k] += inward * (n[k] - lean * e[k]) / cosine
        g[E_WHERE + k] = row[X + k] + x[k]
    g[E_POINT], g[E_POINT + 1], g[E_POINT + 2] = to_body(row, x[0], x[1], x[2])


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
        camber = found[C_LEAN] if uneven else lean
        cosine = math.sqrt(max(1.0 - camber * camber, 1e-12))
        g[E_INWARD_NOW], g[E_COSINE_NOW] = 0.0, cosine
        if depth <= 0.0:
            continue
        pressed, twice, inward = laid(c, depth, cosine)
        if inward > 0.0:
            within(row, n, e, lean, inward, g, x)
        v = velocity(row, r[0], r[1], r[2])
        rate = -(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
        if uneven:
            rate = closing_rate(row, c, e, found)
            if inward > 0.0:
                rate += inward * camber / cosine * leaning_rate(row, c, e, found)
        g[E_INWARD_NOW] = inward
        v = velocity(row, hold[0], hold[1], hold[2])
        if spinning:
            vx, vy, vz = to_world(row, turning[0], turning[1], turning[2])
            v = v[0] + vx, v[1] + vy, v[2] + vz
        stiffness, slope = tyre_stiffness(c, camber)
        spring, energy, beyond = stiffness * pressed, 0.5 * stiffness * twice, max(depth - c[W_BOTTOM], 0.0)
        fade, fall = lying(camber)
        if beyond > 0.0:
            # the rim bottoms: a second spring in parallel, with an energy of its own
            spring += fade * c[W_KB] * beyond
            energy += 0.5 * fade * c[W_KB] * beyond * beyond
        share = 1.0 if inward == 0.0 else pressed / depth  # of a ring that lies down, so that its dashpot does not jump
        damping = max(share * c[W_C] * stiffness / c[W_KZ] * rate, -spring)  # never a pull
        force = spring + damping
        # the stiffness falls with camber: -dU/d(lean), the moment that keeps the spring conservative
        moment = -slope * camber * twice - fall * c[W_KB] * camber * beyond * beyond
        if uneven:
            moment -= force * inward * camber / cosine  # at the pressure's centre instead of the lowest point
            press(t, w, e, force, moment, found, Q)
            force *= pressing(found)
        g[E_FORCE_NOW], g[E_DAMPING_NOW], g[E_ENERGY_NOW] = force, damping, energy
        stick = max(c[W_MU] * force / c[W_KY], 1e-9)
        slip = (g[E_MOVED], g[E_MOVED + 1], g[E_MOVED + 2])
        shear = (g[E_SHEAR], g[E_SHEAR + 1], g[E_SHEAR + 2])
        if c[W_ROLLS] > 0.0 and not spinning:
            # a wheel that turns freely holds only along its axle; what goes the other way is rolling
            # once it lies flat it does not roll any more
            part = inward / (c[W_RADIUS] - max(c[W_CROWN], 1e-6))
            v = mixed(along_axle(e, n, lean, v), v, part)
            slip = mixed(along_axle(e, n, lean, slip), slip, part)
            shear = mixed(along_axle(e, n, lean, shear), shear, part)
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
        g[E_ENERGY], g[E_INWARD], g[E_COSINE] = g[E_ENERGY_NOW], g[E_INWARD_NOW], g[E_COSINE_NOW]
        for k in range(3):
            g[E_FRICTION + k] = g[E_FRICTION_NOW + k]
            g[E_NORMAL + k] = g[E_NORMAL_NOW + k]
