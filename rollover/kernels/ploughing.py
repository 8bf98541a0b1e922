"""Compiled: what the soil ahead of a member that ploughs sideways puts against it, once for each accepted step.

The sunken edge of a footprint is made of the faces of its elements. Such a face, towards the motion and between the
element's sinkage z and that of its neighbour z', meets the passive earth pressure of the soil between them,

    F = b (n . t) [P(z) - P(z')],    P(z) = A z^2 + B z,

with its width b, its outward normal n and the direction of sliding t: along a whole edge the widths b (n . t) add up to
that across the motion, whatever the edge's shape. The force joins the element's friction: along its sliding, taken by
the same spring, booked in the same account.
"""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import inlined, leaf
from ground.kernel import BODY, CELL, IDLE, MODE, NORMAL, OWNER_R, PLOUGHED, ROW, SINKAGE, rut_depth
from rollover.kernels.tables import ACTIVE, MEMORYLESS, PLOUGH_LINEAR, PLOUGH_SQUARE
from rollover.kernels.vectors import velocity

SLIDES = 1e-3  # m/s: slower, it keeps the side to which it ploughed last


@inlined
def pressed(soil: Any, z: float) -> float:
    """P(z), N/m."""
    return (soil[PLOUGH_SQUARE] * z + soil[PLOUGH_LINEAR]) * z  # type: ignore[no-any-return]


@leaf
def sunk(t: Any, x: int, y: int) -> float:
    """How deep the ground of an element lies: under what presses on it, or its rut, m; 0 where nothing was."""
    if x < 0 or y < 0 or x >= t.grid_i[0] or y >= t.grid_i[1]:
        return 0.0
    slot = t.slot_of[x * t.grid_i[1] + y]
    if slot < 0:
        return 0.0
    m = t.memory[slot]
    return max(m[SINKAGE], 0.0) if t.state[slot, MODE] != IDLE else rut_depth(m)


@leaf
def plough(t: Any) -> None:
    """Renew `PLOUGHED` of all elements in contact, by the motion that the next step begins with."""
    ploughs = False
    for row in range(t.soil.shape[0]):
        ploughs = ploughs or t.soil[row, PLOUGH_SQUARE] + t.soil[row, PLOUGH_LINEAR] > 0.0
    if not ploughs:
        return
    for a in range(t.counts[ACTIVE]):
        slot = t.active[a]
        m, soil = t.memory[slot], t.soil[t.state[slot, ROW]]
        if soil[PLOUGH_SQUARE] + soil[PLOUGH_LINEAR] <= 0.0 or soil[MEMORYLESS] > 0.0:
            continue
        v = velocity(t.pose[t.state[slot, BODY]], m[OWNER_R], m[OWNER_R + 1], m[OWNER_R + 2])
        lift = v[0] * m[NORMAL] + v[1] * m[NORMAL + 1] + v[2] * m[NORMAL + 2]
        x, y = v[0] - lift * m[NORMAL], v[1] - lift * m[NORMAL + 1]
        speed = math.sqrt(x * x + y * y)
        if speed < SLIDES:
            continue
        column, line = t.state[slot, CELL] // t.grid_i[1], t.state[slot, CELL] % t.grid_i[1]
        here = max(m[SINKAGE], 0.0)
        ahead = min(sunk(t, column + (1 if x > 0.0 else -1), line), here)
        aside = min(sunk(t, column, line + (1 if y > 0.0 else -1)), here)
        force = t.grid_f[3] * abs(x) * (pressed(soil, here) - pressed(soil, ahead))
        force += t.grid_f[2] * abs(y) * (pressed(soil, here) - pressed(soil, aside))
        m[PLOUGHED] = force / speed
