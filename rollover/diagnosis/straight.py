"""Whether one sensor reads a straight line of what is, as gain and offset say, or a curve."""

from __future__ import annotations

import numpy as np

from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.gate import freed

LINES = ("sensor-gain", "sensor-scale", "sensor-bias")
BENT = 16.0  # gain of a curve beside a line, of four standard errors


def is_a_curve(judge: Judge, fitted: Fitted) -> bool:
    """Whether effects that make a straight line of one channel leave a curve of it."""
    channels = {c.channel for c in fitted.candidates}
    is_a_line = len(channels) == 1 and all(c.id in LINES for c in fitted.candidates)
    return is_a_line and not judge.effort.thrifty and bow(judge, fitted, str(channels.pop())) > BENT


def bow(judge: Judge, fitted: Fitted, channel: str) -> float:
    """Gain of a term in the square of what a channel reads, beside all effects of a fit and the time shifts.

    Of noise alone it is chi-square of one degree of freedom: z = q'e/|q|, q the square, whitened, freed of the fit's
    own directions.
    """
    squares, misfits, held = [], [], []
    for r, block in enumerate(fitted.blocks):
        raw = judge.raw(r, fitted.candidates, fitted.x, block.shift)
        if raw is None:
            return 0.0
        e, square = judge.evidence[r], np.zeros_like(raw)
        for signal, part in e.spans():
            if signal.channel == channel:
                square[part] = (raw[part] / signal.span) ** 2
        own = np.column_stack([block.counted(e.whitened(square)), block.residual, block.J])
        own = freed(own, block)
        squares.append(own[:, 0])
        misfits.append(own[:, 1])
        held.append(own[:, 2:])
    q, misfit = np.concatenate(squares), np.concatenate(misfits)
    basis, _ = np.linalg.qr(np.concatenate(held))
    q, misfit = q - basis @ (basis.T @ q), misfit - basis @ (basis.T @ misfit)
    return float((q @ misfit) ** 2 / max(float(q @ q), 1e-300))
