"""How much is simulated for an answer: a drop costs two milliseconds, a full run a hundred times that."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Limits of a search; the defaults are those for drops."""

    few: int = 3  # recordings that candidates are looked at on, and first fits are made to
    looked_at: int = 4  # recordings that decide whether there is anything, where each look costs a run
    shortlist: int = 7  # candidates that are looked at on all of these
    scored: int | None = None  # candidates looked at closer; none: as many as for drops, and all of two parameters
    promising: int = 14  # candidates that get a first fit at each step
    short: int = 6  # rounds of a first fit
    leaders: int = 4  # first fits that are followed up, at least
    most_leaders: int = 9  # and at most
    rounds: int = 14  # of a whole fit
    fd_steps: tuple[float, ...] = (2e-2, 5e-3, 1e-3)  # of a coordinate, for differences: wide first
    polishes: int = 2  # fits that are followed along a crooked valley
    wide: float = 0.0  # of a coordinate, to which a central difference may widen; 0: one-sided, as it is
    least: float = 0.0  # gain of a round below which a search narrows
    later: float = 5e-5  # s, by which a clock is moved to see what that does
    clocked: int = 0  # times that a trial's time shifts are moved to where they fit: reading a run again costs little
    is_ensemble: bool = False  # looks at few recordings, fits no shapes, and stops where nothing but noise is left

    @property
    def fine(self) -> float:
        """Of a coordinate, for differences where a fit has ended."""
        return self.fd_steps[:2][-1]


DROPS = Effort()
# runs with many contacts differ by chance beside what a parameter does: over a narrow step that is all of the slope
RUNS = Effort(
    few=2,
    scored=12,
    promising=4,
    short=2,
    leaders=2,
    most_leaders=3,
    rounds=6,
    fd_steps=(6e-2, 3e-2),
    wide=0.13,
    least=4.0,
    polishes=0,
    later=1e-3,  # from one row of a run to the next
    clocked=3,
    is_ensemble=True,
)
