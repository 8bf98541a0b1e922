"""Figures as inline SVG: the same data gives the same bytes, colours follow the page, and no peak is lost.

Every function returns the text of one ``<svg>`` element for `page.Figure`. Values are given in the unit that the
axis names; nothing is converted here.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from textwrap import fill
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from viz.figures.reading import marked, readable
from viz.figures.reading import thinned as thinned
from viz.figures.svg import cleaned, number_label, panel_height

Array = NDArray[np.float64]
Role = Literal["first", "second", "third", "fourth", "limit", "muted", "ink"]

# the page's colours by role: the CSS variable of the same name, and what stands where there is no style sheet
COLOURS: dict[str, str] = {
    "first": "#1f5fa8",
    "second": "#c4600c",
    "third": "#3f7d3a",
    "fourth": "#7a4fa3",
    "limit": "#b3261e",
    "muted": "#7c8794",
    "ink": "#22272e",
    "grid": "#d5dae0",
}
CYCLE: tuple[Role, ...] = ("first", "second", "third", "fourth", "muted")
LETTERS = 14  # of a legend to an inch
PHASE_LETTERS, LINE = 16, 9.5  # of the names of phases to an inch; from one line of these to the next, points
WIDTH, HEIGHT = 7.2, 2.7  # inch
# of a figure: laid out by hand where there are many, which takes half the time
MARGINS = {"left": 0.13, "right": 0.975, "top": 0.935, "bottom": 0.105, "hspace": 0.07}
LINEAR = 10.0  # times the noise up to which the axis of a diagnosis' residual is linear


@dataclass(frozen=True, kw_only=True)
class Curve:
    """`y` (n,) over `x` (n,); gaps are NaN. `name` stands in the legend, with the filter class where there is one.

    `spread` (n,) is the half width of a band about it.
    """

    name: str
    x: Array
    y: Array
    role: Role = "first"
    thin: bool = False  # as the raw one beside its filtered one
    spread: Array | None = None


@dataclass(frozen=True, kw_only=True)
class Level:
    """A named value to hold a curve against, such as a required energy."""

    name: str
    value: float


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A polygon or line (n, 2) of a sectional picture."""

    name: str
    points: Array
    role: Role = "ink"
    closed: bool = True
    filled: bool = False
    dashed: bool = False


@dataclass(frozen=True, kw_only=True)
class View:
    """One panel of `outlines`, to scale."""

    title: str
    across: str
    up: str
    shapes: Sequence[Outline]


def history(
    curves: Sequence[Curve],
    *,
    label: str,
    phases: Sequence[tuple[float, str]] = (),
    levels: Sequence[Level] = (),
    across: str = "time, s",
) -> str:
    """Curves over time, their phases (start, name) shaded and named; `label` is that of the ordinate, with unit."""
    with _axes() as (axes, svg):
        _draw(axes, curves)
        _level(axes, levels)
        finish(axes, across, label, margins=(0.0, 0.08))
        _shade(axes, phases)
    return svg.text


def xy(
    curves: Sequence[Curve],
    *,
    across: str,
    label: str,
    levels: Sequence[Level] = (),
    points: Sequence[tuple[str, float, float]] = (),
) -> str:
    """Force or energy against deflection; `levels` are horizontal, as a required energy is; `points` (name, x, y)."""
    with _axes(width=4.6, height=3.0) as (axes, svg):
        _draw(axes, curves)
        _level(axes, levels)
        for name, x, y in points:
            axes.plot([x], [y], marker="o", ms=4, ls="", color=COLOURS["limit"])
            axes.annotate(name, (x, y), xytext=(5, -10), textcoords="offset points", color=COLOURS["ink"])
        finish(axes, across, label, margins=(0.03, 0.08))
    return svg.text


