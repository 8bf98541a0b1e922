"""Stacks of signals are whitened one by one: by their noise, its colour, what grows, and what they count."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.whitening import Noise, Whitening
from rollover.recording import Recording
from rollover.recording.noise_floor import grown
from tests.diagnosis.drops import FORCE, signal


def stack(*noises: Noise) -> Whitening:
    return Whitening(noises)


def test_a_stack_is_whitened_signal_by_signal() -> None:
    """g (x_i - a_1 x_i-1 - a_2 x_i-2) of the second alone: nothing of the first comes in, which has no colour."""
    x = np.random.default_rng(1).standard_normal(30)
    ar = (0.5, 0.2)
    white = Noise(count=10, sigma=2.0, ar=(), sd=None, weight=None)
    coloured = Noise(count=20, sigma=4.0, ar=ar, sd=None, weight=None)
    y = stack(white, coloured)(x)
    assert np.array_equal(y[:10], x[:10] / 2.0)
    expected = grown(ar) * lfilter([1.0, -0.5, -0.2], [1.0], x[10:] / 4.0)
    assert y[12:] == pytest.approx(expected[2:], rel=1e-12)
    assert np.array_equal(y[10:12], np.zeros(2)), "no past to whiten with"


def test_growing_noise_is_scaled_before_whitening() -> None:
    rng = np.random.default_rng(2)
    x, sd, weight = rng.standard_normal(12), np.linspace(1.0, 3.0, 12), np.linspace(1.0, 0.1, 12)
    y = stack(Noise(count=12, sigma=2.0, ar=(0.6,), sd=sd, weight=weight))(x)
    u = x / sd
    assert y[1:] == pytest.approx(weight[1:] * grown((0.6,)) * (u[1:] - 0.6 * u[:-1]), rel=1e-12)


def test_columns_are_whitened_each_and_what_is_handed_in_stays() -> None:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((9, 3))
    before = columns.copy()
    one = stack(Noise(count=9, sigma=0.5, ar=(0.3,), sd=None, weight=None))
    found = one(columns)
    assert np.array_equal(columns, before)
    for k in range(3):
        assert np.array_equal(found[:, k], one(columns[:, k]))


def test_a_signal_shorter_than_its_memory_tells_nothing() -> None:
    short = Noise(count=1, sigma=1.0, ar=(0.5, 0.2), sd=None, weight=None)
    assert np.array_equal(stack(short, short)(np.ones(2)), np.zeros(2))


def test_samples_after_masked_ones_have_the_full_noise() -> None:
    """Two of a memory of two follow each leap, none of the other signal, and none that leaps itself."""
    ar = (0.5, 0.2)
    wide = 1.0 / grown(ar)
    signals = (signal(np.arange(6.0), 1.0, ar), signal(np.arange(6.0), 1.0))
    recording = Recording(title="r", time=np.arange(6.0), channels={FORCE: np.arange(6.0)})
    e = Dataset(
        name="r", recording=recording, simulator=cast(Any, None), signals=signals, shift_prior=1e-3, condition=""
    )
    assert np.array_equal(e.worth(np.zeros(0, dtype=np.int64)), np.ones(12))
    found = e.worth(np.array([1, 2, 5, 8]))
    assert np.array_equal(found, [1.0, 1.0, 1.0, wide, wide, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
