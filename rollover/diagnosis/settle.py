"""What runs with the explanation itself scatter by, and the parameters that all of these neighbours ask for together.

Scatter is looked at first where the scenario is; where an effect changes what hits the ground it is another. With
neighbours y_k = y + d_k of the run at the fitted point, each recording's mean of them strays less than any one, and

    dx = A^-1 sum_r J_r'(w_r - mean_k d_rk)                                                                    (D8)

is the step to the least squares of the mean. A, J, w as in (D1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.blocks import GENTLE, Block, shift_of
from rollover.diagnosis.chaos import alike, course, weighted
from rollover.diagnosis.crew import linearised
from rollover.diagnosis.evidence import Evidence
from rollover.diagnosis.explain import Step
from rollover.diagnosis.fit import Fitted, Judge

Array = NDArray[np.float64]
SHARES = (1.0, 0.5, 1.5)  # of the way: where a run leaps from one course to another beside it
NEARLY = 1.15  # times the least misfit
FARTHEST = 0.15  # of a coordinate, that a mean may move it


def settled(judge: Judge, part: Step) -> Step:
    """A step under the scatter of runs with its explanation, moved to where the mean of them is met best (D8).

    As it was if nothing can be simulated there; where runs do not scatter too.
    """
    rescattered(judge, part.fitted)
    part = part.again(judge)
    old = part.fitted
    if not any(e.strays for e in judge.evidence):
        return part
    dx = np.clip(step_of_means(judge.evidence, old.blocks), -FARTHEST, FARTHEST)
    tried = [_at(judge, old, share * dx) for share in SHARES]
    new = min([old, *(f for f in tried if f is not None)], key=lambda f: f.left)
    # nearly as good, the whole way: the mean of runs is worth more than the one that happens to be there
    if tried[0] is not None and tried[0].left < NEARLY * new.left:
        new = tried[0]
    return part.moved_to(new)


def _at(judge: Judge, old: Fitted, dx: Array) -> Fitted | None:
    """A fit moved by dx; None if nothing can be simulated there."""
    x = [float(v) for v in np.clip(np.array(old.x) + dx, 0.0, 1.0)]
    shifts = [b.shift + shift_of(b, np.array(x) - np.array(old.x)) for b in old.blocks]
    return linearised(judge, old.candidates, x, range(len(shifts)), shifts)


def rescattered(judge: Judge, fitted: Fitted) -> None:
    """Weigh the recordings by what runs at a fitted point scatter by."""
    changes = judge.changes(fitted.candidates, fitted.x)
    evidence = []
    for e, block in zip(judge.evidence, fitted.blocks, strict=True):
        plain = replace(e, signals=tuple(replace(s, weight=None) for s in e.signals), strays=())
        evidence.append(weighted(plain, e.simulator.strays(changes, block.shift)))
    judge.weigh(evidence)


def left_of_means(judge: Judge, fitted: Fitted) -> tuple[float, float]:
    """Sum of squares that the mean of a fit's neighbours leaves, in all and before the blow alone.

    Under the noise and weights as they are held now. One run meets a recording well or badly by chance; the mean of
    seven much less so.
    """
    changes = judge.changes(fitted.candidates, fitted.x)
    total = before = 0.0
    for e, block in zip(judge.evidence, fitted.blocks, strict=True):
        strays = alike(e, e.simulator.strays(changes, block.shift), e.blow)
        raw = [d for d in (e.raw(stray) for stray in strays) if np.all(np.isfinite(d))]
        w = block.plain_residual
        if raw:
            w = w - e.eased(e.whitened(np.sum(raw, axis=0) / (1.0 + len(raw))))
        counts = course(e, w)
        more, w = (0.0, w) if counts is None else (counts.more, counts.samples * w)
        early = np.concatenate([e.recording.time[s.rows] < e.blow for s in e.signals])
        total += float(w @ w) + more + (block.shift / block.prior) ** 2
        before += float(w[early] @ w[early]) + (block.shift / block.prior) ** 2
    return total, before


def along(block: Block, e: Evidence, stray: Array) -> Array:
    """J'd of a deviation (n,), SI, with the recording's time shift taken out, (p,)."""
    d = block.counted(e.eased(e.whitened(stray)))
    return np.asarray(block.J.T @ d - (block.J.T @ block.slope) * float(block.slope @ d) / block.weight)


def step_of_means(evidence: Sequence[Evidence], blocks: Sequence[Block]) -> Array:
    """(D8), (p,)."""
    p = blocks[0].J.shape[1]
    A, b = GENTLE * np.eye(p), np.zeros(p)
    for e, block in zip(evidence, blocks, strict=True):
        Ar, br, _ = block.normal()
        A, b = A + Ar, b + br
        if e.strays:
            b = b - np.mean([along(block, e, stray) for stray in e.strays], axis=0)
    return np.asarray(np.linalg.solve(A, b))
