"""Regression of what drops show on eqs (4) and (5) of Ye (2006): values, 95 % intervals, and what stays unknown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from ground.branches import Branches, inverse
from ground.drops import UnusableDrop
from ground.ye import Ye2006

Array = NDArray[np.float64]

NAMES = (
    "speed_coefficient",
    "speed_exponent",
    "first_stiffness",
    "second_stiffness",
    "sinkage_exponent",
    "momentum_base",
)
_C, _P, _K0, _K, _N, _B = range(6)
_LACKING = (
    ("first", "from a rate that shows how force grows from first contact on"),
    ("second", "from a faster drop, that goes deeper"),
)
_EXPONENTS = np.linspace(0.5, 60.0, 120)  # p that are tried


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One coefficient of eqs (4), (5): value, 95 % interval (None: not bounded), where it comes from, and why."""

    name: str
    value: float
    low: float | None
    high: float | None
    origin: Literal["data", "kept", "neutral"]
    why: str = ""


class Regression:
    """Generalised least squares of (4) and (5) over all p; b = [r, k_0, ln k, n, ln b] with r = c v_max^p."""

    def __init__(self, branches: Branches, masses: Array) -> None:
        d = len(branches.loads)
        self.d, self.masses = d, masses
        self.speeds = np.array([load.drop.speed for load in branches.loads])
        self.top = float(self.speeds.max())
        self.products = masses * self.speeds / 100.0
        z_r = branches.reference_depth
        self.rows = np.flatnonzero(branches.known)
        self.y = branches.x.copy()
        self.y[d : 2 * d] -= math.log(1e3) + math.log(z_r)
        self.fixed = np.zeros((2 * d + 1, 5))
        self.fixed[:d, 1] = 1.0
        self.fixed[d : 2 * d, 2:] = np.stack([np.ones(d), np.full(d, math.log(1e3 * z_r)), self.products], axis=1)
        self.fixed[2 * d, 3] = 1.0
        self.first, self.second = branches.known[:d], branches.known[d : 2 * d]
        if not self.first.any() or not self.second.any():
            which, more = _LACKING[int(self.first.any())]
            raise UnusableDrop(
                f"{branches.loads[0].drop.name}: no drop shows the {which} branch; both are needed, {more}"
            )
        self.between = 0.0
        self.covariance = branches.covariance
        self.weights = self._weights(0.0)
        self._add_scatter()

    def design(self, p: float) -> Array:
        """Rows of x against b."""
        A = self.fixed.copy()
        A[: self.d, 0] = (self.speeds / self.top) ** p
        return A

    def solve(self, p: float, free: Sequence[int], held: Array) -> tuple[Array, Array, float]:
        """Best b for one p with the columns `free`, the others at `held`; covariance, chi^2. r is never negative."""
        A, y = self.design(p)[self.rows], self.y[self.rows] - self.design(p)[self.rows] @ held
        b, V = held.copy(), np.zeros((5, 5))
        columns = list(free)
        while True:
            N = A[:, columns].T @ self.weights @ A[:, columns]
            within = inverse(N)
            part = within @ (A[:, columns].T @ self.weights @ y)
            if 0 in columns and part[columns.index(0)] < 0.0:
                columns.remove(0)
                continue
            break
        b[columns] += part
        V[np.ix_(columns, columns)] = within
        left = y - A[:, columns] @ part
        return b, V, float(left @ self.weights @ left)

    def _weights(self, tau: float) -> Array:
        V = self.covariance.copy()
        d = self.d
        V[np.arange(d), np.arange(d)] += (tau * self.y[:d]) ** 2
        V[np.arange(d, 2 * d), np.arange(d, 2 * d)] += tau**2
        return inverse(V[np.ix_(self.rows, self.rows)])

    def _add_scatter(self) -> None:
        """Scatter between drops, where chi^2 is beyond chance (5 %): what makes it equal its degrees of freedom."""
        free, held = self._free()
        self.freedom = len(self.rows) - len(free) - (0 in free)
        self.quantile = 1.959964

        def misfit() -> float:
            return min(self.solve(p, free, held)[2] for p in _EXPONENTS[::4])

        if self.freedom < 1 or misfit() <= chdtri(self.freedom, 0.05):
            return
        low, high = 0.0, 2.0
        for _ in range(25):
            self.between = 0.5 * (low + high)
            self.weights = self._weights(self.between)
            low, high = (self.between, high) if misfit() > self.freedom else (low, self.between)
        self.quantile = float(stdtrit(self.freedom, 0.975))

    def _free(self) -> tuple[list[int], Array]:
        """Columns that the conditions of the drops can tell apart at all."""
        held = np.zeros(5)
        free = [1, 2, 3]
        if np.ptp(self.speeds[self.first]) > 0.02 * self.top:
            free.insert(0, 0)
        if np.ptp(self.products[self.second]) > 0.02 * self.products.max():
            free.append(4)
        return free, held

    def coefficients(self, keep: bool) -> tuple[tuple[Coefficient, ...], Array]:
        """All six with intervals, and their covariance."""
        free, held = self._free()
        paper = Ye2006()
        why = [""] * 6
        origin: list[Literal["data", "kept", "neutral"]] = ["data"] * 6
        other: Literal["kept", "neutral"] = "kept" if keep else "neutral"
        if 4 not in free:
            held[4] = math.log(paper.momentum_base) if keep else 0.0
            origin[_B], why[_B] = other, "all drops have the same m v"
        scan = _Scan(self, free, held) if 0 in free else None
        exponents = scan.exponent if scan else (None, None)
        if scan is None or exponents[0] is None or exponents[1] is None or scan.rise_low <= 0.0:
            origin[_P] = origin[_C] = other
            steepest = float(self.speeds[self.first].max())
            why[_P] = f"K_b1 of drops up to {steepest:g} m/s does not show a curve"
            why[_C] = "only together with speed_exponent"
            p = paper.speed_exponent if keep else 1.0
            if keep or scan is None or scan.rise_low <= 0.0:
                free = [f for f in free if f != 0]
                held[0] = paper.speed_coefficient * self.top**p if keep else 0.0
            exponent = p
        else:
            exponent = scan.best
        b, V, _ = self.solve(exponent, free, held)
        value = np.array([b[0] / self.top**exponent, exponent, b[1], math.exp(b[2]), b[3], math.exp(b[4])])
        bounds: list[tuple[float | None, float | None]] = [(None, None)] * 6
        if scan is not None:
            bounds[_C], bounds[_P] = scan.coefficient, exponents
        for name, column in ((_K0, 1), (_K, 2), (_N, 3), (_B, 4)):
            if column in free:
                whole = scan is not None and origin[_P] == "data"
                centre, half = b[column], self.quantile * math.sqrt(V[column, column])
                low, high = scan.bounds(column) if whole and scan is not None else (centre - half, centre + half)
                bounds[name] = (math.exp(low), math.exp(high)) if column in (2, 4) else (low, high)
        for name in (_K0, _K):
            low_, high_ = bounds[name]
            if origin[name] == "data" and (low_ is None or high_ is None or low_ <= 0 or high_ > 10.0 * low_):
                why[name] = "known to no better than a decade"
        found = tuple(
            Coefficient(
                name=name, value=float(value[i]), low=bounds[i][0], high=bounds[i][1], origin=origin[i], why=why[i]
            )
            for i, name in enumerate(NAMES)
        )
        return found, self._covariance(exponent, b, free, origin[_P] == "data")

    def _covariance(self, p: float, b: Array, free: Sequence[int], curved: bool) -> Array:
        """Of the coefficients themselves, by their derivatives at the estimate."""
        A = self.design(p)
        ratio = self.speeds / self.top
        bend = np.zeros(len(A))
        bend[: self.d] = b[0] * ratio**p * np.log(ratio)
        columns = [*free, 5] if curved else list(free)
        J = np.column_stack([A, bend])[self.rows][:, columns]
        V = np.zeros((6, 6))
        V[np.ix_(columns, columns)] = inverse(J.T @ self.weights @ J)
        T = np.zeros((6, 6))  # of NAMES against [r, k_0, ln k, n, ln b, p]
        T[_C, 0], T[_C, 5] = self.top**-p, -math.log(self.top) * b[0] * self.top**-p
        T[_P, 5], T[_K0, 1], T[_K, 2], T[_N, 3], T[_B, 4] = 1.0, 1.0, math.exp(b[2]), 1.0, math.exp(b[4])
        return np.asarray(T @ V @ T.T)


