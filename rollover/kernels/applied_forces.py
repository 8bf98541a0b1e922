"""Compiled: work of the forces as the integrator applied them, for ground that the contacts glide over.

Generalised alpha does not apply the forces Q of the ends of a step, but with their accelerations a filtered one:

    (1 - alpha_m) A+ = (1 - alpha_f) Q+ + alpha_f Q - alpha_m A,     M (v+ - v) = h ((1 - gamma) A + gamma A+)

so that with a constant M the kinetic energy changes by h ((1 - gamma) A + gamma A+) . (v + v+)/2 exactly, for each of
several forces apart. The mean of Q and Q+ times the way is the same for a force that changes by little in a step; for
one that leaps by J it is off by some J v h, which is first order in the step at each leap.

Exudyn 1.13 predicts A+ with Q+ = 0 and, where Newton's iteration then fails, tries half the step with that as A.

`Tables.applied` holds for each account the generalised forces now and at the start of the step, and A.
"""

from __future__ import annotations

from typing import Any

from ground.compiled import leaf
from rollover.kernels.tables import FRICTION_WORK, SOIL

A_NORMAL, A_TANGENT, ACCOUNTS = 0, 1, 2
NOW, START, FILTERED, HISTORY = 0, 1, 2, 3


def coefficients(spectral_radius: float) -> tuple[float, float, float]:
    """alpha_m, alpha_f and gamma of generalised alpha (Chung and Hulbert 1993)."""
    alpha_m = (2.0 * spectral_radius - 1.0) / (spectral_radius + 1.0)
    alpha_f = spectral_radius / (spectral_radius + 1.0)
    return alpha_m, alpha_f, 0.5 + alpha_f - alpha_m


@leaf
def finish_applied(t: Any, h: float, qd: Any) -> None:
    """Book the work of the step's forces on its mean velocity; `qd` (n,) is that at its end, before any impact."""
    alpha_m, alpha_f, gamma = t.scheme[0], t.scheme[1], t.scheme[2]
    for k in range(ACCOUNTS):
        q, work = t.applied[k], 0.0
        for _ in range(int(t.clock[2])):
            for j in range(q.shape[1]):
                q[FILTERED, j] = (alpha_f * q[START, j] - alpha_m * q[FILTERED, j]) / (1.0 - alpha_m)
        for j in range(q.shape[1]):
            if h > 0.0:
                after = ((1.0 - alpha_f) * q[NOW, j] + alpha_f * q[START, j] - alpha_m * q[FILTERED, j]) / (
                    1.0 - alpha_m
                )
                work += ((1.0 - gamma) * q[FILTERED, j] + gamma * after) * 0.5 * (t.velocity[j] + qd[j])
                q[FILTERED, j] = after
            else:
                q[FILTERED, j] = q[NOW, j]  # the start
            q[START, j], q[NOW, j] = q[NOW, j], 0.0
        t.work[SOIL if k == A_NORMAL else FRICTION_WORK] -= h * work
