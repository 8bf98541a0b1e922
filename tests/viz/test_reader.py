"""Figures are read off and enlarged in a real browser; on paper and without a script they are as drawn."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.viz.browser import has_browser, opened
from viz.content.blocks import Figure, Footer, Headline
from viz.figures.plots import Curve, history, polar, xy
from viz.pages.page import render

T = np.linspace(0.0, 2.0, 401)
STEEP = Curve(name="CFC 60 <b>", x=T, y=10.0 * T**2)
LOOP = Curve(name="raw", x=np.sin(np.pi * T), y=3.0 * np.cos(np.pi * T))

needs_browser = pytest.mark.skipif(not has_browser(), reason="no chromium with playwright")


def axes_of(svg: str) -> list[dict[str, Any]]:
    found = re.search(r'data-axes="([^"]*)"', svg)
    return [] if found is None else json.loads(html.unescape(found[1]))


def test_a_figure_says_where_its_axes_lie_and_what_they_span() -> None:
    (axes,) = axes_of(history([STEEP], label="force, kN"))
    assert (axes["across"], axes["up"], [name for _, name in axes["curves"]]) == (
        "time, s",
        "force, kN",
        ["CFC 60 <b>"],
    )
    assert axes["x"] == [0.0, 2.0]
    assert axes["y"][0] < 0.0 < 40.0 < axes["y"][1]
    turned = polar([Curve(name="a", x=T, y=T)], label="angle, deg")
    assert axes_of(turned) == [], "what has other axes is not read off wrongly"


@pytest.fixture
def page(tmp_path: Path) -> Path:
    figures = [
        Figure(svg=history([STEEP], label="force, kN"), caption="over time"),
        Figure(svg=xy([LOOP], across="way, m", label="force, kN"), caption="a loop"),
    ]
    text = render(title="t", headline=Headline(sentence="s"), blocks=figures, footer=Footer(command="c"))
    (path := tmp_path / "page.html").write_text(text, encoding="utf-8")
    return path


def at(tab: Any, figure: int, x: float, y: float) -> tuple[float, float]:
    """Place on the screen of values in a figure."""
    svg = tab.locator("figure svg").nth(figure)
    box, (axes,) = svg.bounding_box(), json.loads(svg.get_attribute("data-axes"))
    _, _, width, height = map(float, svg.get_attribute("viewBox").split())
    left, top, wide, high = axes["box"]
    u = left + wide * (x - axes["x"][0]) / (axes["x"][1] - axes["x"][0])
    v = top + high * (axes["y"][1] - y) / (axes["y"][1] - axes["y"][0])
    return box["x"] + u * box["width"] / width, box["y"] + v * box["height"] / height


@needs_browser
def test_values_under_the_pointer_are_those_of_the_data(page: Path) -> None:
    with opened(page) as tab:
        tab.locator("figure svg").first.scroll_into_view_if_needed()
        tab.mouse.move(*at(tab, 0, 1.5, 5.0))
        said = tab.locator(".reading").first.inner_text()
        found = re.fullmatch(r"time, s: ([\d.]+); force, kN: CFC 60 <b> ([\d.]+)", said)
        assert found is not None, said
        assert float(found[1]) == pytest.approx(1.5, abs=0.01)
        assert float(found[2]) == pytest.approx(22.5, abs=0.4)  # a pixel across is 10 (2 x 1.5) 0.003 = 0.1 kN
        tab.locator("figure svg").nth(1).scroll_into_view_if_needed()
        tab.mouse.move(*at(tab, 1, 0.98, 0.05))
        said = tab.locator(".reading").nth(1).inner_text()
        found = re.search(r"raw (-?[\d.]+) at ([\d.]+)", said)  # of a loop the nearest point, not the first at that x
        assert found is not None, said
        assert float(found[1]) == pytest.approx(0.0, abs=0.2)
        assert float(found[2]) == pytest.approx(1.0, abs=0.01)
        assert tab.said == [], "the policy of the page lets its own script run"


@needs_browser
def test_dragging_enlarges_and_printing_shows_the_whole(page: Path) -> None:
    with opened(page) as tab:
        svg = tab.locator("figure svg").first
        svg.scroll_into_view_if_needed()
        whole, size = svg.get_attribute("viewBox"), svg.bounding_box()
        for back in ("double click", "print"):
            tab.mouse.move(*at(tab, 0, 0.5, 5.0))
            tab.mouse.down()
            tab.mouse.move(*at(tab, 0, 1.0, 20.0), steps=3)
            tab.mouse.up()
            w, h = map(float, svg.get_attribute("viewBox").split()[2:])
            full = [float(v) for v in whole.split()]
            assert w < 0.7 * full[2]
            assert w / h == pytest.approx(full[2] / full[3], rel=1e-6)
            assert svg.bounding_box()["height"] == pytest.approx(size["height"], abs=1.0), "the page does not jump"
            if back == "double click":
                svg.dblclick()
            else:
                tab.evaluate("window.dispatchEvent(new Event('beforeprint'))")
            assert [float(v) for v in svg.get_attribute("viewBox").split()] == full
        tab.emulate_media(media="print")
        assert not tab.locator(".reading").first.is_visible()


@needs_browser
def test_without_a_script_there_is_no_word_of_one(page: Path) -> None:
    with opened(page, script=False) as tab:
        assert tab.locator(".reading").count() == 0
        assert tab.locator("figure svg").first.bounding_box()["width"] > 300
