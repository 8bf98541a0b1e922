"""What is predicted of recordings that were left out: by slopes, and by fits where these mislead."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rollover.diagnosis.fit.cross_validation import cross_validated_by_refits, held_out
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.step import Inquiry, Step
from rollover.diagnosis.fit.tasks import serial_map
from rollover.diagnosis.selection.forward_step import _refitted_where_slopes_mislead
from tests.diagnosis.drops import FORCE, recorded
from tests.diagnosis.test_fits import GAIN, candidate, problem_of


def test_held_out_data_are_predicted_by_refits_if_nonlinear() -> None:
    """Slopes a hundred times too flat send the fit without a recording far off: by 0.01 J'w/(0.01 |J|)^2."""
    problem = problem_of(recorded(GAIN, 12, speeds=(1.2, 2.2, 3.2)))
    fitted = problem.fit((candidate(problem, "sensor-gain:" + FORCE),), (0.5,))
    assert fitted is not None
    groups = [[0], [1], [2]]
    assert cross_validated_by_refits(problem, fitted, groups) is fitted
    pulled = [b.residual + 3.0 * b.J[:, 0] / np.linalg.norm(b.J) for b in fitted.blocks[1:]]
    misled = [replace(b, J=0.01 * b.J, residual=w) for b, w in zip(fitted.blocks[1:], pulled, strict=True)]
    flat = replace(fitted, blocks=(fitted.blocks[0], *misled))
    assert held_out(flat, groups).total > 2.0
    cross_validated = cross_validated_by_refits(problem, flat, groups)
    assert cross_validated.x == fitted.x
    assert held_out(cross_validated, groups).total == pytest.approx(held_out(fitted, groups).total, rel=0.01)
    assert cross_validated_by_refits(problem, flat, groups[:1]) is flat
    ahead = held_out(fitted, groups).total
    assert cross_validated_by_refits(problem, fitted, groups, ahead + 1e-6) is fitted
    again = cross_validated_by_refits(problem, fitted, groups, ahead - 1e-6)  # no better than without it, by its slopes
    assert again.cross_validated is not None
    assert held_out(again, groups).total == pytest.approx(ahead, rel=0.01)


def test_the_best_fit_is_cross_validated_by_refits_if_unsure() -> None:
    """Of a threshold slopes may foretell less than a fit does, and no less than 1.2 times what it leaves."""
    problem = problem_of(recorded(GAIN, 12, speeds=(1.2, 2.2, 3.2)))
    fitted = problem.fit((candidate(problem, "sensor-gain:" + FORCE),), (0.5,))
    assert fitted is not None
    groups, ahead = [[0], [1], [2]], held_out(fitted, [[0], [1], [2]]).chi2.sum()
    way = [b.J[:, 0] / np.linalg.norm(b.J) for b in fitted.blocks]
    flat = [
        replace(b, J=0.1 * b.J, residual=b.residual + 0.5 * w) for b, w in zip(fitted.blocks[1:], way[1:], strict=True)
    ]
    lead = replace(fitted, blocks=(fitted.blocks[0], *flat))
    rival = replace(fitted, blocks=tuple(replace(b, residual=1.01 * b.residual) for b in lead.blocks))
    rival = replace(rival, cross_validated=tuple(1.01 * b.total for b in fitted.blocks))
    assert lead.chi2 < rival.chi2
    assert held_out(rival, groups).chi2.sum() < held_out(lead, groups).chi2.sum() < 1.2**2 * lead.chi2
    asked: list[Any] = []

    def parallel_map(problem: Problem, scan: Any, things: Sequence[Any]) -> list[Any]:
        asked.append(list(things))
        return serial_map(problem, pickle.loads(pickle.dumps(scan)), things)  # as it is sent to children

    inquiry = cast(
        Inquiry, SimpleNamespace(problem=problem, groups=groups, executor=SimpleNamespace(parallel_map=parallel_map))
    )
    new, beside = _refitted_where_slopes_mislead(inquiry, [lead, rival])
    assert beside is rival
    assert new.cross_validated is not None
    assert held_out(new, groups).chi2.sum() == pytest.approx(ahead, rel=0.01)
    assert asked == [groups]
    assert _refitted_where_slopes_mislead(inquiry, [fitted, rival])[0] is fitted  # it foretells best as it is


def test_a_rival_is_not_dismissed_by_misleading_slopes() -> None:
    """One that meets all recordings as well as the best is predicted by fits, one that explains nothing is not."""
    problem = problem_of(recorded(GAIN, 12, speeds=(1.2, 2.2, 3.2)))
    base, best = problem.fit((), ()), problem.fit((candidate(problem, "sensor-gain:" + FORCE),), (0.5,))
    assert base is not None
    assert best is not None
    groups = [[0], [1], [2]]
    pulled = [b.residual + 3.0 * b.J[:, 0] / np.linalg.norm(b.J) for b in best.blocks[1:]]
    misled = [replace(b, J=0.01 * b.J, residual=w) for b, w in zip(best.blocks[1:], pulled, strict=True)]
    flat = replace(best, blocks=(best.blocks[0], *misled))
    idle = replace(
        flat, blocks=tuple(replace(b, residual=o.residual) for b, o in zip(flat.blocks, base.blocks, strict=True))
    )
    assert held_out(flat, groups).total > 1.2 * float(np.sqrt(flat.chi2 / sum(b.size for b in flat.blocks)))
    step = Step(base=base, fitted=best, p_value=0.0, rivals=(best, flat, idle)).cross_validated(problem, groups)
    ahead, rival, other = step.rivals
    assert ahead is step.fitted is best
    assert held_out(rival, groups).total == pytest.approx(held_out(best, groups).total, rel=0.01)
    assert other is idle
