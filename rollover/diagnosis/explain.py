"""Forward selection: which effect, then which second and third, each admitted only if it beats the best of chance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.gate import freed, null_of_the_best, p_value
from rollover.diagnosis.holdout import held_out, worse
from rollover.effects import EFFECTS

Array = NDArray[np.float64]
CHANCE = 0.01  # p-value of the best of all candidates that admits one
PROMISING = 14  # candidates fitted in full at each step
NEGLIGIBLE = 0.004  # of a channel's range: an effect that moves nothing by more is not named
MOST = 3  # effects in one explanation
VISIBLE = 5.0  # standard errors of the noise at which an effect shows
CROOKED = 100.0  # times what the best leaves, up to which a fit of two parameters is polished
APART = 2.0  # standard errors beyond which a rival is excluded

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Screened:
    """A candidate looked at: the best start, what is left there, and the largest gain of any of its directions."""

    candidate: Candidate
    start: tuple[float, ...]
    left: float
    potential: float
    size: float


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of the selection: what was added, the p-value of its gain, and all that competed, best first."""

    fitted: Fitted
    p_value: float
    rivals: tuple[Fitted, ...]
    screened: tuple[Screened, ...]
    detectable: tuple[tuple[str, float], ...] = field(default=(), repr=False)


def screen(judge: Judge, base: Fitted, candidates: Sequence[Candidate]) -> tuple[list[Screened], list[Array]]:
    """Look at each candidate in a few places beside the base; returns them and all directions for the null."""
    found = []
    directions: list[list[Array]] = [[] for _ in base.blocks]
    for c in candidates:
        best: tuple[float, tuple[float, ...]] | None = None
        potential, smallest = 0.0, np.inf
        for start in c.starts():
            left, along, size = 0.0, 0.0, 0.0
            kept = []
            for r, block in enumerate(base.blocks):
                y = judge.predicted(r, (*base.candidates, c), (*base.x, *start), block.shift)
                if y is None:
                    break
                # residual + d is what is left; d = prediction of the base less the candidate's
                d = block.residual - (judge.measured[r] - y)
                free = freed(np.column_stack([d, block.residual]), block)
                kept.append(free[:, :1])
                gained = free[:, 1] - free[:, 0]
                left += float(gained @ gained)
                along += float(free[:, 0] @ free[:, 1])
                size += float(free[:, 0] @ free[:, 0])
            if len(kept) < len(base.blocks):
                continue
            if size > 1e-12:
                potential = max(potential, along * along / size)
                if c.search:
                    smallest = min(smallest, _visible(c, start, size))
                for r, d in enumerate(kept):
                    directions[r].append(d)
            if best is None or left < best[0]:
                best = (left, start)
        if best is not None:
            found.append(Screened(candidate=c, start=best[1], left=best[0], potential=potential, size=smallest))
    return found, [np.concatenate(d, axis=1) if d else np.zeros((0, 0)) for d in directions]


def _visible(candidate: Candidate, start: Sequence[float], size: float) -> float:
    """Strength (first parameter) whose trace would be 5 times the noise's, by that at a start: |d| grows with it."""
    name, search = next(iter(candidate.search.items()))
    value = candidate.values(start)[name]
    null = EFFECTS[candidate.id].null.get(name)
    base = float(null) if isinstance(null, (int, float)) else 0.0
    del search
    return base + (value - base) * VISIBLE / float(np.sqrt(max(size, 1e-12)))


def step(
    judge: Judge, base: Fitted, candidates: Sequence[Candidate], groups: Sequence[Sequence[int]], say: Progress
) -> Step:
    """Fit the promising candidates beside the base and rank them by what they predict of held-out conditions."""
    say(f"looking at {len(candidates)} candidates beside {base.label}")
    screened, directions = screen(judge, base, candidates)
    null = null_of_the_best(directions)
    count = sum(b.residual.size for b in base.blocks)
    by_potential = sorted(screened, key=lambda s: -s.potential)[:PROMISING]
    by_start = sorted(screened, key=lambda s: s.left)[: PROMISING // 2]
    chosen = {s.candidate.key: s for s in (*by_potential, *by_start)}
    fits = []
    for s in chosen.values():
        say(f"fitting {s.candidate.key}")
        fitted = judge.fit((*base.candidates, s.candidate), (*base.x, *s.start))
        if fitted is not None:
            fits.append(fitted)
    if not fits:
        return Step(fitted=base, p_value=1.0, rivals=(), screened=tuple(screened))
    fits.sort(key=lambda f: f.left)
    # where a threshold makes the way crooked, the nearer ones are followed to the end
    near = [f for f in fits if len(f.candidates[-1].search) > 1 and f.left < CROOKED * fits[0].left][:5]
    fits = [judge.polish(f) if f in near else f for f in fits]
    fits.sort(key=lambda f: held_out(f, groups).left.sum())
    best = fits[0]
    gain = base.left - min(f.left for f in fits)
    phi = max(1.0, min(f.left for f in fits) / count)  # what even the best leaves is no chance of the noise's size
    detectable = tuple((s.candidate.key, s.size) for s in screened if np.isfinite(s.size))
    return Step(
        fitted=best,
        p_value=p_value(gain / phi, null),
        rivals=tuple(fits),
        screened=tuple(screened),
        detectable=detectable,
    )


def moves(judge: Judge, base: Fitted, fitted: Fitted) -> float:
    """How far the added effect moves any channel of any recording, largest root mean square over the range."""
    most = 0.0
    for r, (a, b) in enumerate(zip(base.blocks, fitted.blocks, strict=True)):
        for signal, part in judge.evidence[r].spans():
            d = (a.residual - b.residual)[part]
            most = max(most, float(np.sqrt(np.mean(d * d))) * signal.sigma / signal.span)
    return most


def confusion(base: Fitted, step_: Step, groups: Sequence[Sequence[int]]) -> list[Fitted]:
    """Rivals that predict held-out recordings as well as the best does, the best first."""
    best = step_.fitted
    found = [best]
    for rival in step_.rivals:
        explains = base.left - rival.left > 0.5 * (base.left - best.left)
        if rival is not best and explains and min(worse(rival, best, groups)) < APART:
            found.append(rival)
    return found
