"""Compiled: the cubic through values and rates at both ends of a step, and where it passes a level."""

from __future__ import annotations

from ground.compiled import inlined


@inlined
def between_ends(theta: float, h: float, u0: float, d0: float, u1: float, d1: float) -> float:
    """Cubic through values u and rates d at both ends of a step."""
    w = 1.0 - theta
    return (
        w * w * (1.0 + 2.0 * theta) * u0
        + theta * theta * (3.0 - 2.0 * theta) * u1
        + h * theta * w * (w * d0 - theta * d1)
    )


@inlined
def crossing(level: float, h: float, u0: float, d0: float, u1: float, d1: float) -> float:
    """Share of the step at which the cubic passes `level`, which lies between its ends."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (between_ends(middle, h, u0, d0, u1, d1) - level) * (u0 - level) > 0.0:
            low = middle
        else:
            high = middle
    return high
