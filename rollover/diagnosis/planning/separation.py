"""How strong an effect must be for a test to show it, and how far it stays from a rival that is refitted to it.

Recordings whitened, y = s_A(t) + n. What stays of the effect A at strength t where a rival B and the instruments'
errors are refitted is d = (1 - P_B) s_A(t), and lambda = |d|^2 its noncentrality.

    detection  the gain of A over nothing is chi^2(k, lambda); seen if above the quantile of the false alarms    (P1)
    choice     of `choosing`                                                                              (P2), (P3)

Where samples lie about a jump, as at the first contact, is not known before a test: lambda and the choice are means
over where the jump may fall within a sampling step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, at_an_end, without_shift_direction
from rollover.diagnosis.fit.parameterisation import (
    Candidate,
    coordinate,
    coordinates,
    followed,
    is_limit,
    null_of,
    physical,
)
from rollover.diagnosis.planning.choosing import Tangent, choice, right_choice
from rollover.diagnosis.planning.planned import showing
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, units_of
from rollover.effects.effect import CHANNELS_OWN

Array = NDArray[np.float64]
TUNING = SETTINGS.planning
Coordinates = tuple[float, ...]
Shows = Callable[[Coordinates], float]


@dataclass(frozen=True, kw_only=True)
class Apart:
    """A true effect beside a rival: noncentrality, probability that the misfit chooses the true one, the rival's x."""

    noncentrality: float
    probability: float
    x: tuple[float, ...]


