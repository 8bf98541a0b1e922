"""Report pages: one look for all of them, one file each, readable without a network, without JavaScript and on paper.

A page is a headline, blocks and a footer; a block is one of the dataclasses here. Text is escaped, figures are the
``<svg>`` of `viz.plots`. The same content gives the same bytes.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

State = Literal["", "pass", "fail", "warn", "muted"]
NOT_APPROVAL = "This is a simulation study, not type approval."


@dataclass(frozen=True, kw_only=True)
class Headline:
    """The answer in a sentence, what it rests on in `detail`, and whether it is good, bad or neither."""

    sentence: str
    detail: str = ""
    state: State = ""


@dataclass(frozen=True)
class Cell:
    """Text of a table's cell with its state: pass and fail are marked by a word or sign of their own, not by colour."""

    text: str
    state: State = ""


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Key and value, a line each."""

    kind: ClassVar[str] = "pairs"
    rows: Sequence[tuple[str, str]]


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows under headings; `numeric` columns are set flush right. A row is as long as `columns`."""

    kind: ClassVar[str] = "table"
    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    numeric: Sequence[int] = ()
    caption: str = ""

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"rows: got {len(row)} cells in a row; {len(self.columns)}, one for each column")

    @property
    def cells(self) -> list[list[Cell]]:
        """All cells, plain text too."""
        return [[c if isinstance(c, Cell) else Cell(c) for c in row] for row in self.rows]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """An ``<svg>`` of `viz.plots` with its caption."""

    kind: ClassVar[str] = "figure"
    svg: str
    caption: str


@dataclass(frozen=True, kw_only=True)
class Note:
    """A paragraph; a warning stands out."""

    kind: ClassVar[str] = "note"
    text: str
    warning: bool = False


@dataclass(frozen=True, kw_only=True)
class Section:
    """Blocks under a heading."""

    kind: ClassVar[str] = "section"
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, kw_only=True)
class Details:
    """Blocks that are folded away on the screen until asked for, and printed in full."""

    kind: ClassVar[str] = "details"
    summary: str
    blocks: Sequence[Block]


@dataclass(frozen=True, kw_only=True)
class Footer:
    """What the page rests on and how to get it again; `hash_of` says what the hash is one of."""

    command: str
    scenario_hash: str = ""
    hash_of: str = "Scenario"
    versions: Mapping[str, str] | None = None


Block = Pairs | Table | Figure | Note | Section | Details


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
        )
    )
    return page


@functools.cache
def _environment() -> Any:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates", encoding="utf-8"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
