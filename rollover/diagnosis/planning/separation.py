"""How far an effect stays from a rival that is refitted to it, over several recordings, in noise units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, without_shift_direction
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.planning.planned import showing
from rollover.diagnosis.planning.strength import choice, scaled
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.planning


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
        self._shown: dict[tuple[str, tuple[float, ...]], tuple[Problem, float] | None] = {}

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

    def recorded(self, c: Candidate, x: tuple[float, ...]) -> tuple[Problem, float] | None:
        """The recordings as they would be with an effect and without noise, and what nothing leaves of it there.

        None if it cannot be simulated.
        """
        key = (c.key, x)
        if key not in self._shown:
            raws = [self.problem.predicted_with_jumps(r, (c,), x, 0.0) for r in range(len(self.dataset))]
            made = [showing(e, raw) for e, raw in zip(self.dataset, raws, strict=True) if raw is not None]
            problem = Problem(made)
            unfitted = problem.fit((), (), rounds=TUNING.rounds) if len(made) == len(raws) else None
            self._shown[key] = None if unfitted is None else (problem, unfitted.total)
        return self._shown[key]

    def unexplained(self, c: Candidate, x: tuple[float, ...]) -> float:
        """Noncentrality of an effect beside nothing but clocks, gains and uncertain values; 0 if it cannot be made."""
        recorded = self.recorded(c, x)
        return 0.0 if recorded is None else recorded[1]

    def apart(self, c: Candidate, x: tuple[float, ...], rival: Candidate) -> Apart | None:
        """An effect at x through a rival that is refitted; None where the effect cannot be simulated.

        Secants from nothing say where the rival's fits begin, and are the answer where these are beyond doubt.
        """
        found = self.recorded(c, x)
        if found is None:
            return None
        recorded, far = found
        nearest = self._nearest(c, x, rival)
        if not nearest or nearest[0][0] > TUNING.beyond_doubt:
            least = min([far, *(chi2 for chi2, _ in nearest)])
            x_rival = nearest[0][1] if nearest else ()
        else:
            fits = [
                recorded.fit((rival,), point, rounds=TUNING.rounds, width=1) for _, point in nearest[: TUNING.starts]
            ]
            best = min((f for f in fits if f is not None), key=lambda f: f.total, default=None)
            if best is not None:  # noise-free, a search ends where a round gains less than noise would hide: too early
                ended = recorded.fit((rival,), best.x, rounds=TUNING.rounds, finely=True)
                best = best if ended is None else min(best, ended, key=lambda f: f.total)
            least, x_rival = (far, ()) if best is None else (min(best.total, far), best.x)
        return Apart(noncentrality=least, probability=choice(least, far), x=x_rival)

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