class Tests:
    """Planned recordings, and what effects would make of them; what was simulated is kept."""

    def __init__(self, dataset: Sequence[Dataset]) -> None:
        self.dataset = tuple(dataset)
        self.problem = Problem(self.dataset)
        self._moved: dict[tuple[str, tuple[float, ...]], Array | None] = {}
        self._phases: dict[tuple[int, str, tuple[float, ...]], tuple[Problem, Fitted] | None] = {}
        self._shown: dict[tuple[str, tuple[float, ...]], float | None] = {}

    @cached_property
    def _base(self) -> Fitted:
        """The scenario as it is, with the slopes of all clocks."""
        blocks = [self.problem.block(r, (), (), 0.0, 0.0) for r in range(len(self.dataset))]
        return Fitted(candidates=(), x=(), blocks=tuple(b for b in blocks if b is not None))

    def moved(self, c: Candidate, x: tuple[float, ...]) -> Array | None:
        """What an effect changes of all recordings, (n,), whitened and freed of clocks; None if it cannot be made."""
        key = (c.key, x)
        if key not in self._moved:
            parts = [self.problem.moved(r, ((), ()), ((c,), x), 0.0) for r in range(len(self.dataset))]
            self._moved[key] = (
                None
                if any(p is None for p in parts)
                else np.concatenate(
                    [
                        without_shift_direction(p[:, None], b)[:, 0]
                        for p, b in zip(parts, self._base.blocks, strict=True)
                        if p is not None
                    ]
                )
            )
        return self._moved[key]

    def _without_noise(self, c: Candidate, x: tuple[float, ...], shifts: Sequence[float]) -> Problem | None:
        """The recordings as they would be with an effect and so late; None if it cannot be simulated."""
        raws = [self.problem.predicted_with_jumps(r, (c,), x, shift) for r, shift in enumerate(shifts)]
        made = [showing(e, raw) for e, raw in zip(self.dataset, raws, strict=True) if raw is not None]
        return Problem(made) if len(made) == len(raws) else None

    def _left_by_nothing(self, c: Candidate, x: tuple[float, ...]) -> float | None:
        """What nothing leaves of an effect's recordings without noise; None if they cannot be simulated."""
        key = (c.key, x)
        if key not in self._shown:
            problem = self._without_noise(c, x, [0.0] * len(self.dataset))
            unfitted = None if problem is None else problem.fit((), (), rounds=TUNING.rounds)
            self._shown[key] = None if unfitted is None else unfitted.total
        return self._shown[key]

    def unexplained(self, c: Candidate, x: tuple[float, ...]) -> float:
        """Noncentrality of an effect beside nothing but clocks, gains and uncertain values; 0 if it cannot be made."""
        return self._left_by_nothing(c, x) or 0.0

    def apart(self, c: Candidate, x: tuple[float, ...], rival: Candidate) -> Apart | None:
        """An effect at x through a rival that is refitted; None where the effect cannot be simulated.

        Secants from nothing say where the rival's fits begin, and are the answer where these are beyond doubt.
        """
        far = self._left_by_nothing(c, x)
        if far is None:
            return None
        nearest = self._nearest(c, x, rival)
        if not nearest or nearest[0][0] > TUNING.certain_noncentrality:
            least = min([far, *(chi2 for chi2, _ in nearest)])
            return Apart(noncentrality=least, probability=choice(least, far), x=nearest[0][1] if nearest else ())
        starts, each = [point for _, point in nearest[: TUNING.starts]], []
        for phase in range(TUNING.phases):
            one = self._apart_at(phase, c, x, rival, starts)
            each += [] if one is None else [one]
            if one is not None and one.noncentrality > TUNING.beyond_doubt:
                break
        if not each:
            return Apart(noncentrality=far, probability=choice(far, far), x=())
        noncentrality, probability = (
            float(np.mean(v)) for v in zip(*((a.noncentrality, a.probability) for a in each), strict=True)
        )
        return Apart(noncentrality=noncentrality, probability=probability, x=each[0].x)

    def recorded_at(self, phase: int, c: Candidate, x: tuple[float, ...]) -> tuple[Problem, Fitted] | None:
        """Recordings whose jumps fall elsewhere within a sampling step, each elsewhere, and the effect's own fit."""
        key = (phase, c.key, x)
        if key not in self._phases:
            steps = [float(np.median(np.diff(e.recording.time))) for e in self.dataset]
            late = [((phase + r) % TUNING.phases + 0.5) / TUNING.phases - 0.5 for r in range(len(steps))]
            shifts = [f * step for f, step in zip(late, steps, strict=True)]
            self._phases[key] = None
            if (problem := self._without_noise(c, x, shifts)) is not None:
                problem.shifts = shifts
                own = problem.fit((c,), x, rounds=TUNING.rounds, finely=True)
                self._phases[key] = None if own is None else (problem, own)
        return self._phases[key]

    def _apart_at(
        self, phase: int, c: Candidate, x: tuple[float, ...], rival: Candidate, starts: Sequence[tuple[float, ...]]
    ) -> Apart | None:
        """The same at one phase of the samples; None where nothing can be fitted."""
        found = self.recorded_at(phase, c, x)
        if found is None:
            return None
        recorded, own = found
        fits = [recorded.fit((rival,), point, rounds=TUNING.rounds, width=1) for point in starts]
        best = min((f for f in fits if f is not None), key=lambda f: f.total, default=None)
        if best is None:
            return None
        # noise-free, a search ends where a round gains less than noise would hide: too early
        for shifts in (recorded.shifts, [b.shift for b in best.blocks]):
            ended = recorded.fit((rival,), best.x, rounds=TUNING.rounds, shifts=shifts, finely=True)
            best = best if ended is None else min(best, ended, key=lambda f: f.total)
        least = max(best.total - own.total, 0.0)
        (d, there), (_, here) = _without_clocks(best), _without_clocks(own)
        return Apart(noncentrality=least, probability=right_choice(least, d, here, there), x=best.x)

    def _nearest(self, c: Candidate, x: tuple[float, ...], rival: Candidate) -> list[tuple[float, tuple[float, ...]]]:
        """What the rival leaves of an effect along the secants to its places, the least first, and where these lead."""
        d = self.moved(c, x)
        if d is None:
            return []
        found = []
        for point in dict.fromkeys([*rival.starts(), *rival.scan_points()]):
            s = self.moved(rival, point)
            size = 0.0 if s is None else float(s @ s)
            if s is None or size <= 0.0:
                continue
            along = float(d @ s) / size
            there = scaled(rival, point, along)
            if there is None:  # nothing to scale from: the place itself
                found.append((float((d - s) @ (d - s)), point))
            else:
                found.append((float(d @ d) - along**2 * size, there))
        return sorted(found)


def _without_clocks(fitted: Fitted) -> tuple[Array, Tangent]:
    """What a fit leaves, (n,), and its slopes, freed of clocks."""
    both = np.concatenate([without_shift_direction(np.column_stack([b.residual, b.J]), b) for b in fitted.blocks])
    inwards = tuple((1 if v < 0.5 else -1) if at_an_end(v) else 0 for v in fitted.x)
    return both[:, 0], Tangent(slopes=both[:, 1:], inwards=inwards)


