"""Is there any mismatch at all, and where: smooth structure of the whitened residual against its own roughness.

For a cell (recording, channel, phase) the residual w, its time shift and a slow basis of K cosines Q (orthonormal, the
shift's slope taken out): F = (|Q'w|^2/K)/((|w|^2 - |Q'w|^2)/(n - K - 1)) has an F distribution if w is nothing but
noise, whatever the noise's level. Cells are judged together by the sum of all, and each by Holm's step-down rule.

Where runs scatter, samples are weighed (D3), and of S = |Q'w|^2 noise and scatter d alone leave

    M = tr(Q'W^2 Q) + mean_k |Q'd_k|^2                                                                          (D14)

d_k the deviations of the perturbed runs, each weighed by the scatter of the others, as the recording is; the first term
times what whitening leaves of slow noise (`Rest`). Where divergence after an impact is masked, both count
after it for what they would in a recording that differs by d_k (D9). S/M then has nu = 2 M^2/var S degrees of freedom,
var S from the noise, from noise and scatter together, and from how far the perturbed runs of a recording differ in all
its cells at once; so few runs limit how well M is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.noise.autoregression import Rest, line_spectra, rests
from rollover.diagnosis.noise.ensemble import (
    has_diverged,
    leave_one_out_scatter,
    p_value_of_divergence,
    shares,
)
from rollover.diagnosis.noise.spectral_lines import basis as line
from rollover.diagnosis.noise.spectral_lines import outlier_p_value
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.inference.lack_of_fit
ADEQUACY = SETTINGS.inference.adequacy


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
    noise_power: float
    noise: tuple[float, float]  # what noise alone leaves of `structured`, and of `noise_power`
    strayed: Array = field(default_factory=lambda: np.zeros((0, 2)))  # (k, 2): and each neighbour

    @property
    def expected(self) -> float:
        """(D14); as many as there are waves where runs do not scatter."""
        return self.noise[0] + (float(self.strayed[:, 0].mean()) if len(self.strayed) else 0.0)

    @property
    def rest(self) -> float:
        """The same of what is rough."""
        return self.noise[1] + (float(self.strayed[:, 1].mean()) if len(self.strayed) else 0.0)


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """All cells, the p-value of "nothing but noise", and the familywise p-values of the cells.

    `telling` are the cells that it is judged by: not those after an impact of a recording that took another trajectory.
    """

    cells: tuple[Cell, ...]
    telling: tuple[Cell, ...] = ()
    p_value: float
    adjusted: tuple[float, ...]

    @property
    def structure(self) -> float:
        """Sum of squares of what is slow, beyond what chance leaves of it."""
        return sum(c.structured - c.expected for c in self.cells)

    def shares(self) -> list[tuple[Cell, float]]:
        """Cells with their share of all excess, largest first; shares add up to 1 (or there are none)."""
        total = sum(max(c.excess, 0.0) for c in self.cells)
        if total <= 0.0:
            return []
        found = [(c, max(c.excess, 0.0) / total) for c in self.cells]
        return sorted(found, key=lambda pair: -pair[1])


def mismatch_of(
    dataset: Sequence[Dataset], blocks: Sequence[ResidualBlock], phases: Sequence[Sequence[tuple[float, str]]]
) -> Mismatch:
    """Lack-of-fit test of the residuals at a fitted point; `phases` are (start, name) for each recording."""
    cells: list[Cell] = []
    perturbed = [leave_one_out_scatter(e) for e in dataset]
    worth = [_worth(e, block, apart) for e, block, apart in zip(dataset, blocks, perturbed, strict=True)]
    humming, colours = line_spectra(dataset, [b.residual_for_squares for b in blocks]), rests(dataset)
    for r, (e, block) in enumerate(zip(dataset, blocks, strict=True)):
        for signal, part in e.spans():
            time = e.recording.time[signal.rows]
            for k, (start, name) in enumerate(phases[r]):
                end = phases[r][k + 1][0] if k + 1 < len(phases[r]) else np.inf
                inside = np.flatnonzero((time >= start) & (time < end))
                if inside.size >= 4:
                    rows = inside + part.start
                    line_spectrum, rest, due = humming[signal.channel], colours[r][signal.channel], None
                    if signal.weight is not None:
                        due = Expected(signal.weight[inside], rest, perturbed[r][:, rows], worth[r][:, rows])
                    cells.append(_cell(r, signal.channel, name, time[inside], rows, block, line_spectrum, due))
    # after an impact a recording that took another trajectory tells nothing by itself
    other = [has_diverged(b.heavy_tail) for b in blocks]
    telling = [c for c in cells if not (other[c.recording] and c.start >= dataset[c.recording].first_impact)]
    # within half a step of its digits a channel tells nothing, however alike neighbouring samples err
    stepped = {(r, s.channel) for r, e in enumerate(dataset) for s in e.signals if s.step > 0.0}
    telling = [c for c in telling if c.excess > 0.0 or (c.recording, c.channel) not in stepped]
    by_channel: dict[str, list[Array]] = {}
    for c in telling:
        by_channel.setdefault(c.channel, []).append(blocks[c.recording].residual_for_squares[c.rows])
    p = min(_p_value(telling, len(blocks)), outlier_p_value(np.concatenate(w) for w in by_channel.values()))
    sent = p_value_of_divergence(sum(other), len(other))
    p = (
        min(p, sent) if sent <= SETTINGS.noise.ensemble.divergence_p_value else p
    )  # one may, not all of them: whole numbers, and no p-value until they tell
    return Mismatch(cells=tuple(cells), telling=tuple(telling), p_value=p, adjusted=_holm([c.p_value for c in cells]))


class Expected(NamedTuple):
    """What a cell's misfit is held against where samples are weighed: weights (n,), the noise's spectrum, neighbours.

    By what these differ, whitened, (k, n), and what samples count with each, its root (k, n).
    """

    weight: Array
    rest: Rest
    perturbed: Array
    worth: Array

    def left(self, Q: Array, waves: int) -> tuple[tuple[float, float], Array]:
        """What noise leaves in the columns of `Q` (n, m) and beside them, and what each neighbour adds, (k, 2)."""
        slow, noise = float(np.sum((Q * self.weight[:, None]) ** 2)), float(self.weight @ self.weight)
        shape = float(np.mean(self.rest.at(np.arange(waves) / (2.0 * self.weight.size))))
        apart, fewer = self.worth * self.perturbed, (self.worth**2 - 1.0) * self.weight**2
        along = np.sum((apart @ Q) ** 2, axis=1) + shape * fewer @ np.sum(Q**2, axis=1)
        beside = np.sum(apart**2, axis=1) + np.sum(fewer, axis=1) - along
        return (shape * slow, noise - shape * slow), np.stack([along, beside], axis=1)


def _worth(e: Dataset, block: ResidualBlock, perturbed: Array) -> Array:
    """(k, n): roots of what samples count where a recording goes as one of the `perturbed` does."""
    if not block.masked:
        return np.ones(perturbed.shape)
    return np.where(e.early, 1.0, np.sqrt(shares(e, perturbed))[:, None])


def _p_value(cells: Sequence[Cell], time_shifts: int) -> float:
    """p-value of what is slow in several cells together, beside as many `time_shifts` that were fitted."""
    from scipy.special import fdtrc

    structured = sum(c.structured for c in cells)
    waves = sum(c.waves for c in cells)
    noise_power = sum(c.noise_power for c in cells)
    count = sum(c.rows.size for c in cells) - waves - time_shifts
    if not waves or count <= 0:
        return 1.0
    if all(c.noise[0] == c.waves for c in cells):
        # noise may be underrated, but not by so much: what is rough and far beyond it is no noise either
        return float(
            fdtrc(waves, count, (structured / waves) / min(max(noise_power / count, 1e-300), TUNING.most_dispersion))
        )
    expected = sum(c.expected for c in cells)
    variance = sum(2.0 * c.noise[0] * (1.0 + 2.0 * (c.expected - c.noise[0]) / c.waves) for c in cells)
    unsure = 2.0 * expected**2 / count
    for r in {c.recording for c in cells}:
        each = [c.strayed[:, 0] for c in cells if c.recording == r and len(c.strayed)]
        apart = np.sum(each, axis=0) if each else np.zeros(1)
        if apart.size > 1:
            scatter = SETTINGS.noise.ensemble.few_factor * float(np.var(apart, ddof=1))
            variance += scatter
            unsure += scatter / apart.size  # a mean is known as well as so many tell
    level = min(max(noise_power / max(sum(c.rest for c in cells), 1e-300), 1.0), TUNING.most_dispersion)
    known = 2.0 * expected**2 / unsure
    return float(fdtrc(2.0 * expected**2 / variance, known, structured / expected / level))


def _cell(
    r: int,
    channel: str,
    phase: str,
    time: Array,
    rows: NDArray[np.int64],
    block: ResidualBlock,
    humming: tuple[float, ...],
    due: Expected | None,
) -> Cell:
    from scipy.special import fdtrc

    w, s = block.residual_for_squares[rows], block.slope[rows]
    n = rows.size
    waves = int(min(TUNING.most_waves, max(1, n // 6)))
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
    structured, noise_power = float(inside @ inside), float(w @ w - inside @ inside)
    free = max(n - waves - 1, 1)
    found = Cell(
        recording=r, channel=channel, phase=phase, start=float(time[0]), end=float(time[-1]), rows=rows, p_value=1.0,
        excess=float(w @ w) - n, structured=structured, waves=waves, noise_power=max(noise_power, 0.0),
        noise=(float(waves), float(n - waves)),
    )  # fmt: skip
    if due is not None:
        noise, strayed = due.left(Q, waves)
        found = replace(found, noise=noise, strayed=strayed)
        excess = float(w @ w) - found.expected - found.rest
        return replace(found, excess=excess, p_value=_p_value([found], 1))
    if n <= waves + 1:
        return found
    return replace(found, p_value=float(fdtrc(waves, free, (structured / waves) / max(noise_power / free, 1e-300))))


def _holm(p: Sequence[float]) -> tuple[float, ...]:
    """Holm's adjusted p-values."""
    order = np.argsort(p)
    adjusted = np.ones(len(p))
    worst = 0.0
    for rank, k in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - rank) * p[k]))
        adjusted[k] = worst
    return tuple(float(v) for v in adjusted)


