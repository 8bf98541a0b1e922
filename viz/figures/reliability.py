"""The reliability diagram: probability given across, share that came true up, one point a bin with its interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from viz.figures.plots import COLOURS

SIDE, EDGE = 260, 44  # px: the square of 0 to 1, and room for its numbers


def reliability(bins: Sequence[Mapping[str, Any]]) -> str:
    """``<svg>`` of bins with `given` (mean probability) and `right` (hits, of, share, low, high)."""
    whole = SIDE + 2 * EDGE
    size = f'viewBox="0 0 {whole} {whole}" style="max-width:{whole}px; --natural:{whole}px" font-size="12"'
    found = [f'<svg role="img" aria-label="reliability: given against came true" {size}>']
    for k in range(5):
        at = 0.25 * k
        x, y = _x(at), _y(at)
        grid = f'stroke="{_colour("grid")}"'
        found.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{_y(0.0):.1f}" y2="{_y(1.0):.1f}" {grid}/>')
        found.append(f'<line x1="{_x(0.0):.1f}" x2="{_x(1.0):.1f}" y1="{y:.1f}" y2="{y:.1f}" {grid}/>')
        found.append(_text(x, whole - 24, f"{25 * k} %", "middle"))
        found.append(_text(EDGE - 6, y + 4, f"{25 * k} %", "end"))
    found.append(_text(_x(0.5), whole - 6, "given", "middle"))
    found.append(_text(_x(0.0), 16, "came true", "start"))
    ends = f'x1="{_x(0.0):.1f}" y1="{_y(0.0):.1f}" x2="{_x(1.0):.1f}" y2="{_y(1.0):.1f}"'
    found.append(f'<line {ends} stroke="{_colour("third")}" stroke-dasharray="4 3"/>')
    for one in bins:
        right, x = one["right"], _x(one["given"])
        title = f"given {100.0 * one['given']:.0f} %: {right['hits']} of {right['of']} came true"
        bar = f'y1="{_y(right["low"]):.1f}" y2="{_y(right["high"]):.1f}" stroke="{_colour("first")}"'
        found.append(f'<line x1="{x:.1f}" x2="{x:.1f}" {bar}/>')
        dot = f'cx="{x:.1f}" cy="{_y(right["share"]):.1f}" r="4" fill="{_colour("first")}"'
        found.append(f"<circle {dot}><title>{escape(title)}</title></circle>")
    return "".join([*found, "</svg>"])


def _x(share: float) -> float:
    return EDGE + SIDE * share


def _y(share: float) -> float:
    return EDGE + SIDE * (1.0 - share)


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{_colour("muted")}">{escape(text)}</text>'


def _colour(role: str) -> str:
    return f"var(--{role}, {COLOURS[role]})"
