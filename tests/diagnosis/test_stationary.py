"""The autoregression behind misfits is a process that lasts, however short and slow they are."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from rollover.diagnosis.noise.autoregression import autoregression
from rollover.diagnosis.settings import SETTINGS

LARGEST = SETTINGS.noise.autoregression.largest_root


@pytest.mark.parametrize("size", [30, 60, 120])
@pytest.mark.parametrize("count", [1, 3])
def test_random_walks_have_a_finite_level(size: int, count: int) -> None:
    most = 1.0 / np.sqrt(1.0 - LARGEST**2)  # closed form: standard deviation of a memory over that of its steps
    corrected = 0
    for seed in range(100):
        random = np.random.default_rng(seed)
        walks = [np.cumsum(random.normal(size=size)) for _ in range(count)]
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sigma, ar = autoregression(walks, 1)
        assert not ar or abs(ar[0]) < 1.0
        steps = np.concatenate([np.diff(w) for w in walks])
        if ar and ar[0] == pytest.approx(LARGEST, abs=1e-12):
            corrected += 1
            assert sigma == pytest.approx(most * np.sqrt(np.mean(steps**2)), rel=0.15)
    assert corrected or size > 100, "the case is met"


def test_a_stable_memory_is_corrected_as_before() -> None:
    random = np.random.default_rng(3)
    series = np.zeros(80)
    for k in range(1, 80):
        series[k] = 0.8 * series[k - 1] + random.normal()
    y, x = series[1:], series[:-1]
    _, ar = autoregression([series], 1)
    assert ar == (pytest.approx(float(x @ y / (x @ x)) * (1.0 + 2.0 / 79.0), rel=1e-12),)
