"""Compiled: the joints as equations of position, g(q) = 0, and their rows G with dg/dt = G v.

A pivot holds a point of two bodies together and keeps y and z of body b at right angles to x of body a, about which it
turns. A guide holds a body on a vertical line through its place at the start, all its axes as they are.
"""

from __future__ import annotations

from typing import Any

from ground.compiled import inlined, leaf
from rollover.kernels.tables import GUIDE, ROT, X
from rollover.kernels.vectors import cross, direction_row, place, to_body

EQUATIONS = 5  # of each joint
# of a guide: axis of the world and axis of the body that stay at right angles
SQUARE = ((2, 1), (2, 0), (0, 1))


@inlined
def unit(k: int) -> Any:
    """Three numbers, 1 at place k."""
    return 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0


@leaf
def joint_errors(t: Any, anchor: Any, g: Any) -> None:
    """g (5 nj,) at the poses that were read last; `anchor` (nj, 3) are the places of guides, world."""
    for j in range(t.joint_i.shape[0]):
        a, b, at = t.pose[t.joint_i[j, 1]], t.pose[t.joint_i[j, 2]], EQUATIONS * j
        if t.joint_i[j, 0] == GUIDE:
            g[at], g[at + 1] = a[X] - anchor[j, 0], a[X + 1] - anchor[j, 1]
            for k in range(3):
                g[at + 2 + k] = a[ROT + 3 * SQUARE[k][0] + SQUARE[k][1]]
            continue
        p = t.joint_f[j]
        x, y, z = place(a, p[0], p[1], p[2])
        u, v, w = place(b, p[3], p[4], p[5])
        g[at], g[at + 1], g[at + 2] = u - x, v - y, w - z
        for k in range(1, 3):
            g[at + 2 + k] = 0.0
            for m in range(3):
                g[at + 2 + k] += a[ROT + 3 * m] * b[ROT + 3 * m + k]


@leaf
def joint_rows(t: Any, G: Any) -> None:
    """G (5 nj, n) at the poses that were read last; columns of joints' bodies are written, the others stay."""
    for j in range(t.joint_i.shape[0]):
        a, b, r = t.joint_i[j, 1], t.joint_i[j, 2], EQUATIONS * j
        for k in range(EQUATIONS):
            for m in range(6):
                G[r + k, 6 * a + m] = 0.0
        if t.joint_i[j, 0] == GUIDE:
            row = t.pose[a]
            G[r, 6 * a], G[r + 1, 6 * a + 1] = 1.0, 1.0
            for k in range(3):
                fixed, i = SQUARE[k]
                e, f, g = unit(fixed)
                x, y, z = cross(row[ROT + i], row[ROT + 3 + i], row[ROT + 6 + i], e, f, g)
                x, y, z = to_body(row, x, y, z)
                G[r + 2 + k, 6 * a + 3], G[r + 2 + k, 6 * a + 4], G[r + 2 + k, 6 * a + 5] = x, y, z
            continue
        p, under, upper = t.joint_f[j], t.pose[a], t.pose[b]
        for k in range(3):
            e, f, g = unit(k)
            direction_row(under, p[:3], -e, -f, -g, G[r + k, 6 * a : 6 * a + 6])
            direction_row(upper, p[3:], e, f, g, G[r + k, 6 * b : 6 * b + 6])
        for k in range(1, 3):
            # d/dt (x_a . y_b) = (omega_a - omega_b) . (x_a x y_b)
            x, y, z = cross(
                under[ROT], under[ROT + 3], under[ROT + 6], upper[ROT + k], upper[ROT + 3 + k], upper[ROT + 6 + k]
            )
            u, v, w = to_body(under, x, y, z)
            x, y, z = to_body(upper, x, y, z)
            at = r + 2 + k
            G[at, 6 * a + 3], G[at, 6 * a + 4], G[at, 6 * a + 5] = u, v, w
            for m in range(3):
                G[at, 6 * b + m] = 0.0
            G[at, 6 * b + 3], G[at, 6 * b + 4], G[at, 6 * b + 5] = -x, -y, -z
