"""A law that data propose: up to three terms of a fixed table, each a force times a shape without dimension.

With x = z/z_0 the depth, u = v/v_0 the rate and w = v_s/v_0 the speed of the touch, over scales of depth and speed,

    F += sum_i c_i T_i(x, u, w),   c in N on the reference face,

so that every coefficient is the force of its term at the scales themselves and can be judged at a glance.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ground.compiled import force_law, leaf
from ground.law import SPEED

Array = NDArray[np.float64]
MOST = 3  # terms of a law
WIDTH = 0.15  # of a bump, of the scale


class Term(NamedTuple):
    """A shape: how it is written with z, v, v_s over their scales, what it depends on, and its numbers a, b, c, at.

    T = x^a u^b w^c without `at`; a hinge max(x - at, 0) for a = 1, a bump exp(-((x - at)/0.15)^2) for a = 2, the same
    in u for b.
    """

    text: str
    on: str
    a: float = 0.0
    b: float = 0.0
    c: float = 0.0
    at: float = -1.0


def _powers() -> dict[str, Term]:
    found = {"1": Term("1", "nothing but contact")}
    depth = {0.25: "z^(1/4)", 0.5: "z^(1/2)", 1.0: "z", 2.0: "z^2", 3.0: "z^3"}
    speed = {0.5: "v^(1/2)", 1.0: "v", 2.0: "v^2", 3.0: "v^3"}
    found |= {text: Term(text, "depth", a=a) for a, text in depth.items()}
    found |= {text: Term(text, "speed", b=b) for b, text in speed.items()}
    for a in (0.5, 1.0):
        for b in (1.0, 2.0):
            text = f"{depth[a]} {speed[b]}"
            found[text] = Term(text, "depth and speed", a=a, b=b)
    found["v_s"] = Term("v_s", "impact speed", c=1.0)
    for a in (0.25, 0.5, 1.0):
        found[f"{depth[a]} v_s"] = Term(f"{depth[a]} v_s", "depth and impact speed", a=a, c=1.0)
    return found


def _local() -> dict[str, Term]:
    found = {}
    for at in (0.2, 0.4, 0.6, 0.8):
        found[f"(z - {at})+"] = Term(f"(z - {at})+", "depth", a=1.0, at=at)
    for at in (0.0, 0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0):
        found[f"bump(z at {at})"] = Term(f"bump(z at {at})", "depth", a=2.0, at=at)
    for at in (0.1, 0.25, 0.4, 0.55, 0.7, 0.85, 1.0):
        found[f"bump(v at {at})"] = Term(f"bump(v at {at})", "speed", b=2.0, at=at)
    return found


TERMS: dict[str, Term] = _powers() | _local()
NUMBERS = np.array([[t.a, t.b, t.c, t.at] for t in TERMS.values()])


def shape(name: str, x: Array, u: Array, w: Array) -> Array:
    """T of a term (n,) over x = z/z_0, u = v/v_0, w = v_s/v_0, (n,) each; 0 where x is not above 0 or u below 0."""
    number = list(TERMS).index(name)
    return np.array([_shape(NUMBERS[number], *one) for one in zip(x, u, w, strict=True)])


@leaf
def _shape(number: Any, x: float, u: float, w: float) -> float:
    a, b, c, at = number[0], number[1], number[2], number[3]
    if x <= 0.0:
        return 0.0
    if at >= 0.0:
        y = x if a > 0.0 else u
        if max(a, b) > 1.5:
            return math.exp(-(((y - at) / WIDTH) ** 2))
        return max(y - at, 0.0)  # type: ignore[no-any-return]
    return x**a * max(u, 0.0) ** b * max(w, 0.0) ** c  # type: ignore[no-any-return]


@force_law
def empirical(p: Any, s: Any, z: float, v: float) -> float:
    """N on the reference face: p holds three pairs of a term's number and its coefficient, then z_0 and v_0."""
    f = 0.0
    for i in range(MOST):
        if p[2 * i + 1] != 0.0:
            f += p[2 * i + 1] * _shape(NUMBERS[int(p[2 * i])], z / p[6], v / p[7], s[SPEED] / p[7])
    return f


__all__ = ["MOST", "TERMS", "Term", "empirical", "shape"]
