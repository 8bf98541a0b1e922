"""Is there any mismatch at all, and where: smooth structure of the whitened residual against its own roughness.

For a cell (recording, channel, phase) the residual w, its time shift and a slow basis of K cosines Q (orthonormal, the
shift's slope taken out): F = (|Q'w|^2/K)/((|w|^2 - |Q'w|^2)/(n - K - 1)) has an F distribution if w is nothing but
noise, whatever the noise's level. Cells are judged together by the sum of all, and each by Holm's step-down rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.chaos import is_other, too_many
from rollover.diagnosis.colour import hums
from rollover.diagnosis.evidence import Evidence
from rollover.diagnosis.fit import Block
from rollover.diagnosis.lines import basis as line

Array = NDArray[np.float64]
LOUD = 4.0  # times the noise's power, above which what is rough is no noise
MOST_WAVES = 12  # of the slow basis of a cell


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One recording, channel and phase: rows of the stack, its p-value (alone), and its excess over the noise."""

    recording: int
    channel: str
    phase: str
    start: float
    end: float
    rows: NDArray[np.int64]
    p_value: float
    excess: float
    structured: float
    waves: int
    rough: float


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """All cells, the p-value of "nothing but noise", and the familywise p-values of the cells."""

    cells: tuple[Cell, ...]
    p_value: float
    adjusted: tuple[float, ...]

    @property
    def structure(self) -> float:
        """Sum of squares of what is slow, beyond what chance leaves of it."""
        return sum(c.structured - c.waves for c in self.cells)

    def shares(self) -> list[tuple[Cell, float]]:
        """Cells with their share of all excess, largest first; shares add up to 1 (or there are none)."""
        total = sum(max(c.excess, 0.0) for c in self.cells)
        if total <= 0.0:
            return []
        found = [(c, max(c.excess, 0.0) / total) for c in self.cells]
        return sorted(found, key=lambda pair: -pair[1])


def mismatch_of(
    evidence: Sequence[Evidence], blocks: Sequence[Block], phases: Sequence[Sequence[tuple[float, str]]]
) -> Mismatch:
    """Judge the residuals at a fitted point; `phases` are (start, name) for each recording."""
    from scipy.stats import f as f_distribution

    cells: list[Cell] = []
    humming = hums(evidence, [b.valued for b in blocks])
    for r, (e, block) in enumerate(zip(evidence, blocks, strict=True)):
        for signal, part in e.spans():
            time = e.recording.time[signal.rows]
            for k, (start, name) in enumerate(phases[r]):
                end = phases[r][k + 1][0] if k + 1 < len(phases[r]) else np.inf
                inside = np.flatnonzero((time >= start) & (time < end))
                if inside.size >= 4:
                    rows = inside + part.start
                    weight = None if signal.weight is None else signal.weight[inside]
                    cells.append(
                        _cell(r, signal.channel, name, time[inside], rows, block, humming[signal.channel], weight)
                    )
    # after a blow a recording that took another course tells nothing by itself
    other = [is_other(b.course) for b in blocks]
    telling = [c for c in cells if not (other[c.recording] and c.start >= evidence[c.recording].blow)]
    # within half a step of its digits a channel tells nothing, however alike neighbouring samples err
    stepped = {(r, s.channel) for r, e in enumerate(evidence) for s in e.signals if s.step > 0.0}
    telling = [c for c in telling if c.excess > 0.0 or (c.recording, c.channel) not in stepped]
    structured = sum(c.structured for c in telling)
    waves = sum(c.waves for c in telling)
    rough = sum(c.rough for c in telling)
    count = sum(c.rows.size for c in telling) - waves - len(blocks)
    p = 1.0
    if waves and count > 0:
        # noise may be underrated, but not by so much: what is rough and far beyond it is no noise either
        p = float(f_distribution.sf((structured / waves) / min(max(rough / count, 1e-300), LOUD), waves, count))
    p = min(p, too_many(sum(other), len(other)))  # one may, not all of them
    return Mismatch(cells=tuple(cells), p_value=p, adjusted=_holm([c.p_value for c in cells]))


def _cell(
    r: int,
    channel: str,
    phase: str,
    time: Array,
    rows: NDArray[np.int64],
    block: Block,
    humming: tuple[float, ...],
    weight: Array | None,
) -> Cell:
    from scipy.stats import f as f_distribution

    w, s = block.valued[rows], block.slope[rows]
    n = rows.size
    waves = int(min(MOST_WAVES, max(1, n // 6)))
    phase_of = (np.arange(n) + 0.5) / n
    basis = np.cos(np.pi * phase_of[:, None] * np.arange(waves))
    heard = tuple(f for f in humming if f * (time[-1] - time[0]) > 1.0 and n > waves + 4 * len(humming))
    if heard:
        basis = np.hstack([basis, line(time, heard)])
        waves += 2 * len(heard)
    taken = s[:, None] / np.sqrt(block.weight)
    # what the recording's own time shift explains is no structure
    basis = basis - taken @ (taken.T @ basis)
    Q, _ = np.linalg.qr(basis)
    inside = Q.T @ w
    structured, rough = float(inside @ inside), float(w @ w - inside @ inside)
    free = max(n - waves - 1, 1)
    if weight is not None:
        rough = max(rough, float(n - waves))  # where the model is not sure, what is rough says nothing of what is slow
    p = (
        float(f_distribution.sf((structured / waves) / max(rough / free, 1e-300), waves, free))
        if n > waves + 1
        else 1.0
    )
    noise = n if weight is None else float(weight @ weight)
    return Cell(
        recording=r, channel=channel, phase=phase, start=float(time[0]), end=float(time[-1]), rows=rows, p_value=p,
        excess=float(w @ w) - noise, structured=structured, waves=waves, rough=max(rough, 0.0),
    )  # fmt: skip


def _holm(p: Sequence[float]) -> tuple[float, ...]:
    """Holm's adjusted p-values."""
    order = np.argsort(p)
    adjusted = np.ones(len(p))
    worst = 0.0
    for rank, k in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - rank) * p[k]))
        adjusted[k] = worst
    return tuple(float(v) for v in adjusted)