def overlay(
    measured: Curve, simulated: Curve, *, label: str, phases: Sequence[tuple[float, str]] = (), turned: bool = False
) -> str:
    """Two curves over time, below them the residual: measured less simulated, `turned` the other way round.

    It is taken at the stamps of the first.
    """
    with canvas(WIDTH, 3.9) as (figure, svg):
        above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1.3]})
        _draw(above, [_roled(measured, "second"), _roled(simulated, "first")])
        finish(above, "", label, margins=(0.0, 0.08))
        _shade(above, phases)
        model = _at(simulated, measured.x)
        rest = model - measured.y if turned else measured.y - model
        what, (_, comma, unit) = "difference" if turned else "residual", label.rpartition(", ")
        _draw(below, [Curve(name=what, x=measured.x, y=rest, role="muted")])
        below.axhline(0.0, color=COLOURS["ink"], lw=0.6)
        finish(below, "time, s", f"{what}{comma}{unit if comma else ''}", margins=(0.0, 0.1))
        _shade(below, [(start, "") for start, _ in phases])
    return svg.text


def _at(curve: Curve, x: Array) -> Array:
    """A curve at other places, straight between those where it has a value; NaN outside of them."""
    good = np.isfinite(curve.x) & np.isfinite(curve.y)
    if not good.any():
        return np.full(x.shape, np.nan)
    return np.asarray(np.interp(x, curve.x[good], curve.y[good], left=np.nan, right=np.nan))


def before_after(
    measured: Curve,
    before: Curve,
    after: Curve | None,
    *,
    label: str,
    noise: float,
    phases: Sequence[tuple[float, str]] = (),
    unsure: Array | None = None,
) -> str:
    """Measured, simulated before and after at the same stamps; below, measured less each over `noise` (2 sigma drawn).

    `unsure` (n,) times the noise is 1 sigma of what a simulation leaves by chance, where that is more. The
    residual's axis is linear up to ten times the noise and logarithmic beyond: both misfits can be read.
    """
    with canvas(WIDTH, 4.3, layout=None) as (figure, svg):
        above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1.8], **MARGINS})
        simulated = [_roled(before, "limit"), *([] if after is None else [_roled(after, "first")])]
        x, y = thinned(measured.x, measured.y)  # wide and pale: what covers it can still be told from it
        (line,) = above.plot(x, y, color=COLOURS["second"], lw=3.2, alpha=0.55, label=measured.name)
        marked(above, line)
        _draw(above, simulated)
        finish(above, "", label, margins=(0.0, 0.08))
        _shade(above, phases)
        for curve in simulated:
            rest = Curve(name=curve.name, x=curve.x, y=(measured.y - curve.y) / noise, role=curve.role)
            _draw(below, [rest])
        if unsure is None:
            below.axhspan(-2.0, 2.0, color=COLOURS["muted"], alpha=0.18, lw=0)
        else:
            below.fill_between(measured.x, -2.0 * unsure, 2.0 * unsure, color=COLOURS["muted"], alpha=0.18, lw=0)
        below.axhline(0.0, color=COLOURS["ink"], lw=0.6)
        below.set_yscale("symlog", linthresh=LINEAR)
        low, high = below.get_ylim()
        marks = [s * 10.0**k for s in (-1.0, 1.0) for k in range(1, 7)]
        near = [m for m in (0.0, *marks) if low <= m <= high]
        below.set_yticks(near, [f"{m:g}" for m in near], minor=False)
        below.set_yticks([], minor=True)
        finish(below, "time, s", "residual / noise", margins=(0.0, 0.1), legend=False)
        _shade(below, [(start, "") for start, _ in phases])
    return svg.text


def bars(values: Mapping[str, float], *, label: str, roles: Mapping[str, Role] | None = None) -> str:
    """One horizontal bar for each name, negative ones to the left, each with its number: the energy ledger."""
    names, numbers = list(values), [v if math.isfinite(v) else 0.0 for v in values.values()]
    with _axes(height=0.5 + 0.27 * len(names)) as (axes, svg):
        colours = [COLOURS[(roles or {}).get(name, "first")] for name in names]
        axes.barh(names, numbers, color=colours, height=0.62)
        axes.invert_yaxis()
        axes.axvline(0.0, color=COLOURS["ink"], lw=0.6)
        for k, v in enumerate(numbers):
            left = v < 0.0
            axes.annotate(
                number_label(v, numbers, 3), (v, k), xytext=(-4 if left else 4, 0), textcoords="offset points",
                ha="right" if left else "left", va="center", color=COLOURS["ink"],
            )  # fmt: skip
        finish(axes, label, "", margins=(0.14, 0.02))
        axes.grid(axis="y", visible=False)
    return svg.text


