"""A map of one number over two axes of a grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viz.figures.plots import COLOURS, canvas, finish, shades
from viz.figures.svg import number_label

# cells and their numbers are the same on a dark page: none of these is a colour of `COLOURS`, which the page turns
PAPER, DEEP, OPPOSITE = "#dfeaf6", "#1f5fa9", "#c4600d"  # of the least value, the largest, the least signed one
WHITE, INK = "#ffffff", "#22272f"  # of numbers on dark cells and on others
DARK = 0.735  # share of the way to `DEEP` from where white is read better than ink, by the ratios of WCAG: 3.9 for both
DARK_SIGNED = 0.94  # the same on the way to `OPPOSITE`, which is lighter
MOST_NUMBERS = 120  # cells up to which each carries its number
MOST_LETTERS = 36  # side by side below a map: a letter of 9 points is 0.07 inches wide, the map 2.6


def heat_map(
    x: NDArray[Any],
    y: NDArray[Any],
    values: NDArray[np.float64],
    *,
    across: str,
    up: str,
    label: str,
    signed: bool = False,
    span: tuple[float, float] | None = None,
) -> str:
    """Cells of equal size at the levels of x and y (n,), numbers or words, coloured by `values` (n,), NaN crossed.

    Colours go from the least value to the largest, or over a `span` of values that means something by itself. `signed`
    values go from -1 to 1, and are the darker the farther they are from 0.
    """
    columns, rows = (list(dict.fromkeys(sorted(v.tolist()) if v.dtype != object else v.tolist())) for v in (x, y))
    cells = np.full((len(rows), len(columns)), np.nan)
    for a, b, value in zip(x.tolist(), y.tolist(), values, strict=True):
        cells[rows.index(b), columns.index(a)] = value
    low, high = span or ((-1.0, 1.0) if signed else (float(np.nanmin(cells)), float(np.nanmax(cells))))
    with canvas(4.6, 3.2) as (figure, svg):
        axes = figure.add_subplot()
        colours = shades(OPPOSITE, PAPER, DEEP) if signed else shades(PAPER, DEEP)
        mesh = axes.pcolormesh(cells, cmap=colours, vmin=low, vmax=high, edgecolors=COLOURS["grid"], linewidth=0.4)
        for (i, j), value in np.ndenumerate(cells):
            if not np.isfinite(value):
                axes.plot([j + 0.5], [i + 0.5], ls="", marker="x", color=COLOURS["limit"])
            elif cells.size <= MOST_NUMBERS:
                dark = high > low and (value > DARK if signed else value - low > DARK * (high - low))
                dark = dark or (signed and value < -DARK_SIGNED)
                axes.text(
                    j + 0.5, i + 0.5, number_label(value, values, 3), ha="center", va="center", fontsize=7,
                    color=WHITE if dark else INK,
                )  # fmt: skip
        for axis, levels in ((axes.xaxis, columns), (axes.yaxis, rows)):
            step = max(1, -(-len(levels) // 12))
            ticks = [v if isinstance(v, str) else f"{v:.4g}" for v in levels]
            axis.set_ticks([k + 0.5 for k in range(0, len(levels), step)], ticks[::step])
        if any(isinstance(v, str) for v in columns) and sum(map(len, map(str, columns))) > MOST_LETTERS:
            axes.tick_params(axis="x", labelrotation=30.0)
            for tick in axes.get_xticklabels():
                tick.set(horizontalalignment="right", rotation_mode="anchor")
        bar = figure.colorbar(mesh, ax=axes)
        bar.set_label(label, color=COLOURS["ink"])
        bar.outline.set_visible(False)
        bar.solids.set_rasterized(False)  # as shapes: the page allows no images within pictures
        bar.solids.set_edgecolor("face")  # without which the page shows through the seams, and colours are paler
        finish(axes, across, up, margins=(0.0, 0.0))
        axes.grid(visible=False)
    return svg.text
