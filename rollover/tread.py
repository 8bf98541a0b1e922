"""Compiled: a tyre on uneven ground, as a disc that the profile under it cuts into.

The area of the disc below the ground takes the place of depth: the tyre is pressed in as deep as it would be by a
plane that cuts off as much (equivalent-plane model after Sui and Hirshey 2001, recalled). The gradient of that area
is the chord from where the ground enters the disc to where it leaves it, whatever lies between: a wheel climbs a step
from the moment that its edge meets the tread, and its force leans back. Being the gradient of k d^2/2, it gives back
what it took. On a plane it is the plane's own law, to rounding.

Limits: one disc, at the tread's lowest generator, so that nothing is enveloped across the tread; the profile is
sampled at `NODES` places over the diameter; no rim, no separate stiffness for a tread that wraps around an edge.
The camber's part in the stiffness is that of the last step's ground.
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

NODES = 33
FAR = 0.2  # share of the radius: ground further below the tread is not looked at closely

# places in what `cut` finds: depth d in the disc's plane, cos of the camber (its sine is at the end); force and moment
# about the wheel's centre for a unit of force on the depth d cos; normal of the ground
C_DEPTH, C_COSINE, C_FORCE, C_MOMENT, C_NORMAL, C_CAMBER, CUTS = 0, 1, 2, 5, 8, 11, 12


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
def cut(t: Any, row: Any, wheel: Any, before: Any, found: Any) -> None:
    """What the ground cuts off a tyre, into `found` (CUTS,); `before` (3,) is the ground's normal of the last step."""
    e = to_world(row, wheel[W_AXIS], wheel[W_AXIS + 1], wheel[W_AXIS + 2])
    hub = place(row, wheel[W_CENTRE], wheel[W_CENTRE + 1], wheel[W_CENTRE + 2])
    lean = before[0] * e[0] + before[1] * e[1] + before[2] * e[2]
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    half, crown = wheel[W_HALF], max(wheel[W_CROWN], 1e-6)
    y = min(max(-half * half * lean / (2.0 * crown * cosine), -half), half)
    R = wheel[W_RADIUS] - crown * (y / half) ** 2
    found[:] = 0.0
    found[C_COSINE], found[C_CAMBER] = cosine, lean
    for k in range(3):
        found[C_NORMAL + k] = before[k]
    upright = math.sqrt(max(1.0 - e[2] * e[2], 0.0))
    x0, y0, z0 = hub[0] + y * e[0], hub[1] + y * e[1], hub[2] + y * e[2]
    if upright < 0.05:
        found[C_DEPTH] = -R
        return
    gap = highest(t.relief, t.nodes, x0, y0, R) - (z0 - R * upright)
    if gap < -FAR * R:
        found[C_DEPTH] = gap
        return
    # forward, level; and up within the disc's plane
    fx, fy = e[1] / upright, -e[0] / upright
    wx, wy, wz = fy * e[2], -fx * e[2], upright
    at = np.empty((NODES, 8))  # s, height in the plane, place (3), gradient (2) over q, 1/q
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
        if r + arc > nearest:
            nearest, best = r + arc, i
    area = 0.0
    weight = np.zeros(NODES)
    for i in range(NODES - 1):
        more, left, right = stretch(R, at[i, 0], at[i + 1, 0], at[i, 1], at[i + 1, 1])
        area += more
        weight[i] += left
        weight[i + 1] += right
    gx, gy, up = at[best, 5], at[best, 6], at[best, 7]
    if area > 1e-14:
        gx, gy, up = 0.0, 0.0, 0.0
        for i in range(NODES):
            if weight[i] > 0.0:
                p = at[i]
                a, b, c = -weight[i] * p[5], -weight[i] * p[6], weight[i] * p[7]
                gx, gy, up = gx - a, gy - b, up + c
                u, v, w = cross(p[2] - hub[0], p[3] - hub[1], p[4] - hub[2], a, b, c)
                found[C_MOMENT] += u
                found[C_MOMENT + 1] += v
                found[C_MOMENT + 2] += w
        depth, chord = depth_of(R, area)
        factor = cosine / chord
        found[C_DEPTH], found[C_FORCE], found[C_FORCE + 1] = depth, -factor * gx, -factor * gy
        found[C_FORCE + 2] = factor * up
        # turning about the axle moves no ground through the disc
        about = e[0] * found[C_MOMENT] + e[1] * found[C_MOMENT + 1] + e[2] * found[C_MOMENT + 2]
        for k in range(3):
            found[C_MOMENT + k] = factor * (found[C_MOMENT + k] - about * e[k])
    else:
        found[C_DEPTH] = min(nearest, 0.0)
    size = math.sqrt(gx * gx + gy * gy + up * up)
    found[C_NORMAL], found[C_NORMAL + 1], found[C_NORMAL + 2] = -gx / size, -gy / size, up / size


@compiled
def closing_rate(row: Any, c: Any, e: Any, n: Any, found: Any) -> float:
    """Rate of the depth on uneven ground, m/s; e is the axle, n the normal that the camber is measured against."""
    v = velocity(row, c[W_CENTRE], c[W_CENTRE + 1], c[W_CENTRE + 2])
    o = spin(row)
    rate = 0.0
    for k in range(3):
        rate -= found[C_FORCE + k] * v[k] + found[C_MOMENT + k] * o[k]
    x, y, z = cross(o[0], o[1], o[2], e[0], e[1], e[2])
    leaning = n[0] * x + n[1] * y + n[2] * z
    return rate - found[C_DEPTH] * found[C_CAMBER] / found[C_COSINE] * leaning


@compiled
def press(t: Any, w: int, force: float, slope: float, found: Any, Q: Any) -> float:
    """Normal force of uneven ground on a tyre, into Q; returns the moment that its camber adds.

    U = k d^2/2 (1 - lean^2) with d the cut's own depth: what the second factor takes away is a moment too.
    """
    b = t.wheel_i[w]
    row = t.pose[b]
    x, y, z = force * found[C_FORCE], force * found[C_FORCE + 1], force * found[C_FORCE + 2]
    add_force(row, b, t.wheel_f[w, W_CENTRE : W_CENTRE + 3], x, y, z, Q)
    x, y, z = force * found[C_MOMENT], force * found[C_MOMENT + 1], force * found[C_MOMENT + 2]
    x, y, z = to_body(row, x, y, z)
    Q[6 * b + 3] += x
    Q[6 * b + 4] += y
    Q[6 * b + 5] += z
    d, lean = found[C_DEPTH], found[C_CAMBER]
    return lean * d * (force / found[C_COSINE] - slope * d * (1.0 - lean * lean))
