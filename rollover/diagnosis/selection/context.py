"""What every step of a selection is made with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rollover.diagnosis.fit.jobs import Crew, Job, R, T
from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Judge
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Groups, Phases

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Inquiry:
    """What every step of a selection is made with: recordings, effects, what is held out in turn, and who works."""

    judge: Judge
    candidates: Sequence[Candidate]
    groups: Groups
    phases: Phases
    say: Progress
    crew: Crew

    def free(self, current: Fitted) -> list[Candidate]:
        """Candidates that an explanation does not hold yet."""
        used = {c.key for c in current.candidates}
        return [c for c in self.candidates if c.key not in used]

    def fits(self, jobs: Sequence[Job]) -> list[Fitted | None]:
        """What comes of jobs, in their order."""
        return self.crew.fits(self.judge, jobs, self.say)

    def looks(self, look: Callable[[Judge, T], R], things: Sequence[T]) -> list[R]:
        """What a look at each thing tells, in their order; see `Crew.looks`."""
        return self.crew.looks(self.judge, look, things)