def tornado(
    names: Sequence[str], low: Sequence[float], high: Sequence[float], *, centre: float, label: str, most: int = 16
) -> str:
    """What each parameter's low and high end make of the answer, around its `centre`; the widest first."""
    order = sorted(range(len(names)), key=lambda k: -abs(high[k] - low[k]))[:most]
    with _axes(height=0.6 + 0.27 * len(order)) as (axes, svg):
        for place, k in enumerate(order):
            for value, role in ((low[k], "second"), (high[k], "first")):
                axes.barh(place, value - centre, left=centre, height=0.62, color=COLOURS[role])
        axes.set_yticks(range(len(order)), [names[k] for k in order])
        axes.invert_yaxis()
        axes.axvline(centre, color=COLOURS["ink"], lw=0.8)
        for text, role in (("low end", "second"), ("high end", "first")):
            axes.plot([], [], color=COLOURS[role], lw=5, label=text)
        finish(axes, label, "", margins=(0.05, 0.02))
        axes.grid(axis="y", visible=False)
    return svg.text


def scatter(
    groups: Sequence[Curve], *, across: str, label: str, line: Curve | None = None, levels: Sequence[Level] = ()
) -> str:
    """Points by group, with a fitted line where there is one."""
    with _axes(width=4.6, height=3.0) as (axes, svg):
        for group in groups:
            axes.plot(group.x, group.y, ls="", marker="o", ms=3.2, color=COLOURS[group.role], label=group.name)
        if line is not None:
            _draw(axes, [line])
        _level(axes, levels)
        finish(axes, across, label, margins=(0.04, 0.06))
    return svg.text


def polar(curves: Sequence[Curve], *, label: str) -> str:
    """Values over a heading: `x` in rad, 0 ahead (up), growing to the left as yaw does, `y` outwards."""
    with canvas(4.6, 4.4) as (figure, svg):
        axes = figure.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")
        for curve in curves:
            axes.plot(curve.x, curve.y, color=COLOURS[curve.role], lw=1.4, label=curve.name)
        axes.set_ylim(bottom=0.0)
        axes.grid(color=COLOURS["grid"], lw=0.6)
        axes.spines["polar"].set_color(COLOURS["grid"])
        axes.set_title(label, fontsize=9, color=COLOURS["ink"])
        if len(curves) > 1:
            figure.legend(frameon=False, fontsize=8, loc="outside lower center", ncols=2)
    return svg.text


