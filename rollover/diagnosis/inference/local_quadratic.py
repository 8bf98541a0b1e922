"""How far a parameter may lie where runs are rough: the mean of many runs beside a fit, not slopes at one.

Runs that scatter leave a misfit that differs from place to place by chance. The place that a fit ended at is the lowest
of all that were tried, and slopes J there are those of its dip: two runs side by side differ by their scatter too. At
t = +-1, +-2, ... on either side of it, 1 the half width of an interval by these slopes, what is left of recording r,
its time shift taken out, is met sample by sample by

    w_r(t) = u_r + v_r t + z_r t^2 + e_r(t), s_r^2 = sum |e_r|^2/(k - 3) of k places                           (R1)

with h = (X'X)^-1 of 1, t, t^2. Where c = sum_r |v_r|^2 - s_r^2 h_11 stands out of what scatter alone makes of |v|^2,
and J'v is but a share of J'J, the mean of runs is nearest to what was measured at

    m = -b/c, b = sum_r u_r'v_r - s_r^2 h_01                                                                   (R2)

and what was measured, one run more, moves m as the e of any place do: by a variance of

    (1 + h_00 + 2 m h_01 + m^2 h_11) sum_r mean (e_r'v_r)^2 / c^2                                              (R3)

with e and v at each place by all the others, and degrees of freedom by Satterthwaite (1946). Beside it stands what the
noise does: the misfit of the mean rises by what is due within sqrt(due/c). The fit itself tells nothing: it was chosen
for being low.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.fit.linearisation import ResidualBlock, total_of
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.local_quadratic

Runs = Callable[
    [Sequence[float]], Sequence[Sequence[ResidualBlock] | None]
]  # at places t; None where nothing can be simulated


def student_widening(free: float) -> float:
    """(t/1.96)^2: how much wider squares are, estimated with so few degrees of freedom."""
    from scipy.special import stdtrit

    return (float(stdtrit(free, 0.975)) / TUNING.normal_quantile) ** 2


def local_quadratic_extents(runs: Runs, slopes: Sequence[Array], due: float) -> tuple[float, float] | None:
    """How far (t, down and up) the mean of runs may be what was measured, by (R1) to (R3).

    `slopes` (n,) are those at the fit, of each recording by t, of samples that count in full. Nought both where they
    are surely right, for then they tell more. None where none is estimated: no slope stands out within the places that
    are looked at, more and more until one is estimated well.
    """
    met: list[tuple[float, Sequence[ResidualBlock]]] = []
    best = Slope(clear=0.0)
    for stage in TUNING.stages:
        points = [side * at for at in stage for side in (-1.0, 1.0)]
        met += [(at, blocks) for at, blocks in zip(points, runs(points), strict=True) if blocks is not None]
        if len(met) < TUNING.least_points:
            continue
        t = np.array([at for at, _ in met])
        nearest = [int(k) for k in np.argsort([total_of(blocks) for _, blocks in met])[: TUNING.least_points]]
        each = zip(*(blocks for _, blocks in met), strict=True)
        recordings = [_alike(blocks, nearest, J) for blocks, J in zip(each, slopes, strict=True)]
        squares = sum(np.sum(left**2, axis=1) for left, _ in recordings)
        # not the least: one run may take the recording's own trajectory
        low = np.sort(squares)[TUNING.least_points // 2 - 1]
        inliers = np.abs(squares - low) < TUNING.outlier_ratio * due * t**2 + TUNING.outlier_rise * due
        if np.sum(inliers) < TUNING.least_points:
            continue
        found = _slope(t[inliers], [(left[inliers], J) for left, J in recordings], due)
        if found.clear > TUNING.some_slope and found.flat < stage[-1]:
            best = found
            if found.clear > TUNING.clear_slope:
                break
    if best.share < TUNING.same_slope:
        return (best.down, best.up) if best.clear > TUNING.some_slope else None
    return (0.0, 0.0) if best.clear > TUNING.clear_slope else None


@dataclass(frozen=True, kw_only=True)
class Slope:
    """c over what scatter alone makes of it, J'v/J'J, sqrt(due/c), and how far down and up."""

    clear: float
    share: float = 0.0
    flat: float = np.inf
    down: float = 0.0
    up: float = 0.0


def _alike(blocks: Sequence[ResidualBlock], nearest: Sequence[int], slope: Array) -> tuple[Array, Array]:
    """What runs (k) leave of one recording (k, n + 1), and a slope (n + 1,), the time shift eliminated from both.

    Samples count at all places what they do in the middle of the nearest runs; the shift's part of (D1) is the last.
    """
    counts = np.median([blocks[k].counted(np.ones(slope.size)) for k in nearest], axis=0)
    late = np.append(counts * np.mean([blocks[k].unweighted_slope for k in nearest], axis=0), 1.0 / blocks[0].prior)
    left = np.array([np.append(counts * b.unweighted_residual, -b.shift / b.prior) for b in blocks])
    across = np.append(counts * slope, 0.0)
    size = float(late @ late)
    return left - np.outer(left @ late / size, late), across - late * float(late @ across) / size


def _slope(t: Array, recordings: Sequence[tuple[Array, Array]], due: float) -> Slope:
    """(R1) to (R3) of what is left (k, n) of each recording at places t, beside its slope (n,) at the fit."""
    X = np.stack([np.ones(t.size), t, t**2], axis=1)
    h = np.linalg.inv(X.T @ X)
    P = h @ X.T
    alone = 1.0 - np.sum(X * P.T, axis=1)  # of a deviation, what is left where its place is fitted too
    b = c = chance = along = steep = 0.0
    pulled = []
    for W, J in recordings:
        u, v, _ = P @ W
        e = W - X @ (P @ W)
        s2 = float(np.sum(e**2)) / (t.size - 3)
        b += float(u @ v) - s2 * h[0, 1]
        c += float(v @ v) - s2 * h[1, 1]
        chance += s2 * h[1, 1]
        along -= float(J @ v)
        steep += float(J @ J)
        e = e / alone[:, None]
        pulls = e @ v - P[1] * np.sum(e**2, axis=1)
        pulled.append(float(np.mean(pulls**2 * alone)))
    if c <= 0.0:
        return Slope(clear=0.0)
    middle, flat, whole = -b / c, float(np.sqrt(due / c)), sum(pulled)
    variance = (1.0 + h[0, 0] + 2.0 * middle * h[0, 1] + middle**2 * h[1, 1]) * whole / c**2
    if whole > 0.0:
        variance *= student_widening((t.size - 3) * whole**2 / sum(p**2 for p in pulled))
    half = float(np.hypot(flat, TUNING.normal_quantile * np.sqrt(variance)))
    share = along / steep if steep > 0.0 else 0.0
    clear = c / chance if chance > 0.0 else np.inf
    return Slope(clear=clear, share=share, flat=flat, down=half - middle, up=half + middle)
