"""Compiled: how much higher what yields carries within a step that takes a time, after Cowper and Symonds."""

from __future__ import annotations

from ground.compiled import leaf


@leaf
def overstress(k: float, strength: float, speed: float, q: float, over: float, h: float) -> float:
    """Relative overstress x = (w'/speed)^(1/q) of a step of length h whose elastic trial lies `over` the yield.

    k h speed x^q + strength x = over: rising and convex, so that Newton's iteration from above never overshoots.
    """
    x = over / strength
    for _ in range(60):
        power = k * h * speed * x ** (q - 1.0)
        change = (power * x + strength * x - over) / (q * power + strength)
        x -= change
        if change <= 1e-14 * x:
            break
    return max(x, 0.0)
