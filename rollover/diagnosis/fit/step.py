"""What a selection is made with, and its steps: the effect added to a base, and the candidates that competed for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from rollover.diagnosis.data.phases import Phases
from rollover.diagnosis.fit.cross_validation import Groups, cross_validated, cross_validated_by_refits, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.tasks import ParallelMap, Progress, R, T, Task, serial_map
from rollover.diagnosis.settings import SETTINGS


@dataclass(frozen=True, kw_only=True)
class Screened:
    """A candidate screened on a few recordings: the best starts, the chi2 there, the gain of its best direction.

    `nrmse` is what a first fit leaves over the noise, 0 where there was none.
    """

    candidate: Candidate
    starts: tuple[tuple[float, ...], ...]
    chi2: float
    potential: float
    nrmse: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Step:
    """One effect added to a base: the best, its p-value (of the best of all by chance), and all that competed."""

    base: Fitted
    fitted: Fitted
    p_value: float
    rivals: tuple[Fitted, ...] = ()
    screened: tuple[Screened, ...] = ()

    def again(self, problem: Problem) -> Step:
        """The same under the problem's present noise model."""
        return self._each(problem.again)

    def cross_validated(
        self, problem: Problem, groups: Groups, parallel_map: ParallelMap[Problem] = serial_map
    ) -> Step:
        """The same with held-out predictions by refits, where slopes do not hold for long.

        Of drops those of its best, and of what explains half as much: slopes at an end of a range may dismiss it.
        """
        if problem.effort.is_ensemble:
            return self._each(lambda f: cross_validated(problem, f, groups))
        without = held_out(self.base, groups).total
        step = self.moved_to(cross_validated_by_refits(problem, self.fitted, groups, without, parallel_map))
        least = SETTINGS.report.grades.half_share * (step.base.chi2 - step.fitted.chi2)

        def again(f: Fitted) -> Fitted:
            competes = f is not step.fitted and step.base.chi2 - f.chi2 > least
            return cross_validated_by_refits(problem, f, groups, parallel_map=parallel_map) if competes else f

        return replace(step, rivals=tuple(again(f) for f in step.rivals))

    def _each(self, made: Callable[[Fitted], Fitted]) -> Step:
        """The same with something made of each fit; its best stays one of its rivals."""
        rivals = tuple(made(f) for f in self.rivals)
        best = next((new for new, old in zip(rivals, self.rivals, strict=True) if old is self.fitted), None)
        return replace(self, base=made(self.base), fitted=best or made(self.fitted), rivals=rivals)

    def moved_to(self, new: Fitted) -> Step:
        """The same with another fit of its best, among the rivals too."""
        return replace(self, fitted=new, rivals=tuple(new if f is self.fitted else f for f in self.rivals))


class TaskRunner(Protocol):
    """What works off fits and maps; `jobs.Executor` does."""

    def fits(self, problem: Problem, tasks: Sequence[Task], say: Progress = ...) -> list[Fitted | None]:
        """Fits in the order of the tasks; None where nothing could be simulated."""

    def parallel_map(self, problem: Problem, function: Callable[[Problem, T], R], items: Sequence[T], /) -> list[R]:
        """`function(problem, item)` of each, in their order."""


@dataclass(frozen=True, kw_only=True)
class Inquiry:
    """What every step of a selection is made with: problem, candidates, groups held out in turn, and the executor.

    `known` are fits of single effects under another noise.
    """

    problem: Problem
    candidates: Sequence[Candidate]
    groups: Groups
    phases: Phases
    say: Progress
    executor: TaskRunner
    known: Sequence[Fitted] = ()

    def free(self, current: Fitted) -> list[Candidate]:
        """Candidates that an explanation does not hold yet."""
        used = {c.key for c in current.candidates}
        return [c for c in self.candidates if c.key not in used]

    def fits(self, tasks: Sequence[Task]) -> list[Fitted | None]:
        """Fits of tasks, in their order; None where nothing could be simulated."""
        return self.executor.fits(self.problem, tasks, self.say)

    def parallel_map(self, function: Callable[[Problem, T], R], items: Sequence[T]) -> list[R]:
        """`function(problem, item)` of each, in their order; see `Executor.parallel_map`."""
        return self.executor.parallel_map(self.problem, function, items)
