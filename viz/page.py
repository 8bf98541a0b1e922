"""Report pages: one look for all of them, one file each, readable without a network, without JavaScript and on paper.

Only a table of many cases brings a script, inside the page; without it the first rows are there all the same.

A page is a headline, blocks and a footer; a block is one of the dataclasses here. Text is escaped, figures are the
``<svg>`` of `viz.plots`. The same content gives the same bytes.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from viz.embedded import embedded, policy

TEMPLATES = Path(__file__).parent / "templates"
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


@dataclass(frozen=True, kw_only=True)
class Cases:
    """A table of many rows, a screenful at a time, that the reader sorts and filters; `columns` are of one length.

    A column is its heading and its values, numbers (None: nothing there) or words.
    """

    kind: ClassVar[str] = "cases"
    columns: Sequence[tuple[str, Sequence[Any]]]
    caption: str = ""
    shown: int = 50

    def __post_init__(self) -> None:
        if len({len(values) for _, values in self.columns}) != 1:
            raise ValueError("columns: of different lengths; all of one")

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.columns[0][1])

    @property
    def names(self) -> list[tuple[str, bool]]:
        """Headings, and whether numbers stand below."""
        return [(name, not any(isinstance(v, str) for v in values)) for name, values in self.columns]

    @property
    def first(self) -> list[list[str]]:
        """Text of the rows that are there without a script."""
        return [[_cell(values[k]) for _, values in self.columns] for k in range(min(self.shown, self.count))]

    @property
    def data(self) -> str:
        """All values as JSON that can stand inside a script element; numbers with six digits."""
        columns = [[_short(v) for v in values] for _, values in self.columns]
        return embedded(columns)


def _cell(value: Any) -> str:
    return "" if value is None else value if isinstance(value, str) else f"{value:.6g}"


def _short(value: Any) -> Any:
    if value is None or isinstance(value, (str, int)):
        return value
    short = float(f"{value:.6g}")
    return int(short) if short.is_integer() and abs(short) < 1e15 else short


Block = Pairs | Table | Figure | Note | Section | Details | Cases


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
