"""Intervals of fitted values, one below the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viz.figures.plots import COLOURS, WIDTH, canvas, finish

Array = NDArray[np.float64]


def spans(names: Sequence[str], wide: Array, narrow: Array, was: Array, found: Array, *, label: str) -> str:
    """For each name an interval and a narrower one within it, (n, 2) each, with a value before and after, (n,)."""
    with canvas(WIDTH, 0.8 + 0.32 * len(names)) as (figure, svg):
        axes = figure.add_subplot()
        rows = np.arange(len(names))
        axes.hlines(rows, *wide.T, color=COLOURS["muted"], lw=2.0, label="95 %")
        axes.hlines(rows, *narrow.T, color=COLOURS["first"], lw=6.0, label="95 %, if the others were known")
        for values, mark, role, name in ((was, "|", "second", "was"), (found, "o", "ink", "is")):
            axes.plot(values, rows, ls="", marker=mark, ms=5 if mark == "o" else 11, color=COLOURS[role], label=name)
        axes.set_yticks(rows, names)
        axes.invert_yaxis()
        finish(axes, label, "", margins=(0.03, 0.25))
        axes.grid(axis="y", visible=False)
    return svg.text
