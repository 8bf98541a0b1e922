"""Forward selection: which effect, then which second and third, each admitted only if it beats the best of chance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.effort import DROPS
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.gate import freed, null_of_the_best, p_value
from rollover.diagnosis.holdout import held_out, worse
from rollover.effects import EFFECTS

Array = NDArray[np.float64]
CHANCE = 0.01  # p-value of the best of all candidates that admits one
NEGLIGIBLE = 0.004  # of a channel's range: an effect that moves nothing by more is not named
MOST = 3  # effects in one explanation
VISIBLE = 5.0  # standard errors of the noise at which an effect shows
WITHIN = 6.0  # times what the best leaves, up to which a first fit is followed up
FAR = 3.0  # misfit over the noise from which on time shifts fitted to it are not believed
ELSEWHERE = 0.2  # of a coordinate: starts so far apart are two
NOISE_LEFT = 1.01  # misfit over the noise that needs no further search
CROOKED = 100.0  # times what the best leaves, up to which a fit of two parameters is polished
APART = 2.0  # standard errors beyond which a rival is excluded

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Screened:
    """A candidate looked at on a few recordings: the best starts, what is left there, the gain of its best direction.

    `size` is the strength that would show; `nrmse` what a first fit leaves over the noise, 0 where there was none.
    """

    candidate: Candidate
    starts: tuple[tuple[float, ...], ...]
    left: float
    potential: float
    size: float
    nrmse: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step of the selection: what was added, the p-value of its gain, and all that competed, best first."""

    fitted: Fitted
    p_value: float
    rivals: tuple[Fitted, ...]
    screened: tuple[Screened, ...]
    detectable: tuple[tuple[str, float], ...] = field(default=(), repr=False)


def spread(base: Fitted, groups: Sequence[Sequence[int]], few: int = DROPS.few) -> list[int]:
    """Few recordings that stand for all: of the conditions that are met worst, best, and in the middle."""
    left = [b.normal()[2] / b.residual.size for b in base.blocks]
    members = [max(g, key=lambda r: left[r]) for g in groups if g]
    members.sort(key=lambda r: left[r])
    if len(members) <= few:
        return sorted(set(members)) if len(groups) > 1 else list(range(len(base.blocks)))[:few]
    return sorted({members[round(k * (len(members) - 1) / (few - 1))] for k in range(few)})


def begun(judge: Judge, base: Fitted) -> list[float]:
    """Time shifts (s) to begin with: where the base is far off its shifts are bent by what is missing."""
    count = sum(b.residual.size for b in base.blocks)
    if base.left < FAR**2 * count:
        return [b.shift for b in base.blocks]
    return [
        b.shift if e.recording.clock.zero == "unknown" else 0.0
        for b, e in zip(base.blocks, judge.evidence, strict=True)
    ]


def screen(
    judge: Judge, base: Fitted, candidates: Sequence[Candidate], few: Sequence[int]
) -> tuple[list[Screened], list[Array]]:
    """Look at each candidate in some places beside the base; returns them and all directions for the null."""
    found = []
    directions: list[list[Array]] = [[] for _ in few]
    shifts = begun(judge, base)
    beside = [judge.block(r, base.candidates, base.x, shifts[r], 0.0) for r in few]
    if any(b is None for b in beside):
        return [], []
    blocks = [b for b in beside if b is not None]
    for c in candidates:
        met: list[tuple[float, tuple[float, ...]]] = []
        potential, smallest = 0.0, np.inf
        for start in c.starts():
            left, along, size = 0.0, 0.0, 0.0
            kept = []
            for r, block in zip(few, blocks, strict=True):
                there = judge.block(r, (*base.candidates, c), (*base.x, *start), shifts[r], 0.0)
                if there is None:
                    break
                left += there.normal()[2]
                free = freed(np.column_stack([block.residual - there.residual, block.residual]), block)
                kept.append(free[:, :1])
                along += float(free[:, 0] @ free[:, 1])
                size += float(free[:, 0] @ free[:, 0])
            if len(kept) < len(blocks):
                continue
            if size > 1e-12:
                potential = max(potential, along * along / size)
                smallest = min(smallest, _visible(c, start, size * len(base.blocks) / len(few)))
                for k, d in enumerate(kept):
                    directions[k].append(d)
            met.append((left, start))
        if met:
            met.sort()
            found.append(Screened(candidate=c, starts=_apart(met), left=met[0][0], potential=potential, size=smallest))
    return found, [np.concatenate(d, axis=1) if d else np.zeros((0, 0)) for d in directions]


