"""Noise of 1/f: slow before anything is hit, no louder after, another in each recording; what physics leaves is not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.drift import cosines, is_louder, is_recorder_noise, is_shared, is_slow, leading_cosines
from rollover.diagnosis.settings import SETTINGS
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario, signal

N, BEFORE = 400, 60
TIME = (np.arange(N) - BEFORE) * 1e-3
LATER = np.where(TIME > 0.0, np.sin(np.pi * np.clip(TIME / 0.2, 0.0, 1.0)), 0.0)  # as what is missing after a contact


def pink(rng: np.random.Generator, n: int = N) -> np.ndarray:
    """A stretch of noise whose power goes as 1/f down to an eighth of its length, of unit size."""
    f = np.fft.rfftfreq(8 * n)
    f[0] = f[1]
    phases = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
    found = np.fft.irfft(phases / np.sqrt(f), 8 * n)
    at = int(rng.integers(0, 7 * n))
    return np.asarray((found / found.std())[at : at + n])


Signals = list[tuple[Dataset, Signal, np.ndarray]]


def signals_of(misfits: Sequence[np.ndarray], sigma: float = 1.0) -> Signals:
    e: Any = SimpleNamespace(recording=SimpleNamespace(time=TIME), simulator=SimpleNamespace(contact=0.0))
    return [(e, signal(w, sigma), w) for w in misfits]


def share(make: Callable[[np.random.Generator], Signals]) -> float:
    """How often what is made is taken for a recorder's noise, of 100."""
    return sum(is_recorder_noise(make(np.random.default_rng(seed))) for seed in range(100)) / 100.0


def test_cosines_are_orthonormal_and_expected_of_noise() -> None:
    """White noise leaves 1 of each; with a memory of 0.6 its slowest tend to (1 + 0.6)/(1 - 0.6) = 4 in squares."""
    np.testing.assert_allclose(cosines(30, 8) @ cosines(30, 8).T, np.eye(8), atol=1e-12)
    rng, found = np.random.default_rng(0), []
    for _ in range(400):
        w = lfilter([0.8], [1.0, -0.6], rng.standard_normal(N + 50))[50:]
        one = signal(w, 1.0, (0.6,))
        found.append([float(np.mean(leading_cosines(one, part, k) ** 2)) for part, k in ((w[:60], 5), (w[60:], 8))])
    np.testing.assert_allclose(np.mean(found, axis=0), 1.0, atol=0.05)


def test_a_channel_silent_at_rest_has_no_recorder_noise() -> None:
    """Over no noise everything is slow, and as loud before as after: no number to go by."""
    rng = np.random.default_rng(1)
    with np.errstate(divide="raise", invalid="raise"):
        assert not is_recorder_noise(signals_of([pink(rng) for _ in range(6)], 0.0))


def test_noise_of_one_over_f_is_its_recorder_s() -> None:
    """(A2) errs in one of a hundred, (A3) in up to twice two: 95, of 100 drawn with a standard deviation of 2.2."""
    assert 0.92 < share(lambda rng: signals_of([pink(rng) for _ in range(6)], 0.6)) < 1.0


def test_white_noise_is_not_slow_whatever_comes_after() -> None:
    """A1 errs in one of a hundred: physics on quiet noise is never taken for noise, nor is an offset of all."""

    def noise(rng: np.random.Generator, of: float, offset: float) -> Signals:
        return signals_of([rng.standard_normal(N) + of * LATER + offset for _ in range(6)])

    assert share(lambda rng: noise(rng, 0.0, 0.0)) <= 0.03
    assert share(lambda rng: noise(rng, 1.0, 0.0)) <= 0.03
    assert share(lambda rng: noise(rng, 0.0, 0.5)) <= 0.03