class _Scan:
    """Profile likelihood over p: for each p the best of all else, and how far each may go."""

    def __init__(self, table: Regression, free: Sequence[int], held: Array) -> None:
        grid = _EXPONENTS
        for _ in range(2):  # coarse, then fine where it matters
            solved = [table.solve(float(p), free, held) for p in grid]
            chi = np.array([s[2] for s in solved])
            inside = grid[chi - chi.min() <= table.quantile**2 * 1.5]
            if inside[-1] - inside[0] > 20.0:
                break
            step = grid[1] - grid[0]
            grid = np.linspace(max(inside[0] - step, _EXPONENTS[0]), min(inside[-1] + step, _EXPONENTS[-1]), 200)
        self.grid, self.top = grid, table.top
        self.b, self.V = np.array([s[0] for s in solved]), np.array([s[1] for s in solved])
        self.slack = table.quantile**2 - (chi - chi.min())
        self.best = float(grid[np.argmin(chi)])
        self.ok = self.slack >= 0.0

    @property
    def exponent(self) -> tuple[float | None, float | None]:
        """Interval of p; None where it leaves what was tried."""
        inside = self.grid[self.ok]
        low, high = float(inside[0]), float(inside[-1])
        return (None if low <= _EXPONENTS[0] + 1e-9 else low), (None if high >= _EXPONENTS[-1] - 1e-9 else high)

    def bounds(self, column: int) -> tuple[float, float]:
        """Interval of one of b over all p."""
        half = np.sqrt(np.maximum(self.slack, 0.0) * self.V[:, column, column])[self.ok]
        centre = self.b[self.ok, column]
        return float((centre - half).min()), float((centre + half).max())

    @property
    def rise_low(self) -> float:
        """Least r = c v_max^p within the interval, N/m."""
        return self.bounds(0)[0]

    @property
    def coefficient(self) -> tuple[float | None, float | None]:
        """Interval of c = r v_max^-p."""
        half = np.sqrt(np.maximum(self.slack, 0.0) * self.V[:, 0, 0])
        low = np.maximum(self.b[:, 0] - half, 0.0)[self.ok] * self.top ** -self.grid[self.ok]
        high = (self.b[:, 0] + half)[self.ok] * self.top ** -self.grid[self.ok]
        bounded = None not in self.exponent
        return (float(low.min()) if bounded and low.min() > 0.0 else None), (float(high.max()) if bounded else None)
