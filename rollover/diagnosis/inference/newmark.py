"""Compiled: what many forces do beside a way that is known, by Newmark's rule; alone, for its numbers are its own."""

from __future__ import annotations

from typing import Any

from ground.compiled import leaf


@leaf
def newmark_response(push: Any, k: Any, h: float, z: Any, v: Any, a: Any) -> None:
    """z'' = push - k z for each column of accelerations (n, m), by Newmark's rule; z and v begin as they are given."""
    for j in range(push.shape[1]):
        a[0, j] = push[0, j]
    for i in range(1, push.shape[0]):
        for j in range(push.shape[1]):
            ahead = z[i - 1, j] + h * v[i - 1, j] + 0.25 * h * h * a[i - 1, j]
            a[i, j] = (push[i, j] - k[i] * ahead) / (1.0 + 0.25 * h * h * k[i])
            z[i, j] = ahead + 0.25 * h * h * a[i, j]
            v[i, j] = v[i - 1, j] + 0.5 * h * (a[i - 1, j] + a[i, j])
