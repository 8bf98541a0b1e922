"""Figures of a study: every case in order, the output along each axis, a map over both axes of a grid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.studies.runner import Conducted
from rollover.studies.study import Study, axis_unit
from viz.content.blocks import Block, Figure
from viz.figures import plots
from viz.figures.heat_map import heat_map
from viz.figures.plots import Curve, Level

Array = NDArray[np.float64]
MOST_POINTS = 1200  # of a scatter plot; the extremes are among them
MOST_AXES = 6  # axes that are drawn
BINS = 12  # of the mean along an axis


def labels(study: Study) -> dict[str, str]:
    """Name of each axis with its unit: ``speed, m/s``; a factor or an offset says that it is one."""
    found = {}
    for axis in study.axes:
        unit = axis_unit(study.scenario, axis)
        what = {"factor": "factor", "offset": "offset", "value": ""}[axis.apply]
        parts = [axis.name, " ".join(filter(None, (what, unit if unit != "1" or not what else "")))]
        found[axis.name] = ", ".join(filter(None, parts))
    return found


def in_order(y: Array, label: str, levels: Sequence[Level], *, drawn: bool) -> Figure:
    """Values (n,) of all cases by size; of draws that is their quantile function."""
    values = np.sort(y[np.isfinite(y)])
    if not drawn:
        curve = Curve(name=label, x=np.arange(1.0, len(values) + 1.0), y=values)
        svg = plots.xy([curve], across="rank of the case", label=label, levels=levels)
        return Figure(svg=svg, caption="The cases of the plan, the least first.")
    share = (np.arange(len(values)) + 0.5) / len(values)
    curve = Curve(name=label, x=100.0 * share, y=values)
    svg = plots.xy([curve], across="share of cases below, %", label=label, levels=levels)
    return Figure(svg=svg, caption="Every case in order: the quantile function.")


def responses(study: Study, done: Conducted, y: Array, label: str, levels: Sequence[Level]) -> list[Block]:
    """The output along each axis: points and their mean; of two axes' grid a curve for each level of the other."""
    label_of = labels(study)
    numeric = [a.name for a in study.axes if done.points.columns[a.name].dtype != object][:MOST_AXES]
    found: list[Block] = []
    if len(study.axes) == 2 and study.plan.kind == "grid":
        first, second = (axis.name for axis in study.axes)
        svg = heat_map(
            done.points.columns[first],
            done.points.columns[second],
            y,
            across=label_of[first],
            up=label_of[second],
            label=label,
        )
        found.append(Figure(svg=svg, caption=f"{label} over both axes; a cross is a case without it."))
        for name, other in ((first, second), (second, first)):
            if name in numeric:
                svg = plots.xy(_curves(done, y, name, other), across=label_of[name], label=label, levels=levels)
                found.append(Figure(svg=svg, caption=f"Along {name}, a curve for each {label_of[other]}."))
        return found
    for name in numeric:
        x = np.asarray(done.points.columns[name], dtype=float)
        good = np.isfinite(y)
        kept = _thinned(x[good], y[good])
        points = Curve(name="cases", x=x[good][kept], y=y[good][kept], role="muted")
        svg = plots.scatter([points], across=label_of[name], label=label, line=_mean(x[good], y[good]), levels=levels)
        whole = int(good.sum())
        count = f"{len(kept)} of {whole} cases, the extremes among them" if len(kept) < whole else "All cases"
        found.append(Figure(svg=svg, caption=f"{count}; the line is the mean of parts of equal count."))
    return found


def _curves(done: Conducted, y: Array, name: str, other: str) -> list[Curve]:
    x, z = np.asarray(done.points.columns[name], dtype=float), done.points.columns[other]
    levels = np.unique(z)
    if len(levels) > len(plots.CYCLE):
        levels = levels[np.linspace(0, len(levels) - 1, len(plots.CYCLE)).round().astype(int)]
    found = []
    for k, level in enumerate(levels):
        at = np.flatnonzero(z == level)
        at = at[np.argsort(x[at])]
        found.append(
            Curve(
                name=f"{other} {level}" if isinstance(level, str) else f"{other} {level:g}",
                x=x[at],
                y=y[at],
                role=plots.CYCLE[k],
            )
        )
    return found


def _thinned(x: Array, y: Array) -> NDArray[np.int64]:
    """At most about `MOST_POINTS` places, evenly along, with the extremes of both."""
    if len(x) <= MOST_POINTS:
        return np.arange(len(x))
    ends = {int(f(v)) for v in (x, y) for f in (np.argmin, np.argmax)}
    return np.array(sorted({*range(0, len(x), -(-len(x) // MOST_POINTS)), *ends}))


def _mean(x: Array, y: Array) -> Curve | None:
    parts = [p for p in np.array_split(np.argsort(x, kind="stable"), min(BINS, max(1, len(x) // 5))) if len(p)]
    if len(parts) < 2:
        return None
    return Curve(name="mean", x=np.array([x[p].mean() for p in parts]), y=np.array([y[p].mean() for p in parts]))
