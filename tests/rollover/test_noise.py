"""The noise floor: level, colour and independence of known noise under a signal with a pulse and jumps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.recording.filters import filtered
from rollover.recording.noise_floor import noise_floor

N, STEP = 20_000, 1e-4


def signal(n: int = N) -> np.ndarray:
    t = np.arange(n) * STEP
    pulse = np.where((t > 0.3) & (t < 0.4), 1000.0 * np.sin(np.pi * (t - 0.3) / 0.1) ** 2, 0.0)
    return np.asarray(pulse + 30.0 * t**2 + np.where(t > 0.9, 200.0, 0.0) - np.where(t > 0.31, 40.0, 0.0))


def noise(kind: str, seed: int, n: int = N) -> np.ndarray:
    white = np.random.default_rng(seed).standard_normal(n + 5000)
    if kind.startswith("ar"):
        a = float(kind[2:])
        return np.asarray(lfilter([1.0], [1.0, -a], white)[5000:] * np.sqrt(1.0 - a * a))
    if kind.startswith("cfc"):
        made = filtered(white, STEP, int(kind[3:]))
        return np.asarray(made / made.std())[5000:]
    return white[5000:]


# independence of an autoregression of order 1: sum over all lags of a^|k| = (1 + a)/(1 - a)
KINDS = {"white": 1.0, "ar0.5": 3.0, "ar0.8": 9.0, "ar-0.5": 1.0, "cfc1000": None, "cfc600": None, "cfc180": None}


@pytest.mark.parametrize("kind", KINDS)
def test_level_within_a_tenth(kind: str) -> None:
    found = [noise_floor(signal() + 3.0 * noise(kind, seed)) for seed in range(5)]
    assert [f.sigma for f in found] == pytest.approx([3.0] * 5, rel=0.1)
    if KINDS[kind] is not None:
        assert np.mean([f.independence for f in found]) == pytest.approx(KINDS[kind], rel=0.2)


@pytest.mark.parametrize("kind", ["white", "ar0.8", "cfc180"])
def test_the_mean_scatters_as_it_says(kind: str) -> None:
    means = np.array([noise(kind, seed)[:4000].mean() for seed in range(300)])
    said = noise_floor(signal() + noise(kind, 0)).of_mean(4000)
    assert said == pytest.approx(means.std(), rel=0.25)  # 300 means tell their scatter within 4 % (1 sigma)


@pytest.mark.parametrize("kind", ["white", "ar0.5", "ar0.8"])
def test_the_autoregression_whitens(kind: str) -> None:
    x = noise(kind, 2)
    floor = noise_floor(signal() + x)
    left = lfilter([1.0, *(-a for a in floor.ar)], [1.0], x)[50:]
    for lag in (1, 2, 5):
        assert abs(np.corrcoef(left[:-lag], left[lag:])[0, 1]) < 0.03


@pytest.mark.parametrize("kind", ["ar0.8", "cfc180"])
def test_drawn_noise_has_level_and_colour(kind: str) -> None:
    x = noise(kind, 3)
    drawn = noise_floor(signal() + x).drawn(100_000, np.random.default_rng(5))[0]
    assert drawn.std() == pytest.approx(1.0, rel=0.1)
    for lag in (1, 5, 20):
        expected = np.corrcoef(x[:-lag], x[lag:])[0, 1]
        assert np.corrcoef(drawn[:-lag], drawn[lag:])[0, 1] == pytest.approx(expected, abs=0.12)


def test_a_smooth_signal_has_none() -> None:
    assert noise_floor(np.linspace(0.0, 1.0, 500) ** 3).sigma == 0.0
    assert noise_floor(np.full(500, 7.0)).sigma == 0.0


def test_too_few_samples() -> None:
    with pytest.raises(ValueError, match="too few for a noise floor, got 20"):
        noise_floor(np.zeros(20))


@pytest.mark.filterwarnings("error")
def test_values_whose_squares_are_no_numbers_have_none() -> None:
    values = np.where(np.arange(200) == 100, 1e308, 0.0)
    assert noise_floor(values).sigma == 0.0
