"""The end of a recording that hardly counts is left aside: when, what of it, and what the shorter runs still see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rollover.diagnosis.aftermath import LASTING, left_aside, shortened
from rollover.diagnosis.bins import Averaged
from rollover.diagnosis.evidence import Evidence, Signal
from rollover.diagnosis.overturn import AHEAD, RunSimulator
from rollover.recording import Recording
from tests.physics.scenes import shipped

CHANNEL = "chassis/acceleration_z"
STEP, END, BLOW = 0.002, 2.0, 0.5


def evidence(counts: float, *, cfc: int | None = None, off: float = 0.0) -> Evidence:
    """A long recording of a toss, whose samples count so much after the blow, and are off by that at the end."""
    time = np.arange(0.0, END, STEP)
    scenario = shipped("cube_toss").replaced({"simulation.duration": END + 0.1})
    cfcs = {} if cfc is None else {CHANNEL: cfc}
    empty = Recording(title="toss", time=time, channels={CHANNEL: np.zeros(time.size)}, cfc=cfcs)
    there = RunSimulator(scenario, empty).predict({}, 0.0)
    assert there is not None
    made = replace(empty, channels={CHANNEL: there[CHANNEL] + off * (time > BLOW + LASTING)})
    rows = np.arange(0, time.size, 2)
    weight = np.where(time[rows] < BLOW, 1.0, counts)
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
    return Evidence(
        name="toss", recording=made, simulator=RunSimulator(scenario, made), signals=(signal,), shift_prior=1e-3,
        condition="", strays=(np.arange(rows.size, dtype=float),), blow=BLOW,
    )  # fmt: skip


def test_an_end_that_hardly_counts_isleft_aside() -> None:
    whole = evidence(0.3)
    found = shortened(whole)
    assert found.recording.time[-1] == pytest.approx(BLOW + LASTING, abs=STEP)
    (signal,) = found.signals
    assert signal.weight is not None
    n = signal.rows.size
    assert n == np.count_nonzero(whole.recording.time[whole.signals[0].rows] <= BLOW + LASTING)
    np.testing.assert_array_equal(signal.values, whole.signals[0].values[:n])
    assert signal.weight.size == n
    np.testing.assert_array_equal(signal.level, 1.0 + found.recording.time[signal.rows])
    assert found.measured().size == n
    np.testing.assert_array_equal(found.strays[0], np.arange(n))
    assert isinstance(found.simulator, RunSimulator)
    assert found.simulator.scenario.simulation.duration < BLOW + LASTING + 0.05
    assert left_aside([whole], [found]) == ["toss: what comes after 1.10 s depends on chance and was left aside"]


def test_an_end_that_counts_is_kept() -> None:
    for e in (evidence(0.9), replace(evidence(0.3), blow=np.inf), replace(evidence(0.3), blow=END - LASTING)):
        assert shortened(e) is e
    plain = evidence(0.3)
    assert shortened(replace(plain, signals=(replace(plain.signals[0], weight=None),))).recording.time.size == 1000


@pytest.mark.parametrize(("off", "is_kept"), [(0.0, False), (1.5, False), (2.5, True)])
def test_an_end_that_hardly_counts_is_kept_where_it_differs_by_more_than_chance(off: float, is_kept: bool) -> None:
    """Samples of noise 1 that count 0.3, of runs that differ by 1: (0.3 off)^2 against 3 (0.3^2 + 0.3^2)."""
    whole = evidence(0.3, off=off)
    one = np.ones(whole.signals[0].rows.size)
    even = replace(whole.signals[0], level=one)
    found = shortened(replace(whole, signals=(even,), strays=(one, -one)))
    assert (found.recording.time.size == whole.recording.time.size) == is_kept


def test_of_one_recording_alone_nothing_after_the_blow_counts() -> None:
    whole = evidence(0.9)
    found = shortened(whole, alone=True)
    assert found.recording.time[-1] == pytest.approx(BLOW, abs=STEP)
    without = replace(whole, blow=np.inf)
    assert shortened(without, alone=True) is without


def test_a_shorter_run_is_the_same_run_and_its_filter_looks_ahead() -> None:
    whole = evidence(0.3, cfc=60)
    found = shortened(whole)
    assert isinstance(found.simulator, RunSimulator)
    assert found.simulator.scenario.simulation.duration >= BLOW + LASTING + AHEAD
    long, short = whole.simulator.predict({}, 0.0), found.simulator.predict({}, 0.0)
    assert long is not None
    assert short is not None
    off = np.abs(short[CHANNEL] - long[CHANNEL][: short[CHANNEL].size])
    assert off.max() < 1e-3 * np.ptp(long[CHANNEL])
    assert whole.simulator.state(0.0)["chassis/position_z"].size > short[CHANNEL].size


def test_means_of_samples_are_shortened_too() -> None:
    whole = evidence(0.3)
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