def usual(c: Candidate) -> Coordinates | None:
    """Coordinates of an effect as strong as it usually is; None where that depends on the channel alone."""
    kind: Any = EFFECTS[c.id]
    own = kind() if c.channel is None else kind(channel=c.channel)
    values = {name: getattr(own, name) for name in c.search}
    if any(units_of(kind)[name] == CHANNELS_OWN or value is None for name, value in values.items()):
        return None
    if any(c.search[name].scale == "log" and value <= 0.0 for name, value in values.items()):
        return None
    return coordinates(values, c.search)


def scaled(c: Candidate, x: Coordinates, factor: float) -> Coordinates | None:
    """`followed`, and the same of what has the scenario's own value for its zero; None where no value is known."""
    name, zero = null_of(c)
    if zero is None or EFFECTS[c.id].null.get(name) is not None:
        return followed(c, x, factor)
    search, at = c.search[name], list(c.search).index(name)
    value = zero + factor * (physical(x[at], search) - zero)
    inside = coordinate(min(max(value, search.low), search.high), search)
    return (*x[:at], inside, *x[at + 1 :])


def point_where_it_acts(c: Candidate, shows: Shows) -> Coordinates | None:
    """Its usual place, or the first of its starts that does anything in a test; None where none does."""
    own = usual(c)
    points = [*([] if own is None else [own]), *c.starts(), *c.scan_points()]
    return next((x for x in points if shows(x) > TUNING.nothing), None)


def strength_with(c: Candidate, at: Coordinates, shows: Shows, noncentrality: float) -> Coordinates | None:
    """Coordinates of the effect that has this noncentrality, from a place where it acts; None: its range ends before.

    What has a zero is made weaker or stronger by the root of what is asked for; of a limit the value itself is sought.
    """
    if scaled(c, at, 1.0) is None:
        return _limit_with(c, at, shows, noncentrality)
    low, high, x, factor = 0.0, math.inf, at, 1.0
    for _ in range(TUNING.approaches):
        found = shows(x)
        if abs(found / noncentrality - 1.0) < TUNING.close:
            return x
        low, high = (factor, high) if found < noncentrality else (low, factor)
        guess = factor * math.sqrt(noncentrality / max(found, 1e-6 * noncentrality))
        factor = guess if low < guess < high else math.sqrt(max(low, 1e-6 * high) * high) if high < math.inf else guess
        there = scaled(c, at, factor)
        if there is None or there == x:
            break
        x = there
    return x if shows(x) > noncentrality * (1.0 - TUNING.close) else None


def _limit_with(c: Candidate, at: Coordinates, shows: Shows, noncentrality: float) -> Coordinates | None:
    """The same for a limit, by halving: the lower, the stronger; others as at one of their starts that shows enough."""
    if not is_limit(c):
        return min((x for x in [at, *c.starts()] if shows(x) >= noncentrality), key=shows, default=None)
    low, high = 0.0, 1.0
    if shows((low, *at[1:])) < noncentrality:
        return None
    for _ in range(TUNING.approaches):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shows((middle, *at[1:])) >= noncentrality else (low, middle)
    return (low, *at[1:])


def of_one(false_alarm: float, many: int) -> float:
    """Size of each of `many` tests of which noise alone passes none but with `false_alarm` (Sidak)."""
    return -math.expm1(math.log1p(-false_alarm) / max(many, 1))


def detection(noncentrality: float, size: float, freedoms: int = 1) -> float:
    """(P1): probability that an effect of `freedoms` fitted numbers is seen by a test of this size."""
    from scipy.stats import chi2, ncx2

    return float(ncx2.sf(chi2.isf(size, freedoms), freedoms, noncentrality)) if noncentrality > 0.0 else size


def required_noncentrality(power: float, size: float, freedoms: int = 1) -> float:
    """Noncentrality at which (P1) is `power`; 0 where that is no more than the size."""
    from scipy.optimize import brentq

    if power <= size:
        return 0.0
    return float(brentq(lambda v: detection(v, size, freedoms) - power, 0.0, 1e4))
