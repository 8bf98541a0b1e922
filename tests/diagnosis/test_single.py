"""The noise of single samples, told from that of means and from what varies within these."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from rollover.diagnosis.overlay import single_sample_noise
from rollover.recording.filters import filtered


@pytest.mark.parametrize("many", [2, 5, 9, 20])
@pytest.mark.parametrize("ar", [0.0, 0.5, 0.9])
def test_autocorrelated_samples_do_not_average_as_white_noise(ar: float, many: int) -> None:
    noise = lfilter([1.0], [1.0, -ar], np.random.default_rng(many).standard_normal(60_000))
    means = noise[: noise.size // many * many].reshape(-1, many).mean(axis=1)
    found = single_sample_noise(noise, float(np.std(means)), many)
    assert found == pytest.approx(np.std(noise), rel=0.06)
    if ar == 0.9 and many > 2:
        assert found < 0.8 * np.sqrt(many) * np.std(means)


def test_single_samples_behind_a_filter_and_at_a_contact() -> None:
    """CFC 600 at 10 kHz: a tenth of the samples, at the impact, hold a misfit of twenty times the noise."""
    noise = filtered(np.random.default_rng(1).standard_normal(5000), 1e-4, 600)
    means = noise.reshape(-1, 10).mean(axis=1)
    first_impact = np.zeros(5000)
    first_impact[1000:1500] = 20.0 * np.std(noise) * np.sin(np.linspace(0.0, 40.0, 500))
    assert single_sample_noise(noise + first_impact, float(np.std(means)), 10) == pytest.approx(np.std(noise), rel=0.1)


def test_without_averaging_the_noise_is_that_of_samples() -> None:
    assert single_sample_noise(np.arange(9.0), 0.3, 1) == 0.3
    assert single_sample_noise(np.arange(3.0), 0.3, 9) == 0.3
