"""Compiled: forces on the bodies beyond ground, tyres and mounts, and the work that they take.

A row of `term_i` says kind and bodies, the same row of `term_f` its numbers. What a term holds as energy and the power
that it takes are kept for the start of the step and for now; the ledger books the difference and the mean.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ground.compiled import compiled
from rollover.tables import EXTRA_WORK, OMEGA, VEL, X

GUIDE_BRAKE, AIR_DRAG, BETWEEN, ROTOR = 0, 1, 2, 3  # kinds
HELD, POWER, HELD_NOW, POWER_NOW, TERM_MEMORY = 0, 1, 2, 3, 4  # columns of term_memory
TERM_NUMBERS = 5
CREEP = 0.005  # m/s: below it the friction of the guide is a dashpot, so that it has a value at rest


@compiled
def try_terms(t: Any, Q: Any) -> None:
    """Forces of all terms at the poses that were read last."""
    for i in range(t.term_i.shape[0]):
        kind, b, other = t.term_i[i]
        f, g, row = t.term_f[i], t.term_memory[i], t.pose[b]
        held, power = 0.0, 0.0
        if kind == GUIDE_BRAKE:
            v = row[VEL + 2]
            force = -f[0] * min(max(v / CREEP, -1.0), 1.0)
            Q[6 * b + 2] += force
            power = -force * v
        elif kind == AIR_DRAG:
            speed = np.sqrt(row[VEL] ** 2 + row[VEL + 1] ** 2 + row[VEL + 2] ** 2)
            for k in range(3):
                Q[6 * b + k] -= f[0] * speed * row[VEL + k]
            power = f[0] * speed**3
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
        g[HELD_NOW], g[POWER_NOW] = held, power


@compiled
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
        if kind == GUIDE_BRAKE and abs(t.pose[b, VEL + 2]) < CREEP:
            K[a, a] += fd * t.term_f[i, 0] / CREEP
        elif kind == BETWEEN:
            both, c = f * t.term_f[i, 0] + fd * t.term_f[i, 1], 6 * other + 2
            K[a, a] += both
            K[c, c] += both
            K[a, c] -= both
            K[c, a] -= both
