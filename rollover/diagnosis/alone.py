"""One effect beside an estimated discrepancy: more of them would be bent to what no model has."""

from __future__ import annotations

from rollover.diagnosis.fit.levenberg_marquardt import Fitted, Problem
from rollover.diagnosis.fit.local_search import timed
from rollover.diagnosis.fit.step import Groups
from rollover.diagnosis.grades import shares
from rollover.diagnosis.inference.adequacy import is_tolerated
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.result import Verdict
from rollover.diagnosis.selection.context import Inquiry
from rollover.diagnosis.selection.decision import Explanation, kind_of
from rollover.diagnosis.selection.forward_step import confusion, step
from rollover.diagnosis.selection.scan import look
from rollover.diagnosis.selection.stepwise import as_conditioned
from rollover.diagnosis.settings import SETTINGS


def explained_by_one(inquiry: Inquiry, base: Fitted, *, usual: bool = True) -> Explanation:
    """The best single effect beside a discrepancy, if any can be fitted.

    Nothing where the discrepancy is enough and `usual`: a larger one may be what effects leave that are badly fitted.
    """
    problem, groups, phases = inquiry.problem, inquiry.groups, inquiry.phases
    base = timed(problem, base)
    before = mismatch_of(problem.dataset, base.blocks, phases)
    looked = look(problem, base, inquiry.candidates, groups, parallel_map=inquiry.executor.parallel_map)
    none = Explanation(
        base=base, fitted=base, parts=(), looked=looked, detectable=looked.detectable, before=before, after=before
    )
    first = None if usual and is_tolerated(problem, base) else step(inquiry, base, looked)
    if first is None:
        return none
    first, left = as_conditioned(problem, first, mismatch_of(problem.dataset, first.fitted.blocks, phases), phases)
    first = first.again(problem).cross_validated(problem, groups, inquiry.executor.parallel_map)
    return Explanation(
        base=first.base,
        fitted=first.fitted,
        parts=(first,),
        looked=looked,
        detectable=looked.detectable,
        before=before,
        after=left,
        first=first,
    )


def decided_beside(problem: Problem, found: Explanation, groups: Groups) -> tuple[Explanation, Verdict]:
    """The verdict on what one effect explains beside a discrepancy.

    It is named where it leaves no more than that, or surely explains half and its family is not to be mistaken.
    """
    if is_tolerated(problem, found.base):
        return found.refused(), "no-mismatch"
    if not found.parts or found.parts[0].p_value > SETTINGS.inference.lack_of_fit.p_value:
        return found.refused(), "unexplained"
    whole, _ = shares(problem, found, groups)
    families = {f.candidates[-1].family for f in confusion(found.parts[0], groups, problem.samples_per_error)}
    is_enough = (
        is_tolerated(problem, found.fitted) and whole is not None and whole.share >= SETTINGS.report.grades.half_share
    )
    is_sure = whole is not None and whole.low >= SETTINGS.report.grades.half_share and len(families) == 1
    if is_enough or is_sure:
        return found, kind_of(found.fitted.candidates[-1])
    return found.refused(), "unexplained"
