"""Which effect leads for a judge who knows the background's covariance exactly: how far the names can be told at all.

    python -m tests.benchmarks.known_background --cases 40 --seed 64011 [--background 0.03]

Cases as of `rollover prove --kinds foreign-form --kinds background --background 0.03`. Of each in which the diagnosis
fits an effect beside an estimated discrepancy, all candidates that it fitted are weighed anew, by the covariance of the
very family that the background was drawn from. A background b of the force's share acts on the striker, so that
channels answer it linearly by y = A b + swings of the frame; of its courses, a share of which is common to all drops,

    S = N + A cov(b, b) A' + swings,   ln E = -m'S^-1 m/2 - ln det(C'S^-1 C + P)/2 + ln det(P)/2

with N the noise of quiet stretches, m what the fit leaves, C the slopes of its numbers, clocks and conditions, P their
priors (an effect's coordinate has a standard deviation of half its range): the integral over all of them (Laplace).
What this judge does not know is the form of the effect's law, which is the literature's and not the product's.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis import conclusion, diagnose
from rollover.diagnosis.alone import verdict_on_single_effect
from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.cross_validation import Groups
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.inference.slow_discrepancy import innovations
from rollover.diagnosis.io import recordings_in
from rollover.diagnosis.result import Verdict
from rollover.diagnosis.selection.explanation import Explanation
from rollover.proof.background import Background, background, unsized
from rollover.proof.generator import Case, Drawn, Order, drawn, make, plan
from rollover.proof.handover import write_case
from rollover.proof.readings import Reading, measured, rig_of
from rollover.scenario import load

Array = NDArray[np.float64]
PLACES = np.arange(0.0, 2.2, 0.06)  # of the time to the deepest point: a course is linear between them
COURSES, SWINGS = 3000, 24  # that are drawn for their covariance
SMALL = 0.02  # of a background, by which the answers of channels are differenced
SLOPE = 0.01  # of an effect's coordinate
HALF = 0.5  # of its range, standard deviation of a coordinate


def hat(k: int, x: float) -> float:
    """1 at a place, 0 at all others."""
    return max(0.0, 1.0 - abs(x - float(PLACES[k])) / float(PLACES[1]))


def covariance(case: Drawn) -> tuple[Array, Array]:
    """Square roots (places, n) of the covariance of courses that is common to all drops, and of what each has alone."""
    both = case.plain[:1] * 2
    every = [unsized(1, k, both).courses for k in range(COURSES)]
    one, two = (np.array([[course[i](float(x)) for x in PLACES] for course in every]) for i in range(2))
    across = 0.5 * (one.T @ two + two.T @ one) / COURSES
    return root(across), root(0.5 * (one.T @ one + two.T @ two) / COURSES - across)


def root(C: Array) -> Array:
    """L of the positive part of C = L L'."""
    values, vectors = np.linalg.eigh(C)
    kept = values > 1e-6 * values.max()
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


def answers(case: Drawn, found: Background) -> list[dict[str, tuple[Array, Array]]]:
    """How channels of each drop answer one standard deviation of what is common (n, k), and of what is its own."""
    common, own = covariance(case)
    still = replace(found.swing, shares={})
    bare = measured(case.campaign, case.changes)

    def answer(courses: Sequence[Any], swing: Any) -> list[Reading]:
        small = replace(found, courses=tuple(courses), swing=swing, size=SMALL)
        return measured(case.campaign, case.changes, None, small)

    drops = len(case.plain)
    each = [answer([partial(hat, k)] * drops, still) for k in range(PLACES.size)]
    swings = [unsized(2, k, case.plain).swing for k in range(SWINGS)]
    swung = [answer([lambda x: 0.0] * drops, swing) for swing in swings]
    told = []
    for i, one in enumerate(bare):
        of = {}
        for channel, values in one.values.items():
            A, B = (
                np.nan_to_num(np.stack([r[i].values[channel] - values for r in those], axis=1)) * found.size / SMALL
                for those in (each, swung)
            )
            of[channel] = np.hstack([A @ common, B / np.sqrt(SWINGS)]), A @ own
        told.append(of)
    return told


def filtered(s: Signal, X: Array) -> Array:
    """Columns of a signal as innovations of unit variance of its quiet noise."""
    return np.asarray(innovations(s, s.quiet[0]) @ X)


