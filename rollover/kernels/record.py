"""Compiled: what is kept of a step: the row of an output step, events that are new, flags that laws alone decide."""

from __future__ import annotations

import math
from typing import Any

from ground.compiled import compiled, leaf
from ground.kernel import AREA, ROW, SINKAGE
from rollover.kernels.elements import kinetic_of_soil
from rollover.kernels.inputs import V_NOW
from rollover.kernels.posts import P_FOOT, P_USE, P_WAY, P_WORK, RECORDED
from rollover.kernels.tables import (
    ACTIVE,
    DEEP,
    E_FORCE,
    E_FRICTION,
    E_NORMAL,
    E_WHERE,
    EV_KIND,
    EV_SUBJECT,
    EVENTS,
    FLAGS_NOW,
    M_ANGLE,
    M_IMPULSE,
    OUT_COLUMNS,
    RESULTANT_COLUMNS,
    S_DELTA_NOW,
    S_FORCE_NOW,
    UNCALIBRATED,
    WHEEL_OFF,
    WHEEL_ON,
    WORKS,
)


@compiled
def write_row(t: Any, q: Any, qd: Any, qdd: Any, row: Any) -> None:
    """State, contact resultants, wheel, mount and hinge forces, axle, work, soil's kinetic energy, sinkage, flags."""
    n, nb = q.size, t.pose.shape[0]
    for j in range(n):
        row[j], row[n + j], row[2 * n + j] = q[j], qd[j], qdd[j]
    k = 3 * n
    for b in range(nb):
        for j in range(RESULTANT_COLUMNS):
            row[k] = t.resultant[b, j]
            k += 1
    for w in range(t.wheel_i.size):
        g = t.wheel_memory[w]
        row[k] = g[E_FORCE]
        for j in range(3):
            row[k + 1 + j] = g[E_FRICTION + j]
            row[k + 4 + j] = g[E_WHERE + j]
            row[k + 7 + j] = g[E_NORMAL + j]
        k += 10
    for i in range(t.mount_f.shape[0]):
        for j in range(6):
            row[k + j] = t.mount_memory[i, S_FORCE_NOW + j]
            row[k + 6 + j] = t.mount_memory[i, S_DELTA_NOW + j]
        if t.mount_i[i, 2] >= 0:  # what is found at its head, as its foot carries it
            for j in range(3):
                row[k + 3 + j] = t.post_memory[t.mount_i[i, 2], P_FOOT + j]
        k += 12
    row[k], row[k + 1] = t.axle_memory[M_ANGLE], t.axle_memory[M_IMPULSE]
    k += 2
    for j in range(WORKS):
        row[k] = t.work[j]
        k += 1
    row[k] = kinetic_of_soil(t)
    deepest, footprint = 0.0, 0.0
    for a in range(t.counts[ACTIVE]):
        deepest = max(deepest, t.memory[t.active[a], SINKAGE])
        if t.memory[t.active[a], SINKAGE] > 0.0:  # not those that are near
            footprint += t.memory[t.active[a], AREA]
    row[k + 1] = deepest
    row[k + 2] = t.counts[FLAGS_NOW]
    row[k + 3] = footprint
    k += 4
    for i in range(t.input_i.shape[0]):
        row[k] = t.input_memory[i, V_NOW]
        k += 1
    for j in range(t.link_out.size):
        row[k] = t.link_out[j]
        k += 1
    for i in range(t.post_f.shape[0]):
        g = t.post_memory[i]
        row[k] = math.sqrt(g[P_WAY] ** 2 + g[P_WAY + 1] ** 2 + g[P_WAY + 2] ** 2)
        row[k + 1], row[k + 2] = g[P_WORK], g[P_USE]
        k += RECORDED
    if t.device_i.shape[0] > 0:
        for j in range(OUT_COLUMNS):
            row[k + j] = t.device_out[j]


@leaf
def new_events(t: Any, seen: Any) -> int:
    """Keep the first event of its kind for each subject, wheels each time; `seen` (kinds, subjects) is written."""
    kept = 0
    for k in range(t.counts[EVENTS]):
        kind, who = int(t.event[k, EV_KIND]), int(t.event[k, EV_SUBJECT])
        if seen[kind, who] and kind != WHEEL_OFF and kind != WHEEL_ON:
            continue
        seen[kind, who] = True
        for j in range(t.event.shape[1]):
            t.event[kept, j] = t.event[k, j]
        kept += 1
    t.counts[EVENTS] = kept
    return kept


@leaf
def law_flags(t: Any, uncalibrated: Any, deepest: Any) -> int:
    """Bits of the contacts of this moment whose law has nothing measured behind it, or is deeper than what is.

    `uncalibrated` and `deepest` are (nr,), of each law.
    """
    flags = 0
    for a in range(t.counts[ACTIVE]):
        i = t.active[a]
        row = t.state[i, ROW]
        if uncalibrated[row]:
            flags |= UNCALIBRATED
        if t.memory[i, SINKAGE] > deepest[row]:
            flags |= DEEP
    return flags
