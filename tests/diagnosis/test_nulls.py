"""p-values on nothing but noise are uniform, for noise with and without a memory: no drop is made anew for a draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from rollover.diagnosis.data.dataset import Dataset, dataset_of
from rollover.diagnosis.data.phases import drop_phases
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.forward.interface import Simulator
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.selection.candidates import candidates_of
from rollover.diagnosis.selection.score_test import score_test
from rollover.recording import Recording
from rollover.recording.filters import filtered
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, scenario

DRAWS = 40


def noise(rng: np.random.Generator, count: int, memory: float) -> np.ndarray:
    white = rng.standard_normal(count + 300)
    return np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], white)[300:])


def silent() -> list[tuple[Recording, Simulator]]:
    """Drops without noise, and what simulates them."""
    found = []
    for speed in (1.1, 1.9, 3.3):
        time = np.arange(-0.04, 0.35, 1.0 / 700.0)
        recording = Recording(
            title=f"{speed}", time=time, conditions={"initiation.speed": speed},
            channels={c: np.zeros(time.size) for c in (FORCE, DEPTH, ACCELERATION)},
        )  # fmt: skip
        simulator = simulator_of(scenario(), recording)
        predicted = simulator.predict({}, 0.0)
        assert predicted is not None
        channels = {name: predicted[name] for name in recording.channels}
        found.append((replace(recording, channels=channels), simulator))
    return found


def noisy(drops: Sequence[tuple[Recording, Simulator]], rng: np.random.Generator, memory: float) -> list[Dataset]:
    found = []
    for k, (r, simulator) in enumerate(drops):
        channels = {c: y + 0.01 * np.ptp(y) * noise(rng, y.size, memory) for c, y in r.channels.items()}
        one = dataset_of(f"r{k}", replace(r, channels=channels), simulator)
        assert one is not None
        found.append(replace(one, shift_prior=1e-8))  # clocks are right: every draw meets the same simulations
    return found


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_p_values_are_uniform_where_there_is_only_noise(memory: float) -> None:
    rng, drops = np.random.default_rng(7), silent()
    omnibus, best = [], []
    for _ in range(DRAWS):
        dataset = noisy(drops, rng, memory)
        misfit = [
            np.concatenate([s.values - r.channels[s.channel][s.rows] for s in e.signals])
            for e, (r, _) in zip(dataset, drops, strict=True)
        ]
        problem = Problem(autoregression.with_noise_of_residuals(dataset, misfit))
        base = problem.fit((), (), rounds=1)
        assert base is not None
        phases = [drop_phases(e) for e in problem.dataset]
        omnibus.append(mismatch_of(problem.dataset, base.blocks, phases).p_value)
        few = [c for c in candidates_of(dataset, (), "drop") if c.kind == "sensor" and c.id != "sensor-lag"]
        best.append(score_test(problem, base, few).p_value())
    assert kstest(omnibus, "uniform").pvalue > 0.01
    assert kstest(best, "uniform").pvalue > 0.01
    assert min(omnibus + best) > 1e-4


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_noise_level_and_memory_come_from_all_recordings(memory: float) -> None:
    rng = np.random.default_rng(11)
    sigma, ar = autoregression.autoregression([2.0 * noise(rng, 300, memory) for _ in range(6)])
    assert sigma == pytest.approx(2.0, rel=0.12)
    assert sum(ar) == pytest.approx(memory, abs=0.08)


def behind_a_filter(rng: np.random.Generator, count: int) -> np.ndarray:
    """CFC 180 at 2 kHz, of which every second sample is new."""
    return filtered(rng.standard_normal(2 * count + 400), 1.0 / 2000.0, 180)[200:-200:2]


def test_noise_memory_is_unbiased_though_levels_differ() -> None:
    """0.01 too little of a memory of 0.8 makes what is slow 7 % too strong, and p-values too small."""
    rng, drops = np.random.default_rng(19), silent()
    found = []
    for _ in range(60):
        dataset = noisy(drops, rng, 0.0)
        spans = [0.01 * s.span for s in dataset[0].signals]
        misfit = [
            np.concatenate([span * noise(rng, s.rows.size, 0.8) for s, span in zip(e.signals, spans, strict=True)])
            for e in dataset
        ]
        told = autoregression.with_noise_of_residuals(
            autoregression.with_noise_of_quiet_stretches(dataset, misfit), misfit
        )
        found += [sum(s.ar) for s in told[0].signals]
    assert np.mean(found) == pytest.approx(0.8, abs=0.0025)


def test_filtered_noise_is_flat_once_whitened() -> None:
    rng = np.random.default_rng(23)
    series = [behind_a_filter(rng, 1200) for _ in range(6)]
    sigma, ar = autoregression.autoregression(series)
    slow, all_ = 0.0, 0.0
    for _ in range(40):
        w = lfilter([1.0, *(-a for a in ar)], [1.0], behind_a_filter(rng, 1200))[len(ar) :]
        power = np.abs(np.fft.rfft(w - w.mean())[1:-1]) ** 2
        slow, all_ = slow + power[: power.size // 10].mean(), all_ + power.mean()
    assert slow / all_ == pytest.approx(1.0, abs=0.06)
    assert sigma == pytest.approx(np.std(np.concatenate(series)), rel=0.03)


def test_a_spectral_line_is_not_taken_for_autocorrelation() -> None:
    rng = np.random.default_rng(12)
    t = np.arange(600)
    series = [3.0 * np.sin(0.3 * t + k) + 0.1 * rng.standard_normal(600) for k in range(4)]
    _, ar = autoregression.autoregression(series)
    roots = np.roots([1.0, *(-a for a in ar)])
    assert not np.any((np.abs(roots) > 0.9) & (np.abs(roots.imag) > 0.0))


def test_after_an_impact_nothing_is_quiet() -> None:
    """Where a run depends on chance, from 0.1 s on, it is off by three times the noise."""
    rng = np.random.default_rng(29)

    class Blown:
        def marks(self) -> tuple[tuple[float, str], ...]:
            return ((-0.04, "tipping"), (0.1, "impact"))

    blown: Any = Blown()
    dataset = [replace(e, simulator=blown) for e in noisy(silent(), rng, 0.0)]
    spans = {s.channel: 0.01 * s.span for s in dataset[0].signals}
    misfit = []
    for e in dataset:
        each = [np.where(e.recording.time[s.rows] < 0.1, 1.0, 3.0) * spans[s.channel] for s in e.signals]
        misfit.append(np.concatenate([size * rng.standard_normal(size.size) for size in each]))
    for e in autoregression.with_noise_of_quiet_stretches(dataset, misfit):
        for s in e.signals:
            assert s.noise == pytest.approx(spans[s.channel], rel=0.15), s.channel


def test_quiet_noise_is_found_beneath_a_large_misfit() -> None:
    rng, drops = np.random.default_rng(13), silent()
    dataset = noisy(drops, rng, 0.0)
    off = [np.concatenate([0.7 * s.values for s in e.signals]) for e in dataset]  # a scenario that says a third
    for e, before in zip(autoregression.with_noise_of_quiet_stretches(dataset, off), dataset, strict=True):
        for s, b in zip(e.signals, before.signals, strict=True):
            true = 0.01 * float(np.ptp(b.values))
            assert 0.6 * true < s.noise < 2.0 * true, s.channel