def is_enough(problem: Problem, fitted: Fitted, mismatch: Mismatch) -> bool:
    """Whether what a fit leaves is no more than chance, or not worth a word."""
    return mismatch.p_value > SETTINGS.inference.lack_of_fit.p_value or not matters(problem, fitted, mismatch)


def matters(problem: Problem, base: Fitted, before: Mismatch) -> bool:
    """Whether the structure of the misfit is worth a word: beyond a share of a channel's range."""
    most = 0.0
    for r, e in enumerate(problem.dataset[: len(base.blocks)]):
        for signal, part in e.spans():
            cells = [c for c in before.cells if c.recording == r and part.start <= c.rows[0] < part.stop]
            chance = sum(c.rows.size if e.model_error_dominates(signal) else c.expected for c in cells)
            power = (sum(c.structured for c in cells) - chance) / max(sum(c.rows.size for c in cells), 1)
            most = max(most, float(np.sqrt(max(power, 0.0))) * signal.sigma / signal.span)
    return most > ADEQUACY.negligible


def is_tolerated(problem: Problem, fitted: Fitted) -> bool:
    """Whether what is left is no more than a scatter between runs, or a tolerance that was asked for, leaves by chance.

    One error of unit size for each of k signals: a mean square of 1 with a standard deviation of sqrt(2/k).
    """
    dominated = [e.model_error_dominates(s) for e in problem.dataset for s in e.signals]
    most = 1.0 + 2.0 * np.sqrt(2.0 / len(dominated))
    return all(dominated) and bool(fitted.chi2 < most * sum(b.residual.size for b in fitted.blocks))
