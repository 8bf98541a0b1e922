"""The end of a recording that hardly counts is excluded: when, what of it, and what the shorter runs still see."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.step import Inquiry
from rollover.diagnosis.forward.averaging import Averaged
from rollover.diagnosis.forward.full_run import RunSimulator
from rollover.diagnosis.noise.truncation import shortened, shortly_after_impact, truncation_notes, up_to
from rollover.diagnosis.selection import forward_step, screening
from rollover.diagnosis.selection.score_test import ScoreTest
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import Search
from rollover.recording import Recording
from tests.physics.scenes import shipped

CHANNEL = "chassis/acceleration_z"
STEP, END, IMPACT = 0.002, 2.0, 0.5


def dataset(counts: float, *, cfc: int | None = None, off: float = 0.0) -> Dataset:
    """A long recording of a toss, whose samples count so much after the impact, and are off by that at the end."""
    time = np.arange(0.0, END, STEP)
    scenario = shipped("cube_toss").replaced({"simulation.duration": END + 0.1})
    cfcs = {} if cfc is None else {CHANNEL: cfc}
    empty = Recording(title="toss", time=time, channels={CHANNEL: np.zeros(time.size)}, cfc=cfcs)
    there = RunSimulator(scenario, empty).predict({}, 0.0)
    assert there is not None
    made = replace(
        empty,
        channels={CHANNEL: there[CHANNEL] + off * (time > IMPACT + SETTINGS.noise.truncation.retained_after_impact)},
    )
    rows = np.arange(0, time.size, 2)
    weight = np.where(time[rows] < IMPACT, 1.0, counts)
    signal = Signal(
        channel=CHANNEL,
        rows=rows,
        values=made[CHANNEL][rows],
        sigma=1.0,
        noise=1.0,
        ar=(),
        span=2.0,
        weight=weight,
        level=1.0 + time[rows],
    )
    return Dataset(
        name="toss", recording=made, simulator=RunSimulator(scenario, made), signals=(signal,), shift_prior=1e-3,
        condition="", perturbed=(np.arange(rows.size, dtype=float),), first_impact=IMPACT,
    )  # fmt: skip


def test_an_end_that_hardly_counts_isleft_aside() -> None:
    whole = dataset(0.3)
    found = shortened(whole)
    assert found.recording.time[-1] == pytest.approx(IMPACT + SETTINGS.noise.truncation.retained_after_impact, abs=STEP)
    (signal,) = found.signals
    assert signal.weight is not None
    n = signal.rows.size
    assert n == np.count_nonzero(
        whole.recording.time[whole.signals[0].rows] <= IMPACT + SETTINGS.noise.truncation.retained_after_impact
    )
    np.testing.assert_array_equal(signal.values, whole.signals[0].values[:n])
    assert signal.weight.size == n
    np.testing.assert_array_equal(signal.level, 1.0 + found.recording.time[signal.rows])
    assert found.measured().size == n
    np.testing.assert_array_equal(found.perturbed[0], np.arange(n))
    assert isinstance(found.simulator, RunSimulator)
    assert (
        found.simulator.scenario.simulation.duration < IMPACT + SETTINGS.noise.truncation.retained_after_impact + 0.05
    )
    assert truncation_notes([whole], [found]) == ["toss: what comes after 1.10 s is chaotic and was excluded"]


def test_an_end_that_counts_is_kept() -> None:
    for e in (
        dataset(0.9),
        replace(dataset(0.3), first_impact=np.inf),
        replace(dataset(0.3), first_impact=END - SETTINGS.noise.truncation.retained_after_impact),
    ):
        assert shortened(e) is e
    plain = dataset(0.3)
    assert shortened(replace(plain, signals=(replace(plain.signals[0], weight=None),))).recording.time.size == 1000


@pytest.mark.parametrize(("off", "stays"), [(0.0, False), (1.5, False), (2.5, True)])
def test_a_light_end_stays_where_it_differs_significantly(off: float, stays: bool) -> None:
    """Samples of noise 1 that count 0.3, of runs that differ by 1: (0.3 off)^2 against 3 (0.3^2 + 0.3^2)."""
    whole = dataset(0.3, off=off)
    one = np.ones(whole.signals[0].rows.size)
    even = replace(whole.signals[0], level=one)
    found = shortened(replace(whole, signals=(even,), perturbed=(one, -one)))
    assert (found.recording.time.size == whole.recording.time.size) == stays


def test_of_one_recording_nothing_after_the_impact_counts() -> None:
    whole = dataset(0.9)
    found = shortened(whole, alone=True)
    assert found.recording.time[-1] == pytest.approx(IMPACT, abs=STEP)
    without = replace(whole, first_impact=np.inf)
    assert shortened(without, alone=True) is without


def test_a_truncated_run_is_the_same_and_its_filter_runs_on() -> None:
    whole = dataset(0.3, cfc=60)
    found = shortened(whole)
    assert isinstance(found.simulator, RunSimulator)
    assert (
        found.simulator.scenario.simulation.duration
        >= IMPACT + SETTINGS.noise.truncation.retained_after_impact + SETTINGS.forward.run.filter_ahead
    )
    long, short = whole.simulator.predict({}, 0.0), found.simulator.predict({}, 0.0)
    assert long is not None
    assert short is not None
    off = np.abs(short[CHANNEL] - long[CHANNEL][: short[CHANNEL].size])
    assert off.max() < 1e-3 * np.ptp(long[CHANNEL])
    assert whole.simulator.state(0.0)["chassis/position_z"].size > short[CHANNEL].size


def test_means_of_samples_are_shortened_too() -> None:
    whole = dataset(0.3)
    assert isinstance(whole.simulator, RunSimulator)
    starts = np.arange(0, whole.recording.time.size, 2)
    means = Averaged(inner=whole.simulator, starts=starts, counts=np.full(starts.size, 2), many=2)
    thin = replace(whole.recording, time=whole.recording.time[::2], channels={CHANNEL: whole.recording[CHANNEL][::2]})
    signal = replace(whole.signals[0], rows=np.arange(starts.size))
    found = shortened(replace(whole, recording=thin, simulator=means, signals=(signal,)))
    assert isinstance(found.simulator, Averaged)
    predicted = found.simulator.predict({}, 0.0)
    assert predicted is not None
    assert predicted[CHANNEL].size == found.recording.time.size == found.simulator.starts.size


def a_step_at(moment: float) -> Dataset:
    """A recording whose samples count in full, and whose channel has moved by a half at a moment, later by all."""
    whole = dataset(1.0)
    (signal,) = whole.signals
    time = whole.recording.time[signal.rows]
    moved = 0.6 * (time >= moment) + 0.4 * (time >= moment + 0.3)
    return replace(whole, signals=(replace(signal, values=moved),))


@pytest.mark.parametrize(
    ("moved", "first_impact", "end"), [(0.2, 0.5, 1.1), (0.8, 0.5, 1.4), (1.4, 0.5, END), (0.2, 1.4, END)]
)
def test_screening_sees_shortly_after_both_first_impacts(moved: float, first_impact: float, end: float) -> None:
    whole = replace(a_step_at(moved), first_impact=first_impact)
    found = shortly_after_impact(whole)
    assert found.recording.time[-1] == pytest.approx(min(end, END - STEP), abs=STEP)  # stamps are a step apart
    assert (found is whole) == (end == END)  # 1.4 + LASTING is the end
    assert shortly_after_impact(whole).simulator is found.simulator  # its runs are known


def test_truncated_data_keep_the_noise_model_of_the_whole() -> None:
    problem = Problem([dataset(0.9)])
    near = problem.near()
    assert near is not problem
    assert near.near() is near
    assert near.dataset[0].count < problem.dataset[0].count
    assert near.predicted(0, (), (), 0.0) is not None
    problem.heavy_tailed, problem.shifts = False, [0.01]
    (signal,) = problem.dataset[0].signals
    problem.with_noise_model([replace(problem.dataset[0], signals=(replace(signal, sigma=2.0),))])
    assert problem.near() is near
    assert (near.heavy_tailed, near.shifts, near.dataset[0].signals[0].sigma) == (False, [0.01], 2.0)
    simulator = problem.dataset[0].simulator
    assert isinstance(simulator, RunSimulator)
    made = simulator.runs
    assert near.predicted(0, (), (), 0.0) is not None
    assert simulator.runs == made >= 1  # what it makes is counted, once
    short = dataset(0.9)
    alone = Problem([up_to(short, IMPACT + 0.1) or short])
    assert alone.near() is alone


def test_truncated_data_have_the_jacobian_rows_of_the_whole() -> None:
    friction = Candidate(id="ground-friction", kind="physics", family="", search={"coefficient": Search(0.1, 0.6)})
    problem = Problem([dataset(0.9, cfc=60)])
    base = problem.fit((friction,), (0.2,), rounds=0, width=1)
    assert base is not None
    near, seen = problem.beginning(base)
    simulator = problem.dataset[0].simulator
    assert isinstance(simulator, RunSimulator)
    made = simulator.runs
    own = near.again(base)
    assert simulator.runs > made  # which it did without
    assert seen.x == base.x
    for block, other in zip(seen.blocks, own.blocks, strict=True):
        np.testing.assert_array_equal(block.residual, other.residual)
        np.testing.assert_allclose(block.J, other.J, rtol=1e-6, atol=1e-6 * float(np.abs(other.J).max()))
    short = Problem([up_to(problem.dataset[0], IMPACT + 0.1) or problem.dataset[0]])
    assert short.beginning(base) == (short, base)


def test_screening_and_first_fits_are_truncated_final_fits_not(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = Problem([dataset(0.9), dataset(0.9)])
    base = problem.fit((), ())
    assert base is not None
    near = problem.near()
    asked: list[tuple[str, Problem, int]] = []

    def gated(problem: Problem, base: Fitted, *_: object, **__: object) -> ScoreTest:
        asked.append(("look", problem, base.blocks[0].residual.size))
        return ScoreTest(score=0.0, scores={}, null=np.zeros(10), detectable={})

    monkeypatch.setattr(screening, "score_test", gated)
    scored = screening.score_candidates(problem, base, [], [[0], [1]])

    def screened(inquiry: Inquiry, base: Fitted, *_: object) -> list[Any]:
        asked.append(("screen", inquiry.problem, base.blocks[0].residual.size))
        return []

    def fitted(inquiry: Inquiry, base: Fitted, *_: object) -> tuple[list[Any], list[Fitted]]:
        asked.append(("first", inquiry.problem, base.blocks[0].residual.size))
        return [], [base]

    def fits(executor: Executor, problem: Problem, tasks: list[Any], *_: object) -> list[None]:
        asked.append(("fits", problem, len(tasks)))
        return [None for _ in tasks]

    monkeypatch.setattr(forward_step, "screen", screened)
    monkeypatch.setattr(forward_step, "_first_fits", fitted)
    monkeypatch.setattr(Executor, "fits", fits)
    inquiry = Inquiry(
        problem=problem, candidates=(), groups=[[0], [1]], phases=[], say=lambda _: None, executor=Executor()
    )
    assert forward_step.step(inquiry, base, scored) is None
    rows = near.dataset[0].count
    assert asked[-3:] == [("screen", near, rows), ("first", near, rows), ("fits", problem, 1)]
    assert {(name, id(who), n) for name, who, n in asked[:-3]} == {("look", id(near), rows)}
