"""95 % intervals of fitted parameters: the curvature of the misfit, and what a small error of the model would do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.blocks import Block
from rollover.diagnosis.candidates import physical
from rollover.diagnosis.evidence import MODEL_ERROR
from rollover.diagnosis.fit import GENTLE, Fitted, Judge
from rollover.diagnosis.verdict import Interval
from rollover.effects import EFFECTS, units_of

Array = NDArray[np.float64]
TWO_SIDED = 1.96
STUDENT = 2.6  # (t/1.96)^2 of Student's t for three neighbours: their scatter is itself an estimate


def without_one(blocks: Sequence[Block]) -> Array:
    """Standard errors (p,) from fits that each leave one recording out, as wide as so few recordings make them.

    sd^2 = (k - 1)/k sum_r (dx_r - mean dx)^2 (Tukey's jackknife), times (t/1.96)^2, t Student's 97.5 % quantile for
    k - 1: what recordings disagree by, whatever makes them. Nothing is known of that from a single recording: 0.
    """
    from scipy.stats import t

    k, p = len(blocks), blocks[0].J.shape[1]
    if k < 2:
        return np.zeros(p)
    normals = [b.normal()[:2] for b in blocks]
    A, b = sum(n[0] for n in normals) + GENTLE * np.eye(p), sum(n[1] for n in normals)
    dx = np.array([np.linalg.solve(A - n[0], b - n[1]) for n in normals])
    wide = float(t.ppf(0.975, k - 1)) / TWO_SIDED
    return np.asarray(wide * np.sqrt((k - 1) / k * np.sum((dx - dx.mean(axis=0)) ** 2, axis=0)))


def intervals(judge: Judge, fitted: Fitted) -> list[dict[str, Interval]]:
    """For each effect, its parameters with 95 % intervals.

    cov = phi A^-1, phi the misfit left per sample (at least 1); beside it, in quadrature, what a gain error of the
    model of `MODEL_ERROR` in any one channel would do, A^-1 J'(error): integrators differ, noise or not. Where runs
    that nobody could tell apart scatter, so do the parameters that would be fitted to them; there the disagreement of
    the recordings counts where it is larger (`without_one`).
    """
    p = len(fitted.x)
    A = sum((b.normal()[0] for b in fitted.blocks), np.zeros((p, p))) + GENTLE * np.eye(p)
    inverse = np.linalg.inv(A)
    count = sum(b.residual.size for b in fitted.blocks)
    phi = max(1.0, fitted.left / count) * judge.per_error
    sd = np.sqrt(np.maximum(phi * np.diag(inverse), 0.0))
    moved = np.zeros(p)
    channels = {s.channel for e in judge.evidence for s in e.signals}
    for channel in channels:
        pull = np.zeros(p)
        for r, block in enumerate(fitted.blocks):
            for signal, part in judge.evidence[r].spans():
                if signal.channel == channel:
                    y = (judge.measured[r] - block.residual)[part]
                    pull += block.J[part].T @ (MODEL_ERROR * y)
        moved += (inverse @ pull) ** 2
    for e, block in zip(judge.evidence, fitted.blocks, strict=True):
        for stray in e.strays:
            moved += STUDENT / len(e.strays) * (inverse @ (block.J.T @ e.whitened(stray))) ** 2
    # a fit that ended before it was at rest is off by what the next step would have been
    moved += (inverse @ sum((b.normal()[1] for b in fitted.blocks), np.zeros(p))) ** 2
    sd = np.sqrt(sd**2 + moved)
    if p and any(e.strays for e in judge.evidence):
        sd = np.maximum(sd, without_one(fitted.blocks))
    found, at = [], 0
    for c in fitted.candidates:
        kind: Any = EFFECTS[c.id]
        units = units_of(kind, c.channel)
        values: dict[str, Interval] = {}
        for name, search in c.search.items():
            x = fitted.x[at]
            values[name] = Interval(
                value=physical(x, search),
                low=physical(x - TWO_SIDED * sd[at], search),
                high=physical(x + TWO_SIDED * sd[at], search),
                unit=units.get(name, ""),
                at_bound=not 1e-6 < x < 1.0 - 1e-6,
            )
            at += 1
        found.append(values)
    return found
