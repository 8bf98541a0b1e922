"""Compiled: a tyre on uneven ground, as a disc that the profile under it cuts into.

The area of the disc below the ground takes the place of depth: the tyre is pressed in as deep as it would be by a
plane that cuts off as much (equivalent-plane model after Sui and Hirshey 2001, recalled). The gradient of that area
is the chord from where the ground enters the disc to where it leaves it, whatever lies between: a wheel climbs a step
from the moment that its edge meets the tread, and its force leans back. Being the gradient of k d^2/2, it gives back
what it took.

How far the ground stands in the disc is told by how high it stands over the tread, brought into the disc's plane with
the slope around the wheel:

    L = (h(x, y) - z) / (sqrt(1 + |g|^2) cos(camber)),   g that slope, (x, y, z) on the tread,

which is exact on a plane, and for an upright disc at a step. Nothing has to be searched for, so that a disc that lies
against a steep face has one depth and no other; there the side wall bears, on the elements. A tyre whose side wall
gives way bears on its shoulder's ring instead, the more the flatter it lies: on a plane through the ground's heights at
four places of that ring.

The disc is the deepest of `SLICES` across the crowned tread, the maximum rounded by `SOFT`, which is also how far the
depth may differ from the plane's own law there. Limits: the profile is sampled at `NODES` places over the diameter; no
rim, no separate stiffness for a tread that wraps around an edge; the camber in the stiffness is that against the ground
around the wheel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ground.compiled import compiled, leaf
from ground.relief import height_and_gradient, highest
from rollover.kernels.tables import W_AXIS, W_CENTRE, W_CROWN, W_HALF, W_RADIUS, W_SIDE
from rollover.kernels.vectors import add_force, cross, place, spin, to_body, to_world, velocity

NODES = 49
SLICES = 5
SOFT = 0.001  # m: slices whose depths differ by less share the force
FAR = 0.2  # share of the radius: ground further below the tread is not looked at closely
FLAT = 0.12  # cos^2 of the camber, 70 degrees, from which a tyre begins to lie on its side

# places in what `cut` finds: depth, across the ground around the wheel, and its change with the hub's place and with
# the axle's direction; sine of the camber and its change with the hub's x and y; normal of the ground around the wheel,
# which is also the camber's change with the axle's direction; normal of the ground that the tyre presses on
C_DEPTH, C_BY_HUB, C_BY_AXLE, C_LEAN, C_LEAN_X, C_LEAN_Y, C_AROUND, C_NORMAL, CUTS = 0, 1, 4, 7, 8, 9, 10, 13, 16
# places in what `slice_through` finds: depth in the disc's plane; its change with the ground's height as sums over the
# tread of the direction (h_x, h_y, -1), of that times the place forward, times the place up, and of the height itself
S_DEPTH, S_PLACE, S_FORWARD, S_UP, S_HEIGHT, SLICED = 0, 1, 4, 7, 10, 11


@leaf
def lying(lean: float) -> Any:
    """Share of the tread's springs that is left when a tyre lies down, 1 up to a camber of 70 degrees, and its slope.

    The slope is that over lean^2.
    """
    s2 = min(lean * lean, 1.0)
    return ((1.0 - s2) / FLAT, -1.0 / FLAT) if 1.0 - s2 < FLAT else (1.0, 0.0)


@leaf
def stretch(R: float, a: float, b: float, ra: float, rb: float) -> Any:
    """Area between a straight stretch of ground and the arc below it, and what each end's height adds to it.

    In the disc's plane about its centre: s forward from `a` to `b`, heights `ra`, `rb`; arc at -sqrt(R^2 - s^2).
    """
    low_a, low_b = math.sqrt(max(R * R - a * a, 0.0)), math.sqrt(max(R * R - b * b, 0.0))
    if max(ra, rb) < -max(low_a, low_b) and a * b >= 0.0:
        return 0.0, 0.0, 0.0  # below the lower end of the arc, which does not turn in between: most stretches
    fa, fb = ra + low_a, rb + low_b
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


@leaf
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


@leaf
def slope_around(t: Any, hub: Any, reach: float, g: Any) -> None:
    """The ground's slope around the wheel (2,), its change with the hub's x, y, its height and slope, into `g` (9,).

    That of chords of the wheel's diameter through the hub, so that it does not jump at an edge.
    """
    x, y = hub[0], hub[1]
    a, ax, ay = height_and_gradient(t.relief, t.nodes, x + reach, y)
    b, bx, by = height_and_gradient(t.relief, t.nodes, x - reach, y)
    c, cx, cy = height_and_gradient(t.relief, t.nodes, x, y + reach)
    d, dx, dy = height_and_gradient(t.relief, t.nodes, x, y - reach)
    g[0], g[1] = 0.5 * (a - b) / reach, 0.5 * (c - d) / reach
    g[2], g[3] = 0.5 * (ax - bx) / reach, 0.5 * (cx - dx) / reach
    g[4], g[5] = 0.5 * (ay - by) / reach, 0.5 * (cy - dy) / reach
    g[6], g[7], g[8] = 0.25 * (a + b + c + d), 0.25 * (ax + bx + cx + dx), 0.25 * (ay + by + cy + dy)


@leaf
def slice_through(
    t: Any, centre: Any, forward: Any, up: Any, R: float, flat: float, at: Any, weight: Any, one: Any
) -> None:
    """Depth of one disc and what changes it, into `one` (SLICED,); `flat` turns heights into lengths up the disc.

    The disc's plane is spanned by `forward` and `up`. Where the ground does not reach the disc, the (negative)
    depth of what comes nearest to it.
    """
    relief, nodes, nearest, best = t.relief, t.nodes, -1e30, 0
    for i in range(NODES):
        s = R * (2.0 * i / (NODES - 1) - 1.0)
        arc = math.sqrt(max(R * R - s * s, 0.0))
        x, y = centre[0] + s * forward[0] - arc * up[0], centre[1] + s * forward[1] - arc * up[1]
        z, at[i, 2], at[i, 3] = height_and_gradient(relief, nodes, x, y)
        over = z - centre[2] - s * forward[2] + arc * up[2]
        at[i, 0], at[i, 1], at[i, 4], weight[i] = s, over * flat - arc, over, 0.0
        if over > nearest:
            nearest, best = over, i
    area = 0.0
    for i in range(NODES - 1):
        more, left, right = stretch(R, at[i, 0], at[i + 1, 0], at[i, 1], at[i + 1, 1])
        area += more
        weight[i] += left
        weight[i + 1] += right
    one[:] = 0.0
    one[S_DEPTH], factor = min(nearest, 0.0) * flat, flat
    if area > 1e-14:
        one[S_DEPTH], chord = depth_of(R, area)
        factor = flat / chord
    else:
        weight[:] = 0.0
        weight[best] = 1.0
    for i in range(NODES):
        if weight[i] > 0.0:
            s, by = at[i, 0], factor * weight[i]
            arc = math.sqrt(max(R * R - s * s, 0.0))
            for k in range(3):
                way = -by if k == 2 else by * at[i, 2 + k]
                one[S_PLACE + k] += way
                one[S_FORWARD + k] += s * way
                one[S_UP + k] -= arc * way
            one[S_HEIGHT] += by * at[i, 4]


@compiled
def cut(t: Any, row: Any, wheel: Any, found: Any) -> None:
    """What the ground cuts off a tyre, into `found` (CUTS,): the deepest of its slices, softly."""
    hub = place(row, wheel[W_CENTRE], wheel[W_CENTRE + 1], wheel[W_CENTRE + 2])
    e, n, forward, up = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    e[0], e[1], e[2] = to_world(row, wheel[W_AXIS], wheel[W_AXIS + 1], wheel[W_AXIS + 2])
    g = np.empty(9)
    slope_around(t, hub, wheel[W_RADIUS], g)
    size = math.sqrt(1.0 + g[0] * g[0] + g[1] * g[1])
    n[0], n[1], n[2] = -g[0] / size, -g[1] / size, 1.0 / size
    lean = n[0] * e[0] + n[1] * e[1] + n[2] * e[2]
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    found[:] = 0.0
    found[C_LEAN] = lean
    lean_by_g = -e[0] / size - lean * g[0] / (size * size), -e[1] / size - lean * g[1] / (size * size)
    found[C_LEAN_X] = lean_by_g[0] * g[2] + lean_by_g[1] * g[3]
    found[C_LEAN_Y] = lean_by_g[0] * g[4] + lean_by_g[1] * g[5]
    found[C_AROUND : C_AROUND + 3] = n
    found[C_NORMAL : C_NORMAL + 3] = n
    low = hub[2] - wheel[W_RADIUS] * math.sqrt(max(1.0 - e[2] * e[2], 0.0)) - wheel[W_HALF] * abs(e[2])
    gap = highest(t.relief, t.nodes, hub[0], hub[1], wheel[W_RADIUS] + wheel[W_HALF]) - low
    if gap < -FAR * wheel[W_RADIUS]:
        found[C_DEPTH] = gap
        return
    forward[0], forward[1], forward[2] = cross(e[0], e[1], e[2], n[0], n[1], n[2])
    for k in range(3):
        forward[k] /= cosine
        up[k] = (n[k] - lean * e[k]) / cosine
    at, weight, slices = np.empty((NODES, 5)), np.empty(NODES), np.empty((SLICES, SLICED))
    deepest = -1e30
    for j in range(SLICES):
        share = 2.0 * j / (SLICES - 1) - 1.0
        y = share * wheel[W_HALF]
        R = wheel[W_RADIUS] - max(wheel[W_CROWN], 1e-6) * share * share
        centre = (hub[0] + y * e[0], hub[1] + y * e[1], hub[2] + y * e[2])
        slice_through(t, centre, forward, up, R, 1.0 / (size * cosine), at, weight, slices[j])
        deepest = max(deepest, slices[j, S_DEPTH])
    total = 0.0
    for j in range(SLICES):
        total += math.exp((slices[j, S_DEPTH] - deepest) / SOFT)
    depth = deepest + SOFT * math.log(total)
    found[C_DEPTH] = depth * cosine
    # d(depth cos) by chains: places P = hub + y e + s forward - arc up; heights by 1/(size cos)
    whole, by_e = np.zeros(SLICED), np.zeros(3)
    for j in range(SLICES):
        part = cosine * math.exp((slices[j, S_DEPTH] - deepest) / SOFT) / total
        y = (2.0 * j / (SLICES - 1) - 1.0) * wheel[W_HALF]
        for k in range(SLICED):
            whole[k] += part * slices[j, k]
        for k in range(3):
            by_e[k] += part * y * slices[j, S_PLACE + k]
    a, b = whole[S_FORWARD : S_FORWARD + 3], whole[S_UP : S_UP + 3]
    by_lean, by_cosine = 0.0, depth - whole[S_HEIGHT] / cosine
    for k in range(3):
        by_lean -= b[k] * e[k] / cosine
        by_cosine -= (a[k] * forward[k] + b[k] * up[k]) / cosine
    by_lean -= by_cosine * lean / cosine
    from_a, into_n = cross(n[0], n[1], n[2], a[0], a[1], a[2]), cross(a[0], a[1], a[2], e[0], e[1], e[2])
    along, by_n = 0.0, np.empty(3)
    for k in range(3):
        found[C_BY_AXLE + k] = by_e[k] + (from_a[k] - lean * b[k]) / cosine + by_lean * n[k]
        by_n[k] = (into_n[k] + b[k]) / cosine + by_lean * e[k]
        along += by_n[k] * n[k]
    by_size = -whole[S_HEIGHT] / size
    by_gx = (by_size - along / size) * g[0] / size - by_n[0] / size
    by_gy = (by_size - along / size) * g[1] / size - by_n[1] / size
    found[C_BY_HUB] = whole[S_PLACE] + by_gx * g[2] + by_gy * g[3]
    found[C_BY_HUB + 1] = whole[S_PLACE + 1] + by_gx * g[4] + by_gy * g[5]
    found[C_BY_HUB + 2] = whole[S_PLACE + 2]
    if wheel[W_SIDE] > 0.0:
        lay(wheel, hub, g, found)
    strength = pressing(found)
    for k in range(3):
        found[C_NORMAL + k] = -found[C_BY_HUB + k] / strength


@leaf
def lay(wheel: Any, hub: Any, g: Any, found: Any) -> None:
    """Mix the depth of the shoulder's ring in the plane around the wheel into that of the tread, as the tyre lies down.

    d = D - y lean + R cos(camber), D the hub's depth, y the shoulder's place on the axle, R its radius.
    """
    lean = found[C_LEAN]
    share, fall = lying(lean)
    if share >= 1.0:
        return
    cosine = math.sqrt(max(1.0 - lean * lean, 1e-12))
    size = math.sqrt(1.0 + g[0] * g[0] + g[1] * g[1])
    y, radius, over = -math.copysign(wheel[W_HALF], lean), wheel[W_RADIUS] - max(wheel[W_CROWN], 1e-6), g[6] - hub[2]
    depth, by_lean = over / size - y * lean + radius * cosine, -y - radius * lean / cosine
    turning = 2.0 * fall * lean * (found[C_DEPTH] - depth)
    ring = (
        g[7] / size - over * (g[0] * g[2] + g[1] * g[3]) / size**3 + by_lean * found[C_LEAN_X],
        g[8] / size - over * (g[0] * g[4] + g[1] * g[5]) / size**3 + by_lean * found[C_LEAN_Y],
        -1.0 / size,
    )
    leans = (found[C_LEAN_X], found[C_LEAN_Y], 0.0)
    for k in range(3):
        found[C_BY_HUB + k] = share * found[C_BY_HUB + k] + (1.0 - share) * ring[k] + turning * leans[k]
        along = ((1.0 - share) * by_lean + turning) * found[C_AROUND + k]
        found[C_BY_AXLE + k] = share * found[C_BY_AXLE + k] + along
    found[C_DEPTH] = share * found[C_DEPTH] + (1.0 - share) * depth


@leaf
def pressing(found: Any) -> float:
    """Force on the hub for a unit of force on the depth."""
    return math.sqrt(found[C_BY_HUB] ** 2 + found[C_BY_HUB + 1] ** 2 + found[C_BY_HUB + 2] ** 2)


@leaf
def closing_rate(row: Any, c: Any, e: Any, found: Any) -> float:
    """Rate of the depth on uneven ground, m/s; e is the axle."""
    v = velocity(row, c[W_CENTRE], c[W_CENTRE + 1], c[W_CENTRE + 2])
    o = spin(row)
    turning = cross(o[0], o[1], o[2], e[0], e[1], e[2])
    rate = 0.0
    for k in range(3):
        rate += found[C_BY_HUB + k] * v[k] + found[C_BY_AXLE + k] * turning[k]
    return rate


@leaf
def leaning_rate(row: Any, c: Any, e: Any, found: Any) -> float:
    """Rate of the camber's sine on uneven ground, 1/s; e is the axle."""
    v = velocity(row, c[W_CENTRE], c[W_CENTRE + 1], c[W_CENTRE + 2])
    o = spin(row)
    x, y, z = cross(o[0], o[1], o[2], e[0], e[1], e[2])
    rate = found[C_LEAN_X] * v[0] + found[C_LEAN_Y] * v[1]
    return rate + found[C_AROUND] * x + found[C_AROUND + 1] * y + found[C_AROUND + 2] * z  # type: ignore[no-any-return]


@compiled
def press(t: Any, w: int, e: Any, force: float, moment: float, found: Any, Q: Any) -> None:
    """Force and moment of uneven ground on a tyre, into Q: those of -dU = -force d(depth) + moment d(lean)."""
    b = t.wheel_i[w]
    row = t.pose[b]
    x = -force * found[C_BY_HUB] + moment * found[C_LEAN_X]
    y = -force * found[C_BY_HUB + 1] + moment * found[C_LEAN_Y]
    add_force(row, b, t.wheel_f[w, W_CENTRE : W_CENTRE + 3], x, y, -force * found[C_BY_HUB + 2], Q)
    a = np.empty(3)
    for k in range(3):
        a[k] = -force * found[C_BY_AXLE + k] + moment * found[C_AROUND + k]
    x, y, z = cross(e[0], e[1], e[2], a[0], a[1], a[2])
    x, y, z = to_body(row, x, y, z)
    Q[6 * b + 3] += x
    Q[6 * b + 4] += y
    Q[6 * b + 5] += z