@dataclass(frozen=True, kw_only=True)
class Judge:
    """Knows how each recording answers the background, in innovations: common columns, own ones, and their Gram."""

    problem: Problem
    common: tuple[Array, ...]
    own: tuple[Array, ...]
    root: Array

    @classmethod
    def of(cls, problem: Problem, told: Sequence[dict[str, tuple[Array, Array]]]) -> Judge:
        """By what channels answer; recordings are called after their drops."""
        common: list[Array] = []
        own: list[Array] = []
        for e in problem.dataset:
            drop = told[int(e.recording.title.split()[-1]) - 1]
            for kept, k in ((common, 0), (own, 1)):
                kept.append(np.vstack([filtered(s, drop[s.channel][k][s.rows]) for s in e.signals]))
        n, m = common[0].shape[1], own[0].shape[1]
        K = np.eye(n + m * len(own))
        for r, (c, o) in enumerate(zip(common, own, strict=True)):
            at = slice(n + r * m, n + (r + 1) * m)
            K[:n, :n] += c.T @ c
            K[:n, at] += c.T @ o
            K[at, :n] += o.T @ c
            K[at, at] += o.T @ o
        return cls(problem=problem, common=tuple(common), own=tuple(own), root=np.asarray(np.linalg.cholesky(K)))

    def gram(self, every: Sequence[Array]) -> Array:
        """X'S^-1 X of columns X of all recordings, innovations."""
        across = [
            sum(c.T @ X for c, X in zip(self.common, every, strict=True)),
            *(o.T @ X for o, X in zip(self.own, every, strict=True)),
        ]
        Y = np.linalg.solve(self.root, np.vstack(across))
        return np.asarray(sum(X.T @ X for X in every) - Y.T @ Y)

    def log_evidence(self, fitted: Fitted) -> float:
        """ln E of a fit."""
        width = sum(1 + len(e.uncertain_columns) for e in self.problem.dataset)
        every, at = [], len(fitted.x)
        for r, e in enumerate(self.problem.dataset):
            X = self.columns(e, r, fitted)
            if X is None:
                return -np.inf
            p = 1 + len(fitted.x)
            wide = np.zeros((X.shape[0], 1 + len(fitted.x) + width))
            wide[:, :p] = X[:, :p]
            wide[:, 1 + at : 1 + at + X.shape[1] - p] = X[:, p:]
            at += X.shape[1] - p
            every.append(np.vstack([filtered(s, wide[part]) for s, part in e.spans()]))
        G = self.gram(every)
        prior = np.array([HALF**-2] * len(fitted.x) + [1.0] * width)
        held = G[1:, 1:] + np.diag(prior)
        left = G[0, 0] - G[1:, 0] @ np.linalg.solve(held, G[1:, 0])
        return float(-0.5 * left - 0.5 * np.linalg.slogdet(held)[1] + 0.5 * np.sum(np.log(prior)))

    def columns(self, e: Dataset, r: int, fitted: Fitted) -> Array | None:
        """What a fit leaves of recording r, the slopes of its numbers, of its clock and of uncertain conditions, SI."""
        shift, problem = fitted.blocks[r].shift, self.problem
        y = problem.raw(r, fitted.candidates, fitted.x, shift)
        if y is None:
            return None
        columns = [e.values - y]
        for k, x in enumerate(fitted.x):
            step = SLOPE if x < 0.5 else -SLOPE
            moved = (*fitted.x[:k], x + step, *fitted.x[k + 1 :])
            later = problem.raw(r, fitted.candidates, moved, shift)
            columns.append(np.zeros_like(y) if later is None else (later - y) / step)
        clock = problem.clock_slope(r, fitted.candidates, fitted.x, shift, y) * e.shift_prior
        return np.stack([*columns, clock, *e.uncertain_columns], axis=1)


@dataclass(frozen=True, kw_only=True)
class Judged:
    """Of a case with one effect: its name, what leads by the diagnosis (or nothing), and by the judge."""

    case: str
    effect: str
    over_background: float
    diagnosis: str
    judge: str


def judged(order: Order, case: Case) -> Judged | None:
    """The case of an order, None where the diagnosis fits nothing beside an estimated discrepancy."""
    kept: list[tuple[Problem, Explanation]] = []

    def listening(problem: Problem, found: Explanation, groups: Groups, **more: Any) -> tuple[Explanation, Verdict]:
        kept.append((problem, found))
        return verdict_on_single_effect(problem, found, groups, **more)

    with tempfile.TemporaryDirectory() as folder, Executor(1) as executor:
        write_case(case, Path(folder, case.name))
        scenario, recordings = load(Path(folder, case.name, "scenario.yaml")), recordings_in(Path(folder, case.name))
        with patch.object(conclusion, "verdict_on_single_effect", listening):
            said = diagnose(scenario, recordings, executor=executor)
        if not kept or not kept[0][1].parts:
            return None
        problem, found = kept[0]
        case_drawn = drawn(order)
        rigs = [rig_of(case_drawn.campaign, shot, ()) for shot in case_drawn.campaign.shots]
        around = background(order.seed, order.index, order.background, rigs, case_drawn.plain)
        judge = Judge.of(problem, answers(case_drawn, around))
        one = found.parts[0]
        fits = list({id(f): f for f in (one.fitted, *one.rivals)}.values())
        first = max(fits, key=judge.log_evidence).candidates[-1].id
    (effect,) = case.truth["effects"]
    return Judged(
        case=case.name,
        effect=effect["id"],
        over_background=effect["over_background"],
        diagnosis=said.effects[0].id if said.effects else "",
        judge=first,
    )


def main() -> None:
    """Print a line for each case with an effect that was fitted, and how many lead rightly."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--cases", type=int, default=40)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--background", type=float, default=0.03)
    asked.add_argument("--least", type=float, default=1.6, help="times the background that an effect has at least")
    given = asked.parse_args()
    every = []
    for order in plan(given.cases, given.seed, ("foreign-form", "background"), (), given.background):
        if not order.ids or (case := make(order)).truth["effects"][0]["over_background"] <= given.least:
            continue
        found = judged(order, case)
        if found is not None:
            every.append(found)
            print(found, flush=True)
    by_diagnosis = sum(f.diagnosis == f.effect for f in every)
    by_judge = sum(f.judge == f.effect for f in every)
    print(f"of {len(every)} effects that were fitted {by_diagnosis} lead by the diagnosis, {by_judge} by the judge")


if __name__ == "__main__":
    main()
