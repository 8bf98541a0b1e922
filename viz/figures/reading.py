"""What lets a figure be read off and enlarged in a page: where its axes lie, what they span, which lines are curves."""

from __future__ import annotations

import html
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_POINTS = 1600  # of a curve, a few for each pixel across
CURVE = "curve"  # how ids of curves begin


def thinned(x: Array, y: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """At most about `most` points, among them the extremes of x and of y in every stretch: a spike of one sample stays.

    Points (n,) each are taken by stretches of equal count; gaps (NaN) stay gaps.
    """
    n = len(x)
    if n <= most:
        return x, y
    kept = {0, n - 1}
    for part in np.array_split(np.arange(n), max(1, most // 5)):
        good = part[np.isfinite(x[part]) & np.isfinite(y[part])]
        if len(good) < len(part):
            kept.add(int(part[~(np.isfinite(x[part]) & np.isfinite(y[part]))][0]))
        if len(good):
            kept |= {int(good[f(v[good])]) for v in (x, y) for f in (np.argmin, np.argmax)}
    at = np.array(sorted(kept))
    return x[at], y[at]


def marked(axes: Any, line: Any) -> None:
    """Give a line of some axes an id by which it is found again in the drawn figure."""
    line.set_gid(f"{CURVE}{axes.get_figure().axes.index(axes)}-{len(axes.lines)}")


def readable(svg: str, figure: Any) -> str:
    """A drawn ``<svg>`` that says of its axes where they lie in it (points), what they span, and names of curves.

    Only axes with even scales and marked curves; a figure without any is left as it is.
    """
    width, height = 72.0 * figure.get_size_inches()
    found = []
    for axes in figure.axes:
        curves = [[line.get_gid(), line.get_label()] for line in axes.lines if str(line.get_gid()).startswith(CURVE)]
        if not curves or axes.name != "rectilinear" or {axes.get_xscale(), axes.get_yscale()} != {"linear"}:
            continue
        place = axes.get_position()
        box = [place.x0 * width, (1.0 - place.y1) * height, place.width * width, place.height * height]
        across = axes.get_xlabel() or figure.axes[-1].get_xlabel()  # of a figure whose panels share it
        found.append(
            {
                "box": [round(float(v), 2) for v in box],
                "x": [float(f"{v:.9g}") for v in axes.get_xlim()],
                "y": [float(f"{v:.9g}") for v in axes.get_ylim()],
                "across": across,
                "up": axes.get_ylabel(),
                "curves": curves,
            }
        )
    if not found:
        return svg
    axes_data = html.escape(json.dumps(found, separators=(",", ":")), quote=True)
    return svg.replace('<svg role="img"', f'<svg role="img" data-axes="{axes_data}"', 1)
