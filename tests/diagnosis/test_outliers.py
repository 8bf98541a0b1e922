"""Bursts in a channel: its noise is that beside them, they are a mismatch, and noise itself has none."""

from __future__ import annotations

import numpy as np
import pytest

from rollover.diagnosis.fit.linearisation import ResidualBlock
from rollover.diagnosis.inference.lack_of_fit import mismatch_of
from rollover.diagnosis.noise import autoregression
from rollover.diagnosis.noise.spectral_lines import outlier_p_value, without_outliers
from rollover.diagnosis.settings import SETTINGS
from tests.diagnosis.test_ensemble import SIGMA, STEP, N, dataset


def loose(rng: np.random.Generator, n: int = N, ensemble_validated: int = 3) -> np.ndarray:
    """Noise of a contact that fails for three samples, or so many, fifteen times in 300."""
    found = SIGMA * rng.standard_normal(n)
    for start in np.arange(0, n - 3, 20) + rng.integers(0, 16, len(range(0, n - 3, 20))):
        found[start : start + ensemble_validated] -= 30.0 * SIGMA
    return found


def test_what_lies_far_off_gives_way_to_samples_beside_it() -> None:
    rng = np.random.default_rng(1)
    plain = rng.standard_normal(4000) + np.sin(np.arange(4000) / 40.0)
    assert np.mean(without_outliers(plain) != plain) < 1e-3
    assert np.std(without_outliers(loose(rng, 4000))) == pytest.approx(SIGMA, rel=0.1)
    digits = np.where(np.arange(400) % 10 == 0, 1.0, 0.0)
    for kept in (plain[:40], digits, np.where(np.arange(400) % 5 < 2, 90.0, plain[:400])):
        np.testing.assert_array_equal(without_outliers(kept), kept)  # too few; no noise; bursts that are the rule


def test_noise_is_that_beside_the_outliers() -> None:
    """They leave no window quiet: by windows it would be several times as large."""
    rng = np.random.default_rng(2)
    several = [dataset(loose(rng)) for _ in range(4)]
    for e in autoregression.with_noise_of_quiet_stretches(several, [e.signals[0].values for e in several]):
        # 15 % of the samples are the middle of their neighbours, which is quieter: 6 % low, and 3 % of so few samples
        assert e.signals[0].noise == pytest.approx(SIGMA, rel=0.1)
    for e in autoregression.with_noise_of_residuals(several, [loose(rng, ensemble_validated=1) for _ in several]):
        assert e.signals[0].noise == SIGMA  # as it was held


def test_far_off_is_too_often_what_no_noise_has() -> None:
    rng = np.random.default_rng(3)
    assert outlier_p_value([rng.standard_normal(500) for _ in range(9)]) > 0.9
    assert outlier_p_value([rng.standard_t(4, 500) for _ in range(9)]) > 0.9
    assert outlier_p_value([50.0 * rng.standard_normal(500)]) > 0.9  # all of it is off: that is for the others to say
    assert outlier_p_value([rng.standard_normal(500), loose(rng, 500) / SIGMA]) < 1e-12
    assert outlier_p_value([]) == 1.0


def test_rare_outliers_are_a_mismatch_though_they_are_rough() -> None:
    rng = np.random.default_rng(4)
    times = STEP * np.arange(N)
    found = []
    for many in (0, 6):
        off = SIGMA * rng.standard_normal(N)
        off[rng.permutation(N)[:many]] += (
            1.5 * SETTINGS.noise.outliers.outlier_distance * SIGMA * rng.choice([-1.0, 1.0], many)
        )
        e = dataset(off)
        block = ResidualBlock(residual=e.whitened(off), J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1e-3)
        found.append(mismatch_of([e], [block], [((times[0], "rest"),)]).p_value)
    assert found[0] > 0.05
    assert found[1] > 0.01  # as few as any recorder may have
    off[rng.permutation(N)[:24]] += 1.5 * SETTINGS.noise.outliers.outlier_distance * SIGMA * rng.choice([-1.0, 1.0], 24)
    block = ResidualBlock(residual=e.whitened(off), J=np.zeros((N, 0)), slope=np.zeros(N), shift=0.0, prior=1e-3)
    assert mismatch_of([e], [block], [((times[0], "rest"),)]).p_value < 1e-9
