"""A terminal, or what stands for one: lines, progress, numbers in the units that engineers read."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from rollover.system.errors import excerpt, sentence
from rollover.system.numbers import brief

if TYPE_CHECKING:
    from collections.abc import Callable

QUIET = 2.0  # s of wall time: a run that is shorter shows no progress
EVERY = 5.0  # s between lines of progress where there is no terminal

# SI unit -> unit that an engineer reads, and how many of the one make one of the other
READABLE = {"N": ("kN", 1e-3), "J": ("kJ", 1e-3), "m": ("mm", 1e3), "N s": ("N s", 1.0), "m/s2": ("g", 1.0 / 9.80665)}


class Plain(Console):
    """A console on which words from data colour and move nothing, and of a long value the beginning stands."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"emoji": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        """Text of a line, of a sentence or of a table's cell."""
        return super().render_str("\n".join(map(sentence, text.split("\n"))), **options)


def out() -> Console:
    """The console that answers are printed on."""
    return Plain(highlight=False, markup=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160)


def say(what: str) -> None:
    """One line on standard error."""
    print(sentence(what), file=sys.stderr, flush=True)


def tell(lines: str) -> None:
    """Lines on standard output."""
    print("\n".join(sentence(line) for line in lines.split("\n")))


@contextmanager
def progress(what: str, start: float, end: float) -> Iterator[Callable[[float, float], None]]:
    """Give a callback that shows simulated time and speed: a bar on a terminal, otherwise a line now and then."""
    if sys.stderr.isatty():
        from rich.progress import BarColumn, Progress, TextColumn

        name = TextColumn("{task.description}", markup=False)
        columns = (name, BarColumn(), TextColumn("{task.fields[state]}", markup=False))
        with Progress(*columns, console=Plain(stderr=True), transient=True) as bar:
            task = bar.add_task(excerpt(what), total=end - start, visible=False, state="")

            def show(simulated: float, wall: float) -> None:
                state = _state(simulated, wall, start, end)
                bar.update(task, completed=simulated - start, visible=wall > QUIET, state=state)

            yield show
        return
    last = [-EVERY]

    def line(simulated: float, wall: float) -> None:
        if wall > QUIET and wall - last[0] >= EVERY:
            last[0] = wall
            say(f"{what}: {_state(simulated, wall, start, end)}")

    yield line


@contextmanager
def counting(what: str) -> Iterator[Callable[..., None]]:
    """Give a callback (done, of, note) that shows how many are done: a bar on a terminal, otherwise a line at times."""
    if sys.stderr.isatty():
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        words = (TextColumn(f"{{task.{field}}}", markup=False) for field in ("description", "fields[note]"))
        columns = (next(words), BarColumn(), MofNCompleteColumn(), next(words))
        with Progress(*columns, console=Plain(stderr=True)) as bar:
            task = bar.add_task(what, total=None, note="")
            yield lambda done, of, note="": bar.update(task, completed=done, total=of, note=note)
        return
    began = last = clock.monotonic()

    def line(done: int, of: int, note: str = "") -> None:
        nonlocal last
        now = clock.monotonic()
        if now - began > QUIET and now - last >= EVERY:
            last = now
            say(f"{done} of {of} {what}{note and ', '}{note}")

    yield line


def _state(simulated: float, wall: float, start: float, end: float) -> str:
    speed = (simulated - start) / wall if wall > 0.0 else 0.0
    return f"{simulated:.2f} of {end:g} s, {brief(speed)} x real time"


def readable(value: float | None, unit: str) -> str:
    """A number in the unit that an engineer reads it in, without the unit."""
    if value is None or value != value:
        return "-"
    return f"{value * READABLE.get(unit, (unit, 1.0))[1]:.4g}"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, words: int) -> Table:
    """A table of which the first `words` columns are text, the others numbers."""
    found = Table(box=None, pad_edge=False)
    for k, heading in enumerate(headings):
        found.add_column(heading, justify="left" if k < words else "right")
    for row in rows:
        found.add_row(*row)
    return found
