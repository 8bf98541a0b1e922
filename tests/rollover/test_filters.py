"""CFC filters against the standard's own recursion and its corner frequency."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rollover.recording.filters import CLASSES, ISO_6487, J211, attenuation, filtered, least_rate

STEP = 1e-4


def by_the_letter(x: np.ndarray, step: float, cfc: int, constant: float) -> np.ndarray:
    """SAE J211: y = b0 x + b1 x' + b2 x'' - a1 y' - a2 y'', forward and backward, coefficients as printed."""
    w = math.tan(2 * math.pi * cfc * constant * step / 2)
    scale = 1 + math.sqrt(2) * w + w * w
    b, a1, a2 = w * w / scale, 2 * (w * w - 1) / scale, (1 - math.sqrt(2) * w + w * w) / scale
    for _ in range(2):
        y = np.zeros_like(x)
        for n in range(2, len(x)):
            y[n] = b * (x[n] + 2 * x[n - 1] + x[n - 2]) - a1 * y[n - 1] - a2 * y[n - 2]
        x = y[::-1]
    return x


@pytest.mark.parametrize("cfc", CLASSES)
@pytest.mark.parametrize("constant", [J211, ISO_6487])
def test_filter_is_the_standards_recursion(cfc: int, constant: float) -> None:
    t = np.arange(0.0, 0.5, STEP)
    pulse = np.where((t > 0.2) & (t < 0.22), np.sin(np.pi * (t - 0.2) / 0.02), 0.0)
    expected = by_the_letter(pulse, STEP, cfc, constant)
    assert filtered(pulse, STEP, cfc, constant=constant) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("cfc", CLASSES)
def test_corner_lies_at_five_thirds_of_the_class(cfc: int) -> None:
    corner = cfc / 0.6
    t = np.arange(0.0, 60.0 / corner, STEP)
    middle = slice(len(t) // 3, 2 * len(t) // 3)
    for frequency in (0.3 * corner, corner):
        out = filtered(np.sin(2 * np.pi * frequency * t), STEP, cfc)[middle]
        assert math.sqrt(2) * np.std(out) == pytest.approx(attenuation(frequency, STEP, cfc), rel=2e-2)
    assert 20 * math.log10(attenuation(corner, 1e-6, cfc)) == pytest.approx(-3.0, abs=0.02)


def test_constant_passes_and_phase_is_zero() -> None:
    assert filtered(np.full(500, 7.0), STEP, 60) == pytest.approx(7.0, rel=1e-9)
    bump = np.exp(-(((np.arange(2000) - 1000) * STEP / 0.01) ** 2))
    assert int(np.argmax(filtered(bump, STEP, 60))) == 1000


def test_too_slow_or_unknown_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 600 Hz"):
        filtered(np.zeros(100), 1 / 500, 60)
    with pytest.raises(ValueError, match="no such filter class"):
        filtered(np.zeros(100), STEP, 100)
    assert least_rate(180) == pytest.approx(1800.0)
