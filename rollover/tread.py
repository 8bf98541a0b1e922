"""Compiled: a tyre on uneven ground, as a disc that the profile under it cuts into.

The area of the disc below the ground takes the place of depth: the tyre is pressed in as deep as it would be by a
plane that cuts off as much (equivalent-plane model after Sui and Hirshey 2001, recalled). The gradient of that area
is the chord from where the ground enters the disc to where it leaves it, whatever lies between: a wheel climbs a step
from the moment that its edge meets the tread, and its force leans back. Being the gradient of k d^2/2, it gives back
what it took.

The disc is the deepest of `SLICES` across the crowned tread, the maximum rounded by `SOFT`, which is also how far the
depth may differ from the plane's own law there. Limits: the profile is sampled at `NODES` places over the diameter; no
rim, no separate stiffness for a tread that wraps around an edge; the camber in the stiffness is that against the ground
around the wheel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled
from ground.relief import height_and_gradient, highest
from rollover.tables import (
    W_AXIS,
    W_CENTRE,
    W_CROWN,
    W_HALF,
    W_RADIUS,
)
from rollover.vectors import add_force, cross, place, spin, to_body, to_world, velocity

NODES = 25
SLICES = 5
SOFT = 0.001  # m: slices whose depths differ by less share the force
FAR = 0.2  # share of the radius: ground further below the tread is not looked at closely

# places in what `cut` finds: depth d in the disc's plane, cos of the camber (its sine is at the end); force and moment
# about the wheel's centre for a unit of force on the depth d cos; normal of the ground
C_DEPTH, C_COSINE, C_FORCE, C_MOMENT, C_NORMAL, C_CAMBER = 0, 1, 2, 5, 8, 11
# change of the camber's sine as the hub moves along x and y; normal that the camber is measured against
C_BY_X, C_BY_Y, C_AROUND, CUTS = 12, 13, 14, 17


@compiled
def stretch(R: float, a: float, b: float, ra: float, rb: float) -> Any:
    """Area between a straight stretch of ground and the arc below it, and what each end's height adds to it.

    In the disc's plane about its centre: s forward from `a` to `b`, heights `ra`, `rb`; arc at -sqrt(R^2 - s^2).
    """
    fa, fb = ra + math.sqrt(max(R * R - a * a, 0.0)), rb + math.sqrt(max(R * R - b * b, 0.0))
    slope = (rb - ra) / (b - a)
    c = ra - slope * a
    low, high = a, b
    if fa < 0.0 or fb < 0.0:
        root = R * R * (1.0 + slope * slope) - c * c
        if root <= 0.0:
            return 0.0, 0.0, 0.0
        root = math.sqrt(root)
        first, last = (-slope * c - root) / (1.0 + slope * slope), (-slope * c + root) / (1.0 + slope * slope)
        if fa < 0.0:
            low = max(first if slope * first + c <= 0.0 else last, a)
        if fb < 0.0:
            high = min(last if slope * last + c <= 0.0 else first, b)
        if high <= low:
            return 0.0, 0.0, 0.0
    arc = 0.5 * (high * math.sqrt(max(R * R - high * high, 0.0)) - low * math.sqrt(max(R * R - low * low, 0.0)))
    arc += 0.5 * R * R * (math.asin(min(max(high / R, -1.0), 1.0)) - math.asin(min(max(low / R, -1.0), 1.0)))
    width, middle = high - low, 0.5 * (low + high)
    at_b = width * (middle - a) / (b - a)
    return max(arc + width * (c + slope * middle), 0.0), width - at_b, at_b


@compiled
def depth_of(R: float, area: float) -> Any:
    """Depth of the segment of a disc that has this area, and its chord; past the centre the chord stays."""
    half = 0.5 * math.pi * R * R
    if area >= half:
        return R + (area - half) / (2.0 * R), 2.0 * R
    d = min((0.75 * area / math.sqrt(2.0 * R)) ** (2.0 / 3.0), R)
    for _ in range(20):
        chord = 2.0 * math.sqrt(d * (2.0 * R - d))
        wrong = R * R * math.acos(1.0 - d / R) - 0.5 * (R - d) * chord - area
        d = min(max(d - wrong / chord, 0.1 * d), R)
        if abs(wrong) < 1e-14 * R * R:
            break
    return d, 2.0 * math.sqrt(d * (2.0 * R - d))


@compiled
def lean_on(t: Any, hub: Any, e: Any, reach: float, found: Any) -> None:
    """Sine of the camber against the ground around the wheel, and how it changes as the hub moves along x and y.

    The ground's slope is that of chords of the wheel's diameter through the hub, so that it does not jump at an edge.
    """
    x, y = hub[0], hub[1]
    a, ax, ay = height_and_gradient(t.relief, t.nodes, x + reach, y)
    b, bx, by = height_and_gradient(t.relief, t.nodes, x - reach, y)
    c, cx, cy = height_and_gradient(t.relief, t.nodes, x, y + reach)
    d, dx, dy = height_and_gradient(t.relief, t.nodes, x, y - reach)
    gx, gy = 0.5 * (a - b) / reach, 0.5 * (c - d) / reach
    size = math.sqrt(1.0 + gx * gx + gy * gy)
    n = (-gx / size, -gy / size, 1.0 / size)
    lean = n[0] * e[0] + n[1] * e[1] + n[2] * e[2]
    by_gx, by_gy = -e[0] / size - lean * gx / (size * size), -e[1] / size - lean * gy / (size * size)
    found[C_CAMBER], found[C_COSINE] = lean, math.sqrt(max(1.0 - lean * lean, 1e-12))
    found[C_BY_X] = 0.5 * (by_gx * (ax - bx) + by_gy * (cx - dx)) / reach
    found[C_BY_Y] = 0.5 * (by_gx * (ay - by) + by_gy * (cy - dy)) / reach
    for k in range(3):
        found[C_AROUND + k] = n[k]


@compiled
def slice_through(t: Any, hub: Any, centre: Any, e: Any, R: float, at: Any, weight: Any, one: Any) -> None:
    """Depth of one disc across the axle e, its gradient and its moment about the hub, into `one` (7,).

    Where the ground does not reach the disc, the (negative) depth of what comes nearest to it.
    """
    upright = math.sqrt(1.0 - e[2] * e[2])
    # forward, level; and up within the disc's plane
    fx, fy = e[1] / upright, -e[0] / upright
    wx, wy, wz = fy * e[2], -fx * e[2], upright
    x0, y0, z0 = centre
    nearest, best = -1e30, 0
    for i in range(NODES):
        s = R * (2.0 * i / (NODES - 1) - 1.0)
        arc = math.sqrt(max(R * R - s * s, 0.0))
        r, gx, gy, q = -arc, 0.0, 0.0, 1.0
        for _ in range(8):
            px, py, pz = x0 + s * fx + r * wx, y0 + s * fy + r * wy, z0 + r * wz
            z, gx, gy = height_and_gradient(t.relief, t.nodes, px, py)
            q = max(wz - gx * wx - gy * wy, 0.1)
            r += (z - pz) / q
            if abs(e[2]) < 1e-9 or abs(z - pz) < 1e-11 or r < -arc - FAR * R:
                break
        p = at[i]
        p[0], p[1], p[7] = s, r, 1.0 / q
        p[2], p[3], p[4] = x0 + s * fx + r * wx, y0 + s * fy + r * wy, z0 + r * wz
        p[5], p[6] = gx / q, gy / q
        weight[i] = 0.0
        if r + arc > nearest:
            nearest, best = r + arc, i
    area = 0.0
    for i in range(NODES - 1):
        more, left, right = stretch(R, at[i, 0], at[i + 1, 0], at[i, 1], at[i + 1, 1])
        area += more
        weight[i] += left
        weight[i + 1] += right
    one[:] = 0.0
    one[0], factor = min(nearest, 0.0), 1.0
    if area > 1e-14:
        one[0], chord = depth_of(R, area)
        factor = 1.0 / chord
    else:
        weight[:] = 0.0
        weight[best] = 1.0
    for i in range(NODES):
        if weight[i] > 0.0:
            p, by = at[i], factor * weight[i]
            a, b, c = -by * p[5], -by * p[6], by * p[7]
            u, v, w = cross(p[2] - hub[0], p[3] - hub[1], p[4] - hub[2], a, b, c)
            one[1], one[2], one[3] = one[1] + a, one[2] + b, one[3] + c
            one[4], one[5], one[6] = one[4] + u, one[5] + v, one[6] + w
    # the wheel's own turning moves no sample; yet these stay level, so that they turn about the axle as the wheel leans
    about = e[0] * one[4] + e[1] * one[5] + e[2] * one[6]
    lift = about * e[2] / upright
    one[4] += lift * wx - about * e[0]
    one[5] += lift * wy - about * e[1]
    one[6] += lift * wz - about * e[2]


@compiled
def cut(t: Any, row: Any, wheel: Any, found: Any) -> None:
    """What the ground cuts off a tyre, into `found` (CUTS,): the deepest of its slices, softly."""
    e = to_world(row, wheel[W_AXIS], wheel[W_AXIS + 1], wheel[W_AXIS + 2])
    hub = place(row, wheel[W_CENTRE], wheel[W_CENTRE + 1], wheel[W_CENTRE + 2])
    found[:] = 0.0
    lean_on(t, hub, e, wheel[W_RADIUS], found)
    for k in range(3):
        found[C_NORMAL + k] = found[C_AROUND + k]
    upright = math.sqrt(max(1.0 - e[2] * e[2], 0.0))
    low = hub[2] - wheel[W_RADIUS] * upright - wheel[W_HALF] * abs(e[2])
    gap = highest(t.relief, t.nodes, hub[0], hub[1], wheel[W_RADIUS] + wheel[W_HALF]) - low
    if gap < -FAR * wheel[W_RADIUS] or upright < 0.05:
        found[C_DEPTH] = min(gap, -FAR * wheel[W_RADIUS])
        return
    at, weight, slices = np.empty((NODES, 8)), np.empty(NODES), np.empty((SLICES, 7))
    deepest = -1e30
    for j in range(SLICES):
        share = 2.0 * j / (SLICES - 1) - 1.0
        y = share * wheel[W_HALF]
        R = wheel[W_RADIUS] - max(wheel[W_CROWN], 1e-6) * share * share
        centre = (hub[0] + y * e[0], hub[1] + y * e[1], hub[2] + y * e[2])
        slice_through(t, hub, centre, e, R, at, weight, slices[j])
        deepest = max(deepest, slices[j, 0])
    total = 0.0
    for j in range(SLICES):
        total += math.exp((slices[j, 0] - deepest) / SOFT)
    found[C_DEPTH] = deepest + SOFT * math.log(total)
    for j in range(SLICES):
        part = found[C_COSINE] * math.exp((slices[j, 0] - deepest) / SOFT) / total
        for k in range(3):
            found[C_FORCE + k] += part * slices[j, 1 + k]
            found[C_MOMENT + k] += part * slices[j, 4 + k]
    size = math.sqrt(found[C_FORCE] ** 2 + found[C_FORCE + 1] ** 2 + found[C_FORCE + 2] ** 2)
    for k in range(3):
        found[C_NORMAL + k] = found[C_FORCE + k] / size


@compiled
def closing_rate(row: Any, c: Any, e: Any, found: Any) -> float:
    """Rate of the depth on uneven ground, m/s; e is the axle."""
    v = velocity(row, c[W_CENTRE], c[W_CENTRE + 1], c[W_CENTRE + 2])
    o = spin(row)
    rate = 0.0
    for k in range(3):
        rate -= found[C_FORCE + k] * v[k] + found[C_MOMENT + k] * o[k]
    x, y, z = cross(o[0], o[1], o[2], e[0], e[1], e[2])
    leaning = found[C_AROUND] * x + found[C_AROUND + 1] * y + found[C_AROUND + 2] * z
    leaning += found[C_BY_X] * v[0] + found[C_BY_Y] * v[1]
    return rate - found[C_DEPTH] * found[C_CAMBER] / found[C_COSINE] * leaning  # type: ignore[no-any-return]


@compiled
def press(t: Any, w: int, force: float, slope: float, found: Any, Q: Any) -> float:
    """Normal force of uneven ground on a tyre, into Q; returns the moment that its camber adds.

    U = k d^2/2 (1 - lean^2) with d the cut's own depth: what the second factor takes away is a moment too.
    """
    b = t.wheel_i[w]
    row = t.pose[b]
    x, y, z = force * found[C_FORCE], force * found[C_FORCE + 1], force * found[C_FORCE + 2]
    d, lean = found[C_DEPTH], found[C_CAMBER]
    moment = lean * d * (force / found[C_COSINE] - slope * d * (1.0 - lean * lean))
    # the camber changes with the place as well as with the axle's direction
    x, y = x + moment * found[C_BY_X], y + moment * found[C_BY_Y]
    add_force(row, b, t.wheel_f[w, W_CENTRE : W_CENTRE + 3], x, y, z, Q)
    x, y, z = force * found[C_MOMENT], force * found[C_MOMENT + 1], force * found[C_MOMENT + 2]
    x, y, z = to_body(row, x, y, z)
    Q[6 * b + 3] += x
    Q[6 * b + 4] += y
    Q[6 * b + 5] += z
    return moment  # type: ignore[no-any-return]
