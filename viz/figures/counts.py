"""Figures of counts, drawn by hand: shares with their intervals, and a confusion matrix. Each returns one ``<svg>``.

They take their colours from the page's style sheet like those of `viz.figures.plots`, print, and need no script.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from viz.figures.plots import COLOURS

ROW, CELL, LETTER = 22, 24, 6.4  # px: height of a row, edge of a cell, width of a letter at 12 px
WIDTH = 720


@dataclass(frozen=True, kw_only=True)
class Share:
    """`hits` of `of` with the interval `low` to `high` around them, shares of one; `aim` is where it should lie."""

    name: str
    hits: int
    of: int
    low: float
    high: float
    aim: tuple[float, float] | None = None


def shares(rows: Sequence[Share]) -> str:
    """A dot for each share on 0 to 100 % with its interval as a bar; where it should lie is shaded."""
    left = 24 + LETTER * max((len(r.name) for r in rows), default=0)
    right, height = WIDTH - 150, ROW * len(rows) + 34
    found = [_open(WIDTH, height, "shares with their 95 % intervals")]
    for k in range(5):
        x = left + 0.25 * k * (right - left)
        found.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="4" y2="{height - 26}" stroke="{_colour("grid")}"/>')
        found.append(_text(x, height - 10, f"{25 * k} %", "middle", "muted"))
    for k, r in enumerate(rows):
        y = ROW * k + 0.5 * ROW + 4
        x, low, high = (left + (right - left) * share for share in (r.hits / r.of if r.of else 0.0, r.low, r.high))
        if r.aim is not None:
            a, b = (left + (right - left) * share for share in r.aim)
            shade = f'fill="{_colour("third")}" opacity="0.18"'
            found.append(f'<rect x="{a:.1f}" y="{y - 8:.1f}" width="{b - a:.1f}" height="16" {shade}/>')
        line = f'stroke="{_colour("first")}"'
        found.append(_text(left - 12, y + 4, r.name, "end", "ink"))
        found.append(f'<line x1="{low:.1f}" x2="{high:.1f}" y1="{y:.1f}" y2="{y:.1f}" {line} stroke-width="2"/>')
        for end in (low, high):
            found.append(f'<line x1="{end:.1f}" x2="{end:.1f}" y1="{y - 4:.1f}" y2="{y + 4:.1f}" {line}/>')
        found.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{_colour("first")}"/>')
        found.append(_text(right + 14, y + 4, f"{r.hits} of {r.of}", "start", "ink"))
    return "".join([*found, "</svg>"])


def confusion(
    table: Mapping[str, Mapping[str, int]], right: Callable[[str, str], bool], *, last: str = "nothing"
) -> str:
    """Truth down, what was named first across, counts in the cells, green where `right` (truth, named) says so.

    The truth `last` stands below the others.
    """
    truths = sorted(table, key=lambda name: (name == last, name))
    named = {said for line in table.values() for said in line}
    across = [*truths, *sorted(named - set(truths))]
    across = [name for name in across if name in named or name in truths]
    left = 16 + LETTER * max((len(name) for name in truths), default=0)
    top = 16 + LETTER * max((len(name) for name in across), default=0)
    width, height = left + CELL * len(across) + 8, top + CELL * len(truths) + 8
    found = [_open(width, height, "confusion matrix: truth down, what was named first across")]
    for k, name in enumerate(across):
        x = left + CELL * (k + 0.5) + 4
        turn = f'transform="rotate(-90 {x:.1f} {top - 6:.1f})"'
        found.append(_text(x, top - 6, name, "start", "ink", turn))
    for i, truth in enumerate(truths):
        y, total = top + CELL * i, sum(table[truth].values())
        found.append(_text(left - 8, y + 0.5 * CELL + 4, truth, "end", "ink"))
        for k, name in enumerate(across):
            x, count = left + CELL * k, table[truth].get(name, 0)
            role = "third" if right(truth, name) else "limit"
            place = f'x="{x:.1f}" y="{y:.1f}" width="{CELL - 1}" height="{CELL - 1}"'
            found.append(f'<rect {place} fill="none" stroke="{_colour("grid")}"/>')
            if count:
                strength = 0.25 + 0.6 * count / total
                title = f"<title>{escape(truth)}: {count} of {total} named {escape(name)}</title>"
                found.append(f'<rect {place} fill="{_colour(role)}" opacity="{strength:.2f}">{title}</rect>')
                found.append(_text(x + 0.5 * CELL, y + 0.5 * CELL + 4, str(count), "middle", "ink"))
    return "".join([*found, "</svg>"])


def _open(width: float, height: float, label: str) -> str:
    wide = f"{width:.0f}px"
    size = f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width:{wide}; --natural:{wide}" font-size="12"'
    return f'<svg role="img" aria-label="{escape(label)}" {size}>'


def _text(x: float, y: float, text: str, anchor: str, role: str, more: str = "") -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{_colour(role)}" {more}'.rstrip()
    return f"<text {place}>{escape(text)}</text>"


def _colour(role: str) -> str:
    return f"var(--{role}, {COLOURS[role]})"
