"""What every step of a selection is made with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rollover.diagnosis.fit.jobs import Executor, R, T, Task
from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Groups, Phases

Progress = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class Inquiry:
    """What every step of a selection is made with: recordings, effects, what is held out in turn, and who works."""

    problem: Problem
    candidates: Sequence[Candidate]
    groups: Groups
    phases: Phases
    say: Progress
    executor: Executor

    def free(self, current: Fitted) -> list[Candidate]:
        """Candidates that an explanation does not hold yet."""
        used = {c.key for c in current.candidates}
        return [c for c in self.candidates if c.key not in used]

    def fits(self, tasks: Sequence[Task]) -> list[Fitted | None]:
        """What comes of jobs, in their order."""
        return self.executor.fits(self.problem, tasks, self.say)

    def parallel_map(self, look: Callable[[Problem, T], R], things: Sequence[T]) -> list[R]:
        """What a look at each thing tells, in their order; see `Executor.parallel_map`."""
        return self.executor.parallel_map(self.problem, look, things)
