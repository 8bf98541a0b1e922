"""What whitening leaves of the noise behind a filter: less of what is slow than of all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.diagnosis import diagnose
from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.autoregression import Rest, level_ratio, rests, with_noise_of_quiet_stretches
from rollover.recording import Recording
from rollover.recording.filters import filtered
from tests.diagnosis.drops import recorded as dropped
from tests.diagnosis.drops import scenario as drop

CHANNEL = "chassis/acceleration_y"
RATE, N, EVERY = 1000.0, 2048, 4  # Hz, samples, and of how many one tells something new behind CFC 60
DRAWS = 60


class Still:
    """A simulation of nothing."""

    def marks(self) -> list[tuple[float, str]]:
        return []


def recorded(values: np.ndarray) -> Dataset:
    """A recording at `RATE`, said to be behind CFC 60, whose noise is told as diagnoses tell it."""
    time = np.arange(values.size) / RATE
    recording = Recording(title="r", time=time, channels={CHANNEL: values}, cfc={CHANNEL: 60})
    rows = np.arange(0, values.size, EVERY)
    signal = Signal(channel=CHANNEL, rows=rows, values=values[rows], sigma=1.0, noise=1.0, ar=(), span=100.0)
    simulator: Any = Still()
    e = Dataset(name="r", recording=recording, simulator=simulator, signals=(signal,), shift_prior=1e-3, condition="r")
    [e] = with_noise_of_quiet_stretches([e], [signal.values])
    # runs of it scatter somewhere, so that its level is known and not asked of its own roughness
    return replace(e, signals=tuple(replace(s, weight=np.full(s.rows.size, 0.98)) for s in e.signals))


def behind(random: np.random.Generator) -> np.ndarray:
    """White noise behind CFC 60, of any level."""
    return filtered(random.standard_normal(N + 400), 1.0 / RATE, 60)[200 : N + 200]


def slow(e: Dataset) -> tuple[float, float]:
    """What is slow in a recording of nothing but noise, and what is expected of it."""
    w = e.whitened(e.signals[0].values)
    block = ResidualBlock(residual=w, J=np.zeros((w.size, 0)), slope=np.zeros(w.size), shift=0.0, prior=1e-3)
    starts = tuple((float(t), f"part {k}") for k, t in enumerate(np.arange(0.0, e.recording.time[-1], 0.256)))
    cells = mismatch_of([e], [block], [starts]).cells
    return sum(c.structured for c in cells), sum(c.expected for c in cells)


def test_as_much_is_slow_in_noise_behind_a_filter_as_is_expected() -> None:
    """Of 60 recordings with 96 waves each, so that chance is off by 2 %; an even spectrum would be by 10 %."""
    random = np.random.default_rng(3)
    each = np.array([slow(recorded(behind(random))) for _ in range(DRAWS)])
    assert each[:, 0].sum() / each[:, 1].sum() == pytest.approx(1.0, abs=0.04)


def test_noise_that_no_filter_made_is_taken_for_even() -> None:
    """White noise that joins behind the filter: with 2048 samples its memory of 0 is not the filter's 0.15."""
    random = np.random.default_rng(4)
    even = [recorded(random.standard_normal(4 * N)) for _ in range(DRAWS // 3)]
    taken = [rests([e])[0][CHANNEL].correlation is not None for e in even]
    assert not any(taken)
    each = np.array([slow(e) for e in even])
    assert each[:, 0].sum() / each[:, 1].sum() == pytest.approx(1.0, abs=0.04)


def test_noise_that_fits_no_filter_is_taken_for_white(monkeypatch: pytest.MonkeyPatch) -> None:
    """None declared, one too wide for the rate, averages, a longer memory, none weighed; whatever the memory says."""
    monkeypatch.setattr(autoregression, "TUNING", replace(autoregression.TUNING, filter_errors=1e3))
    e = recorded(behind(np.random.default_rng(5)))
    assert rests([e])[0][CHANNEL].correlation is not None
    others = [
        replace(e, recording=replace(e.recording, cfc={})),
        replace(e, recording=replace(e.recording, cfc={CHANNEL: 600})),
        replace(e, averaged=2),
        replace(e, signals=(replace(e.signals[0], ar=(0.1, 0.1)),)),
        replace(e, signals=(replace(e.signals[0], weight=None),)),
    ]
    for other in others:
        assert rests([other]) == [{CHANNEL: Rest()}]
    np.testing.assert_array_equal(Rest().at(np.array([0.0, 0.2])), 1.0)


def test_the_spectrum_of_what_is_left_is_one_on_average() -> None:
    """An autoregression whitened by itself leaves 1 everywhere; another memory leaves as much in all."""
    lags = np.arange(200)
    own = Rest(correlation=0.6**lags, ar=(0.6,))
    frequencies = np.linspace(0.0, 0.5, 4001)
    np.testing.assert_allclose(own.at(frequencies), 1.0, atol=1e-9)
    other = Rest(correlation=0.6**lags, ar=(0.3,)).at(frequencies)
    # (1 - 2 b cos w + b^2)/(1 - 2 a cos w + a^2), over its mean: the power of x_t - b x_(t-1) over that of e_t
    a, b, w = 0.6, 0.3, 2.0 * np.pi * frequencies
    mean = (1.0 + b * b - 2.0 * a * b) / (1.0 - a * a)
    np.testing.assert_allclose(other, (1.0 - 2.0 * b * np.cos(w) + b * b) / (1.0 - 2.0 * a * np.cos(w) + a * a) / mean,
                               rtol=1e-9)  # fmt: skip


def short(random: np.random.Generator, levels: Sequence[float], n: int = 110) -> list[np.ndarray]:
    return [level * random.standard_normal(n) for level in levels]


def test_short_recordings_of_one_level_are_found_alike() -> None:
    found = [level_ratio(r, r) for r in (short(np.random.default_rng(k), (2.0,) * 4) for k in range(400))]
    assert sum(bool(np.any(sizes != 1.0)) for sizes in found) <= 1  # one in ten thousand by chance


def test_gains_set_for_each_test_show_in_few_samples() -> None:
    """Levels of 1, 2 and 4 on a slow pulse a hundred times as large: what is rough is the noise."""
    pulse = 100.0 * np.sin(np.linspace(0.0, np.pi, 110))
    random, told = np.random.default_rng(3), []
    for _ in range(50):
        noisy = short(random, (1.0, 2.0, 4.0))
        told.append(level_ratio(noisy, [pulse + v for v in noisy]))
    # of 50 draws, each told to 1.6/sqrt(110): 5 % is 2.3 standard errors
    assert np.mean(told, axis=0) == pytest.approx([0.5, 1.0, 2.0], rel=0.05)


def test_noise_in_proportion_to_the_range_is_no_mismatch() -> None:
    found = [diagnose(drop(), dropped({}, seed, rate=300.0)) for seed in range(4)]
    assert {f.verdict for f in found} == {"no-mismatch"}


def markov(random: np.random.Generator, sigma: float, memory: float, n: int = 1200) -> np.ndarray:
    """x_t = memory x_(t-1) + e_t with a standard deviation of sigma, (n,)."""
    driven = random.standard_normal(n + 200) * sigma * np.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], driven)[200:])


