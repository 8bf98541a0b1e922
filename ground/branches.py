"""Both branches of the law of Ye (2006) in recorded drops: K_b1 and the second branch of each, and their covariance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from ground.drops import Loading, correlated
from ground.law import REFERENCE_AREA

Array = NDArray[np.float64]
_FAR = 80.0  # of ln K_b1 and ln F_r: e^80 times the other's depth is still a number
_MOST_ROWS = 600  # of one drop in the fit; more are averaged in blocks


@dataclass(frozen=True, kw_only=True)
class Branches:
    """K_b1 and F_r of each drop and the common exponent, per reference area; x = [K_b1.., ln F_r.., n].

    What `known` denies is no number of the drops, whatever stands in `x`.
    """

    loads: tuple[Loading, ...]
    reference_depth: float  # z_r, m
    x: Array  # (2 d + 1,)
    covariance: Array
    known: NDArray[np.bool_]  # which of x the drops determine
    fitted: tuple[Array, ...]  # F over the rows of each drop, N, per reference area
    scale: tuple[float, ...]  # residual over stated noise, each drop

    @property
    def first(self) -> Array:
        """K_b1 of each drop, N/m."""
        return self.x[: len(self.loads)]

    @property
    def change(self) -> Array:
        """Sinkage at which each drop changes branch, m."""
        d, n = len(self.loads), self.x[-1]
        strength = np.exp(self.x[d : 2 * d]) * self.reference_depth ** -(1.0 + n)
        with np.errstate(all="ignore"):  # of what no row bounds
            return np.asarray((strength / self.first) ** (-1.0 / n))


def _exp(power: float) -> float:
    try:
        return math.exp(power)
    except OverflowError:
        return math.inf


def fit_branches(loads: Sequence[Loading]) -> Branches:
    """K_b1 and the second branch of every drop, the exponent shared."""
    d = len(loads)
    rows = [_thinned(load) for load in loads]
    z_r = 0.5 * float(np.median([load.depth.max() for load in loads]))
    root = [np.linalg.cholesky(load.covariance + 1e-18 * np.eye(len(load.covariance))) for load in loads]
    k = loads[0].shapes.shape[1]
    noise = np.array(
        [load.noise * REFERENCE_AREA / load.drop.area / math.sqrt(r[3]) for load, r in zip(loads, rows, strict=True)]
    )
    start = np.array([_start(z, y, z_r) for z, y, _, _ in rows])
    x0 = np.concatenate([start[:, 0], start[:, 1], [np.clip(np.median(start[:, 2]), -0.95, -0.02)], np.zeros(k * d)])

    def model(x: Array) -> tuple[list[Array], list[tuple[Array, NDArray[np.bool_], Array, Array]]]:
        forces, parts = [], []
        n = x[2 * d]
        for j, (z, _, shapes, _) in enumerate(rows):
            u = x[2 * d + 1 + k * j : 2 * d + 1 + k * (j + 1)]
            depth = np.maximum(z + shapes @ (root[j] @ u), 1e-9)
            with np.errstate(over="ignore", invalid="ignore"):  # a step too far is not finite, and is shortened
                first, second = _exp(x[j]) * depth, _exp(x[d + j]) * (depth / z_r) ** (1.0 + n)
            steep = first <= second
            force = np.where(steep, first, second)
            forces.append(force)
            parts.append((depth, steep, force, np.where(steep, force, (1.0 + n) * force) / depth))
        return forces, parts

    def residual(x: Array, sigma: Array) -> Array:
        forces, _ = model(x)
        return np.concatenate([*((r[1] - f) / s for r, f, s in zip(rows, forces, sigma, strict=True)), x[2 * d + 1 :]])

    def jacobian(x: Array, sigma: Array) -> Array:
        _, parts = model(x)
        J = np.zeros((sum(len(r[0]) for r in rows) + k * d, len(x)))
        at = 0
        for j, (depth, steep, force, slope) in enumerate(parts):
            to = at + len(depth)
            J[at:to, j] = -force * steep / sigma[j]
            J[at:to, d + j] = -force * ~steep / sigma[j]
            J[at:to, 2 * d] = -force * ~steep * np.log(depth / z_r) / sigma[j]
            J[at:to, 2 * d + 1 + k * j : 2 * d + 1 + k * (j + 1)] = (
                -(slope[:, None] * (rows[j][2] @ root[j])) / sigma[j]
            )
            at = to
        J[at:, 2 * d + 1 :] = np.eye(k * d)
        return J

    scale = np.ones(d)
    for _ in range(2):  # the second time with each drop's own misfit as its noise
        sigma = noise * scale
        done = least_squares(residual, x0, jac=jacobian, args=(sigma,), x_scale="jac", method="trf", max_nfev=200)
        forces, _ = model(done.x)
        x0 = done.x
        for j, (r, f) in enumerate(zip(rows, forces, strict=True)):
            left = r[1] - f
            scale[j] = math.sqrt(float(left @ left) / max(len(left) - 2.0 - k, 1.0) * correlated(left)) / noise[j]
    sigma = noise * scale
    information = jacobian(done.x, sigma)
    information = information.T @ information
    known = np.diag(information)[: 2 * d + 1] > 1.0  # ln K_b1 or ln F_r to better than a factor e
    kept = np.concatenate([known, np.ones(k * d, dtype=bool)])
    covariance = np.zeros((2 * d + 1, 2 * d + 1))
    inside = inverse(information[np.ix_(kept, kept)])[: known.sum(), : known.sum()]
    covariance[np.ix_(known, known)] = inside
    known = known & (np.diag(covariance) < 1.0)
    x = np.clip(done.x[: 2 * d + 1], -_FAR, _FAR)  # what no row bounds may have run away
    turn = np.ones(2 * d + 1)
    x[:d] = np.exp(x[:d])
    turn[:d] = x[:d]
    return Branches(
        loads=tuple(loads),
        reference_depth=z_r,
        x=x,
        covariance=covariance * np.outer(turn, turn),
        known=known,
        fitted=tuple(
            np.minimum(x[j] * load.depth, math.exp(x[d + j]) * (load.depth / z_r) ** (1.0 + x[-1]))
            for j, load in enumerate(loads)
        ),
        scale=tuple(scale.tolist()),
    )


def inverse(N: Array) -> Array:
    """Inverse of a positive semidefinite matrix whose rows have different units; what it does not see stays 0."""
    size = np.sqrt(np.maximum(np.diag(N), 1e-300))
    scaled = np.linalg.pinv(N / np.outer(size, size), rcond=1e-12, hermitian=True)
    return np.asarray(scaled / np.outer(size, size))


def _thinned(load: Loading) -> tuple[Array, Array, Array, int]:
    """Depth, force per reference area, shapes, and how many rows are averaged to one."""
    block = math.ceil(len(load.depth) / _MOST_ROWS)
    count = len(load.depth) // block * block

    def mean(a: Array) -> Array:
        return np.asarray(a[:count].reshape(-1, block, *a.shape[1:]).mean(axis=1))

    return mean(load.depth), mean(load.force) * REFERENCE_AREA / load.drop.area, mean(load.shapes), block


def _start(z: Array, y: Array, z_r: float) -> tuple[float, float, float]:
    """ln K_b1, ln F_r, n by the change point with the least squared error."""
    best = (math.inf, 0.0, 0.0, -0.5)
    for change in np.linspace(0.03, 0.7, 24) * z[-1]:
        low, high = (z <= change) & (z > 0.0), z > change
        if low.sum() < 3 or high.sum() < 5:
            continue
        first = max(float(z[low] @ y[low] / (z[low] @ z[low])), 1.0)
        A = np.stack([np.ones(high.sum()), np.log(z[high] / z_r)], axis=1)
        (level, power), *_ = np.linalg.lstsq(A, np.log(np.maximum(y[high], 1e-3 * np.abs(y).max())), rcond=None)
        error = np.sum((y - np.minimum(first * z, np.exp(level) * (z / z_r) ** power)) ** 2)
        if error < best[0]:
            best = (float(error), math.log(first), float(level), float(power) - 1.0)
    return best[1:]