def outlines(views: Sequence[View]) -> str:
    """Panels to one scale each, beside one another: ROPS, clearance zone and ground from the front and the side."""
    shown = [np.vstack([shape.points for shape in view.shapes]) for view in views]
    with canvas(WIDTH, panel_height(shown, WIDTH)) as (figure, svg):
        for k, view in enumerate(views):
            axes = figure.add_subplot(1, len(views), k + 1)
            for shape in view.shapes:
                p = np.vstack([shape.points, shape.points[:1]]) if shape.closed else shape.points
                colour = COLOURS[shape.role]
                if shape.filled:
                    axes.fill(p[:, 0], p[:, 1], color=colour, alpha=0.14, lw=0)
                style = "--" if shape.dashed else "-"
                label = shape.name if shape.name and k == 0 else None
                axes.plot(p[:, 0], p[:, 1], color=colour, lw=1.3, ls=style, label=label)
            axes.set_aspect("equal", adjustable="datalim")
            # 80 letters of this size are as wide as the figure
            axes.set_title(fill(view.title, 80 // len(views)), fontsize=9, color=COLOURS["ink"])
            up = "" if k and view.up == views[k - 1].up else view.up
            finish(axes, view.across, up, margins=(0.06, 0.06), legend=False)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        unique = dict(zip(labels, handles, strict=True))
        if unique:
            figure.legend(
                unique.values(), unique.keys(), frameon=False, fontsize=8, loc="outside lower center", ncols=4
            )
    return svg.text


# ---------------------------------------------------------------- how it is drawn


def _roled(curve: Curve, role: Role) -> Curve:
    return Curve(**{**vars(curve), "role": role})


def _draw(axes: Any, curves: Sequence[Curve]) -> None:
    for curve in curves:
        x, y = thinned(curve.x, curve.y)
        width, alpha = (0.7, 0.55) if curve.thin else (1.4, 1.0)
        (line,) = axes.plot(x, y, color=COLOURS[curve.role], lw=width, alpha=alpha, label=curve.name)
        marked(axes, line)
        if curve.spread is not None:
            edges = curve.y - curve.spread, curve.y + curve.spread
            axes.fill_between(curve.x, *edges, color=COLOURS[curve.role], alpha=0.25, lw=0)


def _level(axes: Any, levels: Sequence[Level]) -> None:
    for level in levels:
        axes.axhline(level.value, color=COLOURS["limit"], lw=1.1, ls="--", label=level.name)


def _shade(axes: Any, phases: Sequence[tuple[float, str]]) -> None:
    low, high = axes.get_xlim()
    letter = (high - low) / (PHASE_LETTERS * axes.get_figure().get_figwidth() * axes.get_position().width)
    ended = low  # where the last name on the first line ends
    for k, (start, name) in enumerate(phases):
        end = phases[k + 1][0] if k + 1 < len(phases) else high
        a, b = max(start, low), min(end, high)
        if b <= a:
            continue
        if k % 2:
            axes.axvspan(a, b, color=COLOURS["muted"], alpha=0.10, lw=0)
        if name and b - a > 0.05 * (high - low):
            middle, half = 0.5 * (a + b), 0.5 * letter * len(name)
            is_lower = middle - half < ended
            ended = ended if is_lower else middle + half + letter
            axes.annotate(
                name, (middle, 0.985), xycoords=("data", "axes fraction"), xytext=(0.0, -LINE if is_lower else 0.0),
                textcoords="offset points", ha="center", va="top", fontsize=8, color=COLOURS["muted"],
            )  # fmt: skip
    axes.set_xlim(low, high)


def finish(axes: Any, across: str, label: str, *, margins: tuple[float, float], legend: bool = True) -> None:
    """Margins, labels, grid and legend of axes, as all figures have them."""
    axes.margins(*margins)
    axes.set_xlabel(across, color=COLOURS["ink"])
    axes.set_ylabel(label, color=COLOURS["ink"])
    axes.grid(color=COLOURS["grid"], lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(color=COLOURS["grid"], labelcolor=COLOURS["ink"])
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(COLOURS["grid"])
    if legend and any(not t.startswith("_") for t in axes.get_legend_handles_labels()[1]):
        names = axes.get_legend_handles_labels()[1]
        room = LETTERS * axes.get_figure().get_figwidth()
        columns = max(1, min(4, int(room / (max(map(len, names)) + 6))))
        axes.legend(
            frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderpad=0.1
        )


def shades(*colours: str) -> Any:
    """Colour map from one colour to the next."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("rollover", list(colours))


class _Svg:
    """Text of a figure once it is drawn."""

    text = ""


@contextmanager
def canvas(
    width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator[tuple[Any, _Svg]]:
    """A figure to draw on, inch, and its text once that is done."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    ours = {"font.size": 9.0, "svg.hashsalt": "rollover", "svg.fonttype": "none", "path.simplify": False}
    ours["text.parse_math"] = False  # a name from data is no formula
    ours["axes.formatter.useoffset"] = False  # no "+1" beside an axis to be added to its numbers
    inked = dict.fromkeys(("text.color", "axes.labelcolor", "xtick.labelcolor", "ytick.labelcolor"), COLOURS["ink"])
    with mpl.rc_context({**mpl.rcParamsDefault, **ours, **inked}):  # whatever the user's own file says
        figure, svg = Figure(figsize=(width, height), layout=layout), _Svg()
        FigureCanvasSVG(figure)
        yield figure, svg
        stream = io.StringIO()
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg.text = readable(cleaned(stream.getvalue(), COLOURS), figure)


@contextmanager
def _axes(width: float = WIDTH, height: float = HEIGHT) -> Iterator[tuple[Any, _Svg]]:
    with canvas(width, height) as (figure, svg):
        yield figure.add_subplot(), svg
