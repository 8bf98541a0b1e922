"""Report pages: one look for all of them, one file each, readable without a network, without JavaScript and on paper.

Only a table of many cases brings a script, inside the page; without it the first rows are there all the same.

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
            policy=policy([f"\n{_script()}"]),
            script=_script(),
        )
    )
    return page


@functools.cache
def _script() -> str:
    """What lets a reader sort and filter a table: the only script that a page runs."""
    return (TEMPLATES / "cases.js").read_text(encoding="utf-8")


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