def pulses(random: np.random.Generator, sigma: float, n: int = 1200, width: int = 7) -> np.ndarray:
    """Smooth pulses of seven samples, one after another, with a standard deviation of sigma, (n,)."""
    shape = np.hanning(width + 2)[1:-1]
    return np.convolve(random.standard_normal(n + width - 1), sigma * shape / np.linalg.norm(shape), "valid")


@pytest.mark.parametrize(("loud", "slow", "taken"), [(1.0, 0.0, True), (2.4, 0.0, True), (1.0, 2.2, False)])
def test_only_noise_louder_at_all_frequencies_is_noise(loud: float, slow: float, taken: bool) -> None:
    """Noise with a memory of 0.34, 2.4 times as loud as at rest: by itself, or with pulses of 2.2 times its size.

    Both have a standard deviation of 2.4. What drives the noise, its rough part, is louder in the first and much as it
    was in the second: of pulses next to nothing is rough.
    """
    e = recorded(np.random.default_rng(6).standard_normal(N))
    s = replace(e.signals[0], at_rest=(1.0, (0.34,)))
    for seed in range(20):
        random = np.random.default_rng([6, seed])
        sigma, ar = autoregression.autoregression([markov(random, loud, 0.34) + pulses(random, slow)])
        assert (autoregression.channels_with_slow_residuals([(0, 0, s, sigma, ar)]) == set()) is taken, seed
