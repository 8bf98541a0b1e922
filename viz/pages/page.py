"""Report pages: one look for all of them, one file each, readable without a network, without JavaScript and on paper.

Two scripts may stand in a page: a table of many cases is sorted by one, figures are read off and enlarged by another.
Without them the first rows and the figures are there all the same. No plot library is brought along: the smallest
that is kept well has hundreds of kilobytes for each page, and would draw a second picture beside the printed one.

A page is a headline, blocks and a footer; a block is one of the dataclasses of `viz.content.blocks`. Text is
escaped, figures are the ``<svg>`` of `viz.figures.plots`. The same content gives the same bytes.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from viz.content.blocks import Block, Footer, Headline
from viz.content.embedded import policy

SCRIPTS = ("cases.js", "reader.js")  # the only ones that a page runs
TEMPLATES = Path(__file__).parent / "templates"
NOT_APPROVAL = "This is a simulation study, not type approval."


def render(
    *, title: str, headline: Headline, blocks: Sequence[Block], footer: Footer, subtitle: str = "", study: bool = True
) -> str:
    """HTML text of a page. `study` adds that this is no type approval."""
    page: str = (
        _environment()
        .get_template("page.html")
        .render(
            title=title,
            subtitle=subtitle,
            headline=headline,
            blocks=blocks,
            footer=footer,
            disclaimer=NOT_APPROVAL if study else "",
            policy=policy([f"\n{_script(name)}" for name in SCRIPTS]),
            script=_script("cases.js"),
            reader=_script("reader.js"),
        )
    )
    return page


@functools.cache
def _script(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


@functools.cache
def _environment() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES, encoding="utf-8"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
