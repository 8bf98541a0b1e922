"""What a selection comes to: an explanation and its effects, the strongest of them, and what kind each is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rollover.diagnosis.data.phases import Phases
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.local_search import (
    all_but_one,
    chi2_at,
    has_uncertain_conditions,
    refitted_with_conditions,
    without_effect,
)
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Step
from rollover.diagnosis.inference.lack_of_fit import Mismatch, is_enough, mismatch_of
from rollover.diagnosis.result import Verdict
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS

TUNING = SETTINGS.selection.decision


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """What was selected: the base, the fit (the base itself if nothing), a step for each of its effects.

    Each step's base is the fit without that effect, so that its rivals competed beside all the others. `first` is the
    first step, taken or not; `scored` the score test of all candidates beside the base; `detectable` the strength at
    which each would have shown, beside the explanation for those that are not in it.
    """

    base: Fitted
    fitted: Fitted
    parts: tuple[Step, ...]
    scored: ScoreTest
    detectable: Mapping[str, float]
    before: Mismatch
    after: Mismatch
    first: Step | None = None
    refuted: bool = False  # whether the best candidate's gain was not validated under the scatter of its own runs
    is_unique: bool = True  # False where the effects keep being exchanged for others as good

    def refused(self) -> Explanation:
        """The same with nothing held to be found."""
        return replace(self, parts=(), fitted=self.base, after=self.before)

    @property
    def p_value(self) -> float:
        """Of "nothing but noise": min over two tests of 1 - (1 - p)^(1/a), a their shares of all errors (Sidak).

        The omnibus test's p and the best candidate's, half each; where runs scatter nearly all is the first one's: the
        second is rarely small by chance there, as weights and neighbours lower every score. A candidate that was looked
        at closer and refuted tells nothing.
        """
        if self.refuted:
            return self.before.p_value
        share = TUNING.scan_share if any(b.expected is not None for b in self.base.blocks) else 0.5
        tests = ((self.before.p_value, 1.0 - share), (self.scored.p_value(), share))
        return float(min(-np.expm1(np.log1p(-min(p, TUNING.largest_p_value)) / a) for p, a in tests))


def kind_of(c: Candidate) -> Verdict:
    """The verdict on what an effect explains."""
    return "missing-physics" if c.kind == "physics" else "parameter" if c.kind == "parameter" else "sensor"


def strongest(problem: Problem, base: Fitted, fitted: Fitted) -> Candidate:
    """The effect without which most would be left; of full runs, where fits are dear, with the others as they stand."""
    best, loss = fitted.effects[0], -np.inf
    for k, c in enumerate(fitted.effects, fitted.first):
        if len(fitted.effects) == 1:
            return c
        if problem.effort.is_ensemble:
            others, columns = all_but_one(fitted, k)
            chi2 = chi2_at(problem, others, [fitted.x[at] for at in columns], [b.shift for b in fitted.blocks])
        else:
            rest = without_effect(problem, fitted, k, rounds=4)
            chi2 = rest.chi2 if rest is not None else None
        chi2 = base.chi2 if chi2 is None else chi2
        if chi2 > loss:
            best, loss = c, chi2
    return best


def with_conditions_refitted(
    problem: Problem, found: Step, mismatch: Mismatch, phases: Phases
) -> tuple[Step, Mismatch]:
    """A step and what it leaves; with the errors of the conditions as they act beside it if that leaves chance alone.

    Else these stay as they act on the scenario as it is: a wrong effect would bend them too.
    """
    if is_enough(problem, found.fitted, mismatch) or not has_uncertain_conditions(problem):
        return found, mismatch
    before = problem.dataset
    new = refitted_with_conditions(problem, found.fitted)
    there = mismatch_of(problem.dataset, new.blocks, phases)
    if is_enough(problem, new, there):
        return found.moved_to(new), there
    problem.with_noise_model(before)
    return found, mismatch