def test_what_is_louder_after_the_contact_or_shared_is_missing() -> None:
    def of(rng: np.random.Generator, sizes: Sequence[float]) -> Signals:
        return signals_of([pink(rng) + size * LATER for size in sizes], 0.6)

    assert share(lambda rng: of(rng, 6 * [3.0])) <= 0.05
    assert share(lambda rng: of(rng, [4.0, -4.0, 5.0, -5.0, 6.0, -6.0])) <= 0.05
    both = [4.0, -4.0, 5.0, -5.0, 6.0, -6.0]
    quiet, loud, alike = (of(np.random.default_rng(1), sizes) for sizes in (6 * [0.0], both, 6 * [3.0]))
    before = np.array([leading_cosines(s, w[:BEFORE], 5) for _, s, w in quiet])
    assert is_slow(before)
    for every, louder in ((quiet, False), (loud, True)):
        after = [leading_cosines(s, part, 5) for _, s, w in every for part in w[BEFORE : 6 * BEFORE].reshape(5, BEFORE)]
        assert is_louder(before, np.array(after)) is louder
    shared = [
        is_shared(np.array([leading_cosines(s, w[BEFORE:], 8) for _, s, w in every])) for every in (quiet, loud, alike)
    ]
    assert shared == [False, False, True]


def test_one_offset_is_shared_by_recordings_of_unlike_noise() -> None:
    """5 in each, under noise of 2, 2 and 0.8 that remembers 0.6, 0.65 and 0.2: no noise, as one was taken for."""

    def make(rng: np.random.Generator) -> Signals:
        found: Signals = []
        for sigma, memory in ((2.0, 0.6), (2.0, 0.65), (0.8, 0.2)):
            w = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(N + 50))[50:]
            [(e, _, misfit)] = signals_of([5.0 + sigma * w])
            found.append((e, signal(misfit, sigma * np.sqrt(1.0 - memory**2), (memory,)), misfit))
        return found

    assert share(make) == 0.0


def test_two_recordings_or_a_short_free_fall_show_no_drift() -> None:
    rng = np.random.default_rng(2)
    every = signals_of([pink(rng) for _ in range(6)], 0.6)
    assert is_recorder_noise(every)
    assert not is_recorder_noise(every[:2])
    late: Any = SimpleNamespace(recording=SimpleNamespace(time=TIME + 0.045), simulator=SimpleNamespace(contact=0.0))
    assert not is_recorder_noise([(late, s, w) for _, s, w in every])
    never: Any = SimpleNamespace(recording=SimpleNamespace(time=TIME), simulator=SimpleNamespace(contact=np.inf))
    assert not is_recorder_noise([(never, s, w) for _, s, w in every])


def test_a_long_memory_reaches_where_a_short_one_does_not() -> None:
    """The level at no frequency of what six stretches of 400 samples scatter by in the mean, 10 or so of this noise."""
    rng, levels = np.random.default_rng(3), []
    for _ in range(20):
        series = [pink(rng) + 0.5 * rng.standard_normal(N) for _ in range(6)]
        short, long = autoregression.autoregression(series), autoregression.long_memory(series)
        levels.append(
            (autoregression.low_frequency_level(*short), autoregression.low_frequency_level(*long), len(long[1]))
        )
    low, high, reach = np.mean(levels, axis=0)
    assert reach > 1.5 * SETTINGS.noise.autoregression.longest_memory
    assert high > 1.3 * low
    for a in (0.0, 0.5, 0.9):
        series = [lfilter([1.0], [1.0, -a], rng.standard_normal(N)) for _ in range(6)]
        # its standard error by the memory's, sqrt((1 - a^2)/n)/(1 - a): 2, 4 and 9 %; within 2.5 of these
        error = np.sqrt((1.0 + a) / ((1.0 - a) * 6 * N))
        assert autoregression.low_frequency_level(*autoregression.long_memory(series)) == pytest.approx(
            1.0 / (1.0 - a), rel=2.5 * error
        )


@pytest.mark.parametrize(("of", "seed"), [(0.7, 0), (1.0, 1)])
def test_drops_with_noise_of_one_over_f_lack_nothing(of: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    clean = recorded(
        {}, seed, speeds=(1.0, 1.5, 2.0, 2.5, 3.0, 3.5), channels=(FORCE, DEPTH, ACCELERATION), noise=0.0, rate=2000.0
    )
    made = []
    for name, r in clean:
        channels = {}
        for c, values in r.channels.items():
            noise = np.sqrt(1.0 - of**2) * rng.standard_normal(values.size) + of * pink(rng, values.size)
            channels[c] = values + 0.01 * np.ptp(values) * noise
        made.append((name, replace(r, channels=channels)))
    found = diagnose(scenario(), made)
    assert found.verdict == "no-mismatch", found.sentence
