"""Draws of several values pair by pair: where two of them lie together, and each by itself on the diagonal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viz.figures.plots import COLOURS, canvas, finish, shades

Array = NDArray[np.float64]
BINS = 24
SHARES = (0.95, 0.68)  # of the draws within the contours
PAPER = "#dfeaf6"
INCH = 1.35  # of a panel


def corner(names: Sequence[str], draws: Array, marked: Sequence[float]) -> str:
    """Histograms of draws (n, p) on the diagonal, contours of `SHARES` below; `marked` (p,) are the fitted values."""
    p = len(names)
    size = max(2.6, INCH * p + 0.9)
    with canvas(size, size) as (figure, svg):
        panels = figure.subplots(p, p, squeeze=False)
        edges = [np.linspace(*_range(column), BINS + 1) for column in draws.T]
        for i in range(p):
            for j in range(p):
                axes = panels[i, j]
                if j > i:
                    axes.set_visible(False)
                    continue
                if i == j:
                    counts, _ = np.histogram(draws[:, i], edges[i])
                    axes.stairs(counts, edges[i], fill=True, color=PAPER)
                    axes.stairs(counts, edges[i], color=COLOURS["first"])
                    axes.set_ylim(0.0, 1.1 * max(float(counts.max()), 1.0))
                else:
                    _contours(axes, draws[:, j], draws[:, i], edges[j], edges[i])
                    axes.axhline(marked[i], color=COLOURS["second"], lw=0.8)
                axes.axvline(marked[j], color=COLOURS["second"], lw=0.8)
                finish(axes, names[j] if i == p - 1 else "", names[i] if 0 == j < i else "", margins=(0.0, 0.0))
                axes.set_xlim(edges[j][0], edges[j][-1])
                axes.locator_params(nbins=3)
                axes.tick_params(labelsize=7, labelbottom=i == p - 1, labelleft=0 == j < i)
                axes.xaxis.label.set_size(7)
                axes.yaxis.label.set_size(7)
    return svg.text


def _contours(axes: object, x: Array, y: Array, across: Array, up: Array) -> None:
    """Regions that hold `SHARES` of the draws."""
    counts, _, _ = np.histogram2d(x, y, (across, up))
    levels = highest(counts)
    middle = [0.5 * (e[1:] + e[:-1]) for e in (across, up)]
    axes.contourf(  # type: ignore[attr-defined]
        *middle, counts.T, levels=[*levels, counts.max() + 1.0], cmap=shades(PAPER, COLOURS["first"])
    )


def highest(counts: Array) -> list[float]:
    """Counts of a cell from which on cells hold each of `SHARES` of all draws, rising."""
    falling = np.sort(counts.ravel())[::-1]
    held = np.cumsum(falling) / falling.sum()
    found = [float(falling[int(np.searchsorted(held, share))]) for share in SHARES]
    return [found[0], max(found[1], found[0] + 0.5)]


def _range(values: Array) -> tuple[float, float]:
    """From the least to the most of nearly all draws; about a value that none leaves."""
    low, high = np.quantile(values, [0.001, 0.999])
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)
