"""Compiled: small dense linear algebra in plain loops.

The library's own routines would triple the time that the kernels take to compile, for matrices of 20 rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ground.compiled import compiled, inlined, leaf


@leaf
def solve_in_place(K: Any, B: Any) -> None:
    """B <- K^-1 B by Gaussian elimination with partial pivoting; K (n, n) is destroyed, B is (n, m)."""
    n, m = K.shape[0], B.shape[1]
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(K[r, c]) > abs(K[best, c]):
                best = r
        if best != c:
            for k in range(c, n):
                K[c, k], K[best, k] = K[best, k], K[c, k]
            for k in range(m):
                B[c, k], B[best, k] = B[best, k], B[c, k]
        for r in range(c + 1, n):
            factor = K[r, c] / K[c, c]
            if factor != 0.0:
                for k in range(c + 1, n):
                    K[r, k] -= factor * K[c, k]
                for k in range(m):
                    B[r, k] -= factor * B[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(m):
            total = B[c, k]
            for j in range(c + 1, n):
                total -= K[c, j] * B[j, k]
            B[c, k] = total / K[c, c]


@leaf
def factorise(A: Any, order: Any) -> bool:
    """Triangular factors of A (n, n) in place, rows exchanged as `order` (n,) says; False where A is singular."""
    n = A.shape[0]
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(A[r, c]) > abs(A[best, c]):
                best = r
        order[c] = best
        if not abs(A[best, c]) > 0.0:  # NaN is no pivot either
            return False
        if best != c:
            for k in range(n):
                A[c, k], A[best, k] = A[best, k], A[c, k]
        for r in range(c + 1, n):
            if A[r, c] != 0.0:
                A[r, c] /= A[c, c]
                for k in range(c + 1, n):
                    A[r, k] -= A[r, c] * A[c, k]
    return True


@leaf
def substitute(A: Any, order: Any, x: Any) -> None:
    """x (n,) <- A^-1 x with the factors of `factorise`."""
    n = A.shape[0]
    for c in range(n):
        x[c], x[order[c]] = x[order[c]], x[c]
        for k in range(c):
            x[c] -= A[c, k] * x[k]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            x[c] -= A[c, k] * x[k]
        x[c] /= A[c, c]


@compiled
def times(A: Any, x: Any) -> Any:
    """A x."""
    y = np.zeros(A.shape[0])
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            y[i] += A[i, k] * x[k]
    return y


@inlined
def dot(x: Any, y: Any) -> float:
    """x' y."""
    total = 0.0
    for k in range(x.shape[0]):
        total += x[k] * y[k]
    return total


@leaf
def add_outer(A: Any, factor: float, x: Any, at: int) -> None:
    """A += factor x x' on the block that starts at row and column `at`; x is (6,)."""
    for j in range(6):
        for k in range(6):
            A[at + j, at + k] += factor * x[j] * x[k]


@inlined
def norm(x: Any) -> float:
    """|x|."""
    return np.sqrt(dot(x, x))  # type: ignore[no-any-return]


@leaf
def largest(x: Any) -> float:
    """Largest |x_k|; NaN where one is."""
    most = 0.0
    for k in range(x.shape[0]):
        size = abs(x[k])
        if not size <= most:
            most = size  # of a NaN nothing is larger
            if size != size:
                break
    return most
