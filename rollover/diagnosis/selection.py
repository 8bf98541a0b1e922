"""From the scenario as it is to an explanation: effects added one by one, and the verdict that they bear."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rollover.diagnosis.candidates import Candidate
from rollover.diagnosis.detect import Mismatch, mismatch_of
from rollover.diagnosis.explain import CHANCE, MOST, NEGLIGIBLE, Step, moves, step
from rollover.diagnosis.fit import Fitted, Judge
from rollover.diagnosis.holdout import held_out
from rollover.diagnosis.verdict import Verdict

SURE = 1e-3  # p-value below which there is a mismatch
EXPLAINED = 1.2  # held-out misfit over the noise that counts as explained
NOISE_ITSELF = 1.05  # held-out misfit that no further effect can better
PARTLY = 0.05  # of the excess over the noise that an explanation may leave and still be named


class Steps:
    """The steps of a selection, and what was looked at in its first."""

    def __init__(self, taken: Sequence[Step], tried: Sequence[Step]) -> None:
        self.taken, self.tried = list(taken), list(tried)

    @property
    def looked(self) -> Step | None:
        """The first step, taken or not."""
        return self.tried[0] if self.tried else None


def selected(
    judge: Judge,
    base: Fitted,
    candidates: Sequence[Candidate],
    groups: Sequence[Sequence[int]],
    phases: Sequence[Sequence[tuple[float, str]]],
    say: Callable[[str], None],
) -> tuple[Steps, Fitted]:
    """Forward selection: up to three effects, each beyond chance, until nothing but noise is left."""
    taken: list[Step] = []
    tried: list[Step] = []
    current = base
    for _ in range(MOST):
        used = {c.key for c in current.candidates} | {c.id for c in current.candidates if c.channel is None}
        found = step(judge, current, [c for c in candidates if c.key not in used and c.id not in used], groups, say)
        tried.append(found)
        if found.p_value > CHANCE or moves(judge, current, found.fitted) < NEGLIGIBLE:
            break
        taken.append(found)
        current = found.fitted
        if held_out(current, groups).total < NOISE_ITSELF:
            break
        left = mismatch_of(judge.evidence, current.blocks, phases)
        if left.p_value > SURE or not matters(judge, current, left):
            break
    return Steps(taken, tried), current


def decided(
    judge: Judge, base: Fitted, before: Mismatch, steps: Steps, groups: Sequence[Sequence[int]]
) -> tuple[Steps, Fitted, Verdict]:
    """The verdict; what does not explain is not named, and of several effects only those that are needed."""
    start = held_out(base, groups).total
    for count in range(len(steps.taken), 0, -1):
        fitted = steps.taken[count - 1].fitted
        end = held_out(fitted, groups).total
        if end < EXPLAINED or end**2 - 1.0 < PARTLY * (start**2 - 1.0):
            # the fewest that explain as well
            for fewer in range(1, count):
                earlier = held_out(steps.taken[fewer - 1].fitted, groups).total
                if earlier < max(1.02 * end, NOISE_ITSELF):
                    count, fitted = fewer, steps.taken[fewer - 1].fitted
                    break
            kind = strongest(judge, base, fitted).kind
            verdict: Verdict = (
                "missing-physics" if kind == "physics" else "parameter" if kind == "parameter" else "sensor"
            )
            return Steps(steps.taken[:count], steps.tried), fitted, verdict
    significant = before.p_value < SURE and matters(judge, base, before)
    return Steps([], steps.tried), base, "unexplained" if significant or steps.taken else "no-mismatch"


def strongest(judge: Judge, base: Fitted, fitted: Fitted) -> Candidate:
    """The effect without which most would be left."""
    best, loss = fitted.candidates[0], -np.inf
    for k, c in enumerate(fitted.candidates):
        rest = tuple(o for j, o in enumerate(fitted.candidates) if j != k)
        if not rest:
            return c
        x, at = [], 0
        for o in fitted.candidates:
            if o is not c:
                x += list(fitted.x[at : at + len(o.search)])
            at += len(o.search)
        without = judge.fit(rest, x, rounds=4)
        left = without.left if without is not None else base.left
        if left > loss:
            best, loss = c, left
    return best


def matters(judge: Judge, base: Fitted, before: Mismatch) -> bool:
    """Whether the structure of the misfit is worth a word: beyond a share of a channel's range."""
    most = 0.0
    for r, block in enumerate(base.blocks):
        for signal, _ in judge.evidence[r].spans():
            cells = [c for c in before.cells if c.recording == r and c.channel == signal.channel]
            power = sum(c.structured - c.waves for c in cells) / max(sum(c.rows.size for c in cells), 1)
            most = max(most, float(np.sqrt(max(power, 0.0))) * signal.sigma / signal.span)
        del block
    return most > NEGLIGIBLE
