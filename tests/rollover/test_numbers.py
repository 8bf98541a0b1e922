"""Numbers in sentences: no power of ten where a plain number says the same."""

from __future__ import annotations

import pytest

from rollover.system.numbers import brief, percent


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (280.4, "280"),
        (99.6, "100"),
        (1234567.0, "1234567"),
        (-283.0, "-283"),
        (12.34, "12"),
        (0.0832, "0.083"),
        (8.3e-5, "8.3e-05"),
        (0.0, "0"),
        (-0.0, "0"),
        (float("inf"), "inf"),
    ],
)
def test_two_figures_without_a_power_of_ten_above_one(value: float, text: str) -> None:
    assert brief(value) == text


def test_a_share_in_percent() -> None:
    assert [percent(share) for share in (0.0123, 1.2, 0.0, 3e-7)] == ["1.2 %", "120 %", "0 %", "3e-05 %"]
