"""Drawn figures made fit to stand in a page."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

NOUGHT = 1e-9  # of the largest: what is summed over a million steps rounds by up to a million times 1e-16 of it
PLAIN = 1e6  # below it a number is written out
_TAG = re.compile(r"<[^>]*>")
_NUMBER = re.compile(r"-?\d+\.\d{3,}")


def cleaned(svg: str, colours: Mapping[str, str]) -> str:
    """Only what a page needs: no prologue, no other host's name, short numbers, ids of its own.

    `colours` are the page's by role: each becomes the variable of that name, with itself where there is no style sheet.
    """
    svg = svg[svg.index("<svg") :].strip()
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:\w+)?="[^"]*"|\sversion="[^"]*"', "", svg).replace("xlink:href", "href")
    box = re.search(r'viewBox="([^"]*)"', svg)
    assert box is not None
    wide = float(box[1].split()[2]) * 4.0 / 3.0  # px to a pt, so that letters are as large in all figures
    head = f'<svg role="img" viewBox="{box[1]}" style="max-width: {wide:.0f}px; --natural: {wide:.0f}px">'
    svg = re.sub(r"<svg[^>]*>", head, svg, count=1)
    svg = re.sub(r"\s*font-family: [^;\"]*;?", "", svg)
    svg = _TAG.sub(lambda tag: _NUMBER.sub(_short, tag[0]), svg)  # of places and sizes; what is read stays as it is
    for role, colour in colours.items():
        svg = svg.replace(colour, f"var(--{role}, {colour})")
    own = hashlib.sha256(svg.encode()).hexdigest()[:8]
    svg = re.sub(r'(\sid="|="#|url\(#)', rf"\g<1>f{own}-", svg)
    return re.sub(r"\n\s*", "\n", svg)


def _short(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def number_label(value: float, beside: Iterable[float], digits: int = 4) -> str:
    """A value as it stands in a figure: 0 where it is rounding error of the largest finite one `beside` it."""
    largest = max((abs(v) for v in beside if math.isfinite(v)), default=0.0)
    text = f"{value:.{digits}g}"
    return "0" if abs(value) <= NOUGHT * largest else f"{value:.0f}" if "e+" in text and largest < PLAIN else text


def panel_height(shown: Sequence[NDArray[np.float64]], width: float) -> float:
    """Height, inches, that panels side by side need for points (n, 2) to one scale; titles and legend besides."""
    spans = [np.ptp(points, axis=0) for points in shown]
    steepest = max((float(up / across) for across, up in spans if across > 0.0), default=1.0)
    return min(max(0.8 * width / len(shown) * steepest + 1.6, 2.4), 3.6)
