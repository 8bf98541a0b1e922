"""Blocks that a page is made of: headlines, tables, figures, notes; text is escaped when a page is rendered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from viz.content.embedded import embedded

State = Literal["", "pass", "fail", "warn", "muted"]


def as_sentence(text: str) -> str:
    """Text as a sentence begins; a name, a path or a number that it begins with stays as it is."""
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


WORDY = 20  # letters of a cell: more than a name or a number


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

    @property
    def wordy(self) -> set[int]:
        """Columns of sentences: a narrow screen gives them a width, or their rows would be as high as they are long."""
        most = [max((len(row[k].text) for row in self.cells), default=0) for k in range(len(self.columns))]
        return {k for k, letters in enumerate(most) if letters > WORDY and k not in self.numeric}


@dataclass(frozen=True, kw_only=True)
class Figure:
    """An ``<svg>`` of `viz.figures.plots` with its caption."""

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