def _apart(met: Sequence[tuple[float, tuple[float, ...]]]) -> tuple[tuple[float, ...], ...]:
    """The best start, and of two parameters the best one that is not beside it."""
    best = met[0][1]
    if len(best) < 2:
        return (best,)
    other = [s for _, s in met if max(abs(a - b) for a, b in zip(s, best, strict=True)) > ELSEWHERE]
    return (best, *other[:1])


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
    few = spread(base, groups, judge.effort.few)
    screened, directions = screen(judge, base, candidates, few)
    null = null_of_the_best(directions)
    count = sum(b.residual.size for b in base.blocks)
    if judge.effort.thrifty and (p := p_value(max((s.potential for s in screened), default=0.0), null)) > CHANCE:
        return Step(fitted=base, p_value=p, rivals=(), screened=tuple(screened), detectable=_detectable(screened))
    screened, begun_with = _first_fits(judge, base, screened, few, say)
    fits = []
    for first in begun_with:
        say(f"fitting {first.candidates[-1].key}")
        fitted = judge.fit(first.candidates, first.x, shifts=_all_shifts(judge, base, first, few), width=1)
        if fitted is not None:
            fits.append(fitted)
    if not fits:
        return Step(fitted=base, p_value=1.0, rivals=(), screened=tuple(screened))
    fits.sort(key=lambda f: f.left)
    # where a threshold makes the way crooked, the nearer ones are followed to the end
    if fits[0].left > NOISE_LEFT**2 * count:
        near = [f for f in fits if len(f.candidates[-1].search) > 1 and f.left < CROOKED * fits[0].left]
        near = near[: judge.effort.polishes]
        fits = [judge.polish(f) if f in near else f for f in fits]
    fits = _one_each(fits)
    fits.sort(key=lambda f: held_out(f, groups).left.sum())
    best = fits[0]
    gain = base.left - min(f.left for f in fits)
    phi = max(1.0, min(f.left for f in fits) / count)  # what even the best leaves is no chance of the noise's size
    return Step(
        fitted=best,
        p_value=p_value(gain / phi, null),
        rivals=tuple(fits),
        screened=tuple(screened),
        detectable=_detectable(screened),
    )


def _detectable(screened: Sequence[Screened]) -> tuple[tuple[str, float], ...]:
    return tuple((s.candidate.key, s.size) for s in screened if np.isfinite(s.size))


def _first_fits(
    judge: Judge, base: Fitted, screened: Sequence[Screened], few: Sequence[int], say: Progress
) -> tuple[list[Screened], list[Fitted]]:
    """Short fits to few recordings: the ones worth a full fit, best first, and what each leaves."""
    by_potential = sorted(screened, key=lambda s: -s.potential)[: judge.effort.promising]
    by_start = sorted(screened, key=lambda s: s.left)[: judge.effort.promising // 2]
    chosen = {s.candidate.key: s for s in (*by_start, *by_potential)}
    shifts = begun(judge, base)
    fits: list[Fitted] = []
    told: dict[str, float] = {}
    say(f"first fits of {len(chosen)} candidates to {len(few)} recordings")
    for key, s in chosen.items():
        for start in s.starts:
            one = judge.fit(
                (*base.candidates, s.candidate), (*base.x, *start),
                rounds=judge.effort.short, only=few, shifts=[shifts[r] for r in few],
            )  # fmt: skip
            if one is not None:
                fits.append(one)
                size = sum(b.residual.size for b in one.blocks)
                told[key] = min(told.get(key, np.inf), float(np.sqrt(one.left / size)))
    fits.sort(key=lambda f: f.left)
    worth = [f for k, f in enumerate(fits) if k < judge.effort.leaders or f.left < WITHIN * fits[0].left]
    worth = worth[: judge.effort.most_leaders]
    return [replace(s, nrmse=told.get(s.candidate.key, 0.0)) for s in screened], worth


def _all_shifts(judge: Judge, base: Fitted, first: Fitted, few: Sequence[int]) -> list[float]:
    """Time shifts of all recordings: as fitted where they are, elsewhere as begun with."""
    shifts = begun(judge, base)
    for r, block in zip(few, first.blocks, strict=True):
        shifts[r] = block.shift
    return shifts


def _one_each(fits: Sequence[Fitted]) -> list[Fitted]:
    """The best fit of each candidate."""
    best: dict[str, Fitted] = {}
    for f in sorted(fits, key=lambda f: f.left):
        best.setdefault(f.candidates[-1].key, f)
    return list(best.values())


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
