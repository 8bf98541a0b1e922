"""Figures: no peak is lost, the same data gives the same bytes, nothing is fetched, colours follow the page."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from numpy.typing import NDArray

from viz.figures import plots
from viz.figures.corner import corner
from viz.figures.heat_map import DARK, DEEP, INK, PAPER, WHITE, heat_map
from viz.figures.plots import COLOURS, Curve, Level, Outline, View, thinned
from viz.figures.reading import MOST_POINTS
from viz.figures.svg import number_label

Array = NDArray[np.float64]
T = np.linspace(0.0, 4.0, 401)
SINE = Curve(name="CFC 60", x=T, y=np.sin(8.0 * T))
RAW = Curve(name="raw", x=T, y=np.cos(8.0 * T), role="second", thin=True)
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])

FIGURES: dict[str, Callable[[], str]] = {
    "history": lambda: plots.history(
        [RAW, SINE],
        label="ROPS force, kN",
        phases=((0.0, "tipping"), (1.7, "impact")),
        levels=[Level(name="L", value=1.2)],
    ),
    "xy": lambda: plots.xy(
        [SINE],
        across="deflection, mm",
        label="energy, kJ",
        levels=[Level(name="asked", value=1.5)],
        points=[("max", 1.0, 1.0)],
    ),
    "overlay": lambda: plots.overlay(RAW, SINE, label="force, kN", phases=((0.0, "loading"),)),
    "bars": lambda: plots.bars({"soil": 4.0, "potential": -7.4, "residual": float("nan")}, label="kJ"),
    "tornado": lambda: plots.tornado(["mass", "slope"], [1.0, 2.0], [1.5, 4.0], centre=1.4, label="kN"),
    "scatter": lambda: plots.scatter([SINE], across="speed, m/s", label="force, kN", line=RAW),
    "polar": lambda: plots.polar([Curve(name="pivot free", x=T, y=40.0 + SINE.y), RAW], label="angle, deg"),
    "outlines": lambda: plots.outlines(
        [View(title="from behind", across="m", up="m", shapes=[Outline(name="zone", points=SQUARE, filled=True)])]
    ),
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_whole_and_its_colours_are_the_pages(name: str) -> None:
    svg = FIGURES[name]()
    root = ElementTree.fromstring(svg)
    assert root.tag == "svg"
    assert root.attrib["viewBox"].startswith("0 0 ")
    ids = re.findall(r'\sid="([^"]*)"', svg)
    assert len(ids) == len(set(ids))
    assert {*re.findall(r'href="#([^"]*)"', svg), *re.findall(r"url\(#([^)]*)\)", svg)} <= {*ids}
    assert "://" not in svg
    assert "<style" not in svg, "a style sheet in a figure is one for the whole page"
    bare = re.sub(r"var\(--\w+, #[0-9a-f]{6}\)|=\"#[^\"]*\"|url\(#[^)]*\)", "", svg)
    assert "#" not in bare
    inked = [t for t in root.iter("text") if "fill: var(--" not in t.attrib["style"]]
    assert not inked, "text that would be black on black"


@pytest.mark.parametrize("name", FIGURES)
def test_equal_data_give_equal_bytes_under_any_settings(name: str) -> None:
    first = FIGURES[name]()
    with mpl.rc_context({"font.size": 21.0, "lines.linewidth": 9.0, "xtick.major.size": 12.0, "svg.fonttype": "path"}):
        assert FIGURES[name]() == first


def test_no_two_figures_share_an_id() -> None:
    ids = [i for name in FIGURES for i in re.findall(r'\sid="([^"]*)"', FIGURES[name]())]
    assert len(ids) == len(set(ids))


def points_of(svg: str, role: str) -> Array:
    """Vertices of the widest path of a role's colour, in the figure's own units."""
    paths = re.findall(r'<path d="([^"]*)"[^>]*?stroke: var\(--' + role, svg)
    found = [np.array([[float(v) for v in pair] for pair in re.findall(r"[ML] (\S+) (\S+)", path)]) for path in paths]
    return max(found, key=lambda p: float(np.ptp(p[:, 0])))


@pytest.mark.parametrize("at", [0, 1, 4_999, 123_456, 199_998, 200_000])
def test_a_spike_among_many_samples_is_drawn_in_full_height(at: int) -> None:
    time = np.linspace(0.0, 4.0, 200_001)
    force = np.where(np.arange(time.size) == at, 63.2, 0.0)
    drawn = points_of(plots.history([Curve(name="raw", x=time, y=force)], label="kN"), "first")
    few = np.unique(np.array([0, at - 1, at, at + 1, 200_000]).clip(0, 200_000))
    plain = points_of(plots.history([Curve(name="raw", x=time[few], y=force[few])], label="kN"), "first")
    assert len(drawn) < 2000
    assert drawn[:, 1].min() == plain[:, 1].min()
    assert drawn[np.argmin(drawn[:, 1]), 0] == pytest.approx(plain[np.argmin(plain[:, 1]), 0], abs=0.02)
    assert drawn[:, 1].max() == plain[:, 1].max()


def test_extremes_of_both_coordinates_and_gaps_survive_thinning() -> None:
    draw = np.random.default_rng(3)
    x, y = draw.normal(size=50_000), draw.normal(size=50_000)
    y[20_000:20_400] = np.nan
    a, b = thinned(x, y)
    assert len(a) <= MOST_POINTS + 402
    good = np.isfinite(y)
    assert (a.min(), a.max()) == (x[good].min(), x[good].max())
    assert (np.nanmin(b), np.nanmax(b)) == (np.nanmin(y), np.nanmax(y))
    assert np.isnan(b).any()
    assert len(thinned(x[:10], y[:10])[0]) == 10


def test_the_residual_is_measured_less_simulated() -> None:
    measured = Curve(name="measured", x=np.array([0.0, 1.0, 2.0]), y=np.array([1.0, 3.0, 1.0]))
    simulated = Curve(name="simulated", x=np.array([0.0, 2.0]), y=np.array([1.0, 1.0]))
    peak = points_of(plots.overlay(measured, simulated, label="kN"), "muted")
    assert peak[1, 1] < peak[0, 1]  # upwards is less in a figure: +2 at the middle stamp
    assert peak[0, 1] == peak[2, 1]


@pytest.mark.parametrize("empty", [0, 1])
def test_a_curve_without_a_number_leaves_its_half_empty(empty: int) -> None:
    """One of two runs may hold a channel without any value: the other is drawn all the same."""
    t = np.linspace(0.0, 1.0, 50)
    curves = [Curve(name="was", x=t, y=1.0 + t), Curve(name="now", x=t[::2], y=2.0 + t[::2])]
    curves[empty] = replace(curves[empty], y=np.full(curves[empty].x.shape, np.nan))
    svg = plots.overlay(curves[0], curves[1], label="force, kN")
    assert "<svg" in svg
    assert "NaN" not in svg


def test_a_tornado_shows_the_widest_first() -> None:
    svg = plots.tornado(["small", "large"], [1.0, 0.0], [1.2, 4.0], centre=1.1, label="kN")
    assert svg.index(">small<") != -1
    heights = {n: float(re.search(rf'y="([\d.]+)"[^>]*>{n}<', svg)[1]) for n in ("small", "large")}  # type: ignore[index]
    assert heights["large"] < heights["small"]


def test_colours_of_figures_and_of_the_page_are_the_same() -> None:
    css = (Path(plots.__file__).parents[1] / "pages" / "templates" / "page.css").read_text()
    light = css[: css.index("@media")]
    for role, colour in COLOURS.items():
        assert f"--{role}: {colour}" in light
        assert css.count(f"--{role}:") == 3, "light, dark and paper"


def test_names_of_short_phases_do_not_run_into_each_other() -> None:
    short = ((0.0, "loading"), (1.3, "peak"), (1.65, "unloading"), (1.9, "rest"))
    svg = plots.overlay(RAW, SINE, label="force, kN", phases=short)
    line = {name: float(y) for y, name in re.findall(r'<text [^>]* y="([\d.]+)"[^>]*>(\w+)</text>', svg)}
    assert line["loading"] == line["peak"] == line["rest"]
    assert line["unloading"] > line["peak"] + 8.0


def test_rounding_errors_are_labelled_zero() -> None:
    words = re.findall(r"<text[^>]*>([^<]*)</text>", plots.bars({"a": 12.5, "b": 1.69e-17, "c": -0.0}, label="kJ"))
    assert words.count("0") >= 2
    assert not [w for w in words if "e-1" in w or w == "-0"]
    assert number_label(1.69e-17, [12.5, 1.69e-17]) == "0"
    assert number_label(-3e-12, [math.nan, -20.0], 3) == "0"
    assert number_label(1.69e-17, [1.69e-17, 3e-17]) == "1.69e-17"  # of quantities that are all that small
    assert number_label(2e-6, [12.5]) == "2e-06"  # small, but no rounding error
    assert number_label(1156.4, [12.5, 1156.4], 3) == "1156"
    assert number_label(2.1e9, [2.1e9], 3) == "2.1e+09"


def test_what_is_read_in_a_figure_keeps_its_digits() -> None:
    """Places of lines are rounded to a hundredth of a pixel; labels are not places."""
    svg = plots.bars({"a": 12.5, "b": -0.00123}, label="kJ")
    assert "-0.00123" in re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    assert not re.search(r"<[^>]*-?\d\.\d{3,}", svg)
    levels = np.array([0.0125, 0.0375]), np.array([1.125, 2.375])
    grid = [np.repeat(levels[0], 2), np.tile(levels[1], 2)]
    drawn = heat_map(*grid, np.arange(4.0), across="gap, m", up="speed, m/s", label="kN")
    assert {"0.0125", "0.0375", "1.125", "2.375"} <= set(re.findall(r"<text[^>]*>([^<]*)</text>", drawn))


def test_the_bar_of_a_map_has_the_colours_of_its_cells() -> None:
    """Its pieces are thinner than a pixel: without a stroke of their own the page would show between them."""
    values = np.linspace(0.0, 9.0, 10)
    drawn = heat_map(values, np.zeros(10), values, across="a", up="b", label="c")
    pieces = re.findall(r'style="fill: (#\w+)(?:; stroke: (#\w+))?[^"]*"/>', drawn[drawn.rindex("QuadMesh") :])
    assert len(pieces) > 200
    assert all(fill == stroke for fill, stroke in pieces)


def test_numbers_on_an_axis_are_whole() -> None:
    values = 1.0 + 1e-4 * np.random.default_rng(1).standard_normal((500, 2))
    drawn = corner(["a", "b"], values, [1.0, 1.0])
    assert not [t for t in re.findall(r"<text[^>]*>([^<]*)</text>", drawn) if t.startswith("+")]


def test_numbers_on_a_map_are_read_on_their_cells() -> None:
    """Ratio of contrast by WCAG 2, (L1 + 0.05)/(L2 + 0.05), L of linear sRGB: the better of white and ink is taken."""

    def luminance(rgb: NDArray[np.float64]) -> float:
        linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        return float(linear @ (0.2126, 0.7152, 0.0722)) + 0.05

    def rgb(colour: str) -> NDArray[np.float64]:
        return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0

    values = np.linspace(0.0, 9.0, 10)
    drawn = heat_map(values, np.zeros(10), values, across="a", up="b", label="c")
    numbers = re.findall(r"font-size: 7px; text-anchor: middle; fill: ([^\"]*)\"[^>]*>(\d)<", drawn)
    assert [int(n) for fill, n in numbers if WHITE in fill] == [v for v in values if v > DARK * 9.0]
    assert len(numbers) == values.size
    assert not any("var(" in fill for fill, _ in numbers), "cells stay as they are on a dark page, and so must they"
    paper, dark, ink = rgb(PAPER), rgb(DEEP), luminance(rgb(INK))
    for share in np.linspace(0.0, 1.0, 101):
        cell = luminance(paper + (dark - paper) * share)
        white = share > DARK
        taken, other = (1.05 / cell, cell / ink) if white else (cell / ink, 1.05 / cell)
        assert taken > 3.8
        assert taken > other - 0.1
