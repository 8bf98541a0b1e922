"""What a plan answers, on standard output: strengths, the matrix of pairs, what to measure beside."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from rollover.cli.console import terminal
from rollover.effects import spoken

if TYPE_CHECKING:
    from rollover.diagnosis.planning.plan import Plan

MOST = 20  # columns of a matrix that a terminal holds; beyond that the pairs that are not told apart are listed


def plan(found: Plan, folder: str) -> None:
    """What a test would show."""
    from viz.pages.plan import headline

    out = terminal.out()
    out.print(headline(found).sentence, style="bold")
    asked = f"{found.power:.0%} at {found.false_alarm:.0%} false alarms of all effects together"
    out.print(f"Detectable with {asked}:")
    table = Table(box=None, pad_edge=False)
    for heading in ("", "effect", "parameter", "from", "unit", "usually", "seen then with"):
        table.add_column(heading, justify="right" if heading in ("", "from", "usually", "seen then with") else "left")
    for k, e in enumerate(found.effects, 1):
        least = "never" if e.least is None else e.least_in_words
        usual, power = "" if e.usual is None else spoken(e.usual), "" if e.power is None else f"{e.power:.0%}"
        table.add_row(str(k), e.effect, e.parameter, least, e.unit, usual, power, style="yellow" if not e.least else "")
    out.print(table)
    acting = [(k, e) for k, e in enumerate(found.effects, 1) if e.judged is not None]
    if 1 < len(acting) <= MOST:
        out.print(f"Chosen rightly, % (row: true, column: rival), each {found.times:g} times as strong:", style="bold")
        matrix = Table(box=None, pad_edge=False)
        for heading in ("", "effect", *(str(k) for k, _ in acting)):
            matrix.add_column(heading, justify="left" if heading == "effect" else "right")
        for k, e in acting:
            cells = (found.of(e.effect, other.effect) for _, other in acting)
            matrix.add_row(str(k), e.effect, *("-" if v is None else f"{100.0 * v:.0f}" for v in cells))
        out.print(matrix)
    elif acting:
        for pair in found.confused():
            out.print(f"{pair.effect} beside {pair.rival}: chosen rightly with {pair.probability:.0%}", style="yellow")
    for advice in found.next_tests:
        out.print(advice.message(), style="" if advice.is_enough else "yellow")
    out.print(f"Results: {folder}")
