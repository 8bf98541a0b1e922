"""What separates two runs, on standard output: the answer, the loads, what was changed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rollover.cli.console import terminal

if TYPE_CHECKING:
    from rollover.comparison.run_pair import Pair

MOST = 10  # changed values that are listed


def pair(found: Pair, folder: str) -> None:
    """The leading load in both runs, all loads, the values of the scenario that differ."""
    from viz.content.pair_words import answer, both, detail, named, relative, value

    out = terminal.out()
    out.print(answer(found), style="bold")
    out.print(detail(found))
    out.print()
    table = terminal.table(("load", "baseline", "candidate", "change"), (), words=1)
    table.add_column("")
    for x in found.loads:
        style = "yellow" if x.verdict.startswith("changed") else ""
        table.add_row(named(x.channel), value(x, x.was), value(x, x.now), relative(x), x.verdict, style=style)
    out.print(table)
    if found.changes:
        out.print()
        rows = [(c.path, *both(c)) for c in found.changes[:MOST]]
        out.print(terminal.table(("value", "baseline", "candidate"), rows, words=3))
    if (more := len(found.changes) - MOST) > 0:
        out.print(f"and {more} more, see the page.")
    out.print(f"Baseline: {found.baseline.folder}. Candidate: {found.candidate.folder}. Results: {folder}")
