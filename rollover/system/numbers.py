"""Numbers in sentences and tables: two figures, and no power of ten where a plain number says the same."""

from __future__ import annotations

Z95 = 1.959963984540054  # standard normal quantile: 95 % lie within as many standard deviations


def brief(value: float) -> str:
    """Two figures, whole where there are more of them before the point: 0.083, 8.3, 283; 8.3e-05 of what is tiny."""
    text = f"{value + 0.0:.2g}"  # no -0
    return f"{value:.0f}" if "e+" in text else text


def percent(share: float) -> str:
    """A share of 1 in percent, `brief`: 0.0123 is "1.2 %"."""
    return f"{brief(100.0 * share)} %"
