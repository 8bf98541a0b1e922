"""The page of a regression of peak loads: what changed, every scenario, every load."""

from __future__ import annotations

from collections.abc import Sequence

from rollover.assessment.results import versions
from rollover.studies.baseline import Answer, Difference
from rollover.studies.regression import unchanged
from viz.content.blocks import Block, Cell, Details, Footer, Headline, Note, Section, Table, as_sentence
from viz.pages.page import render
from viz.pages.report import number, series_unit

COLUMNS = ("load", "filter", "unit", "was", "is", "change", "allowed", "at, s", "was at, s", "")


def page(answers: Sequence[Answer], *, command: str, scenario_hash: str = "") -> str:
    """HTML of the full report; `scenario_hash` is one over all scenarios that were asked for."""
    bad = [a for a in answers if not a.ok]
    updated = [a for a in answers if a.verdict == "updated"]
    if bad:
        sentence = f"{len(bad)} of {len(answers)} scenarios are not as they were"
        head = Headline(sentence=f"{sentence}: {', '.join(a.scenario for a in bad)}.", state="fail")
    elif updated:
        written = "1 baseline was" if len(updated) == 1 else f"{len(updated)} baselines were"
        head = Headline(sentence=f"{written} written.")
    else:
        head = Headline(sentence=f"{as_sentence(unchanged(answers))}.", state="pass")
    rows: list[list[str | Cell]] = [
        [
            a.scenario,
            Cell(a.verdict, "fail" if not a.ok else "muted" if a.verdict == "excluded" else "pass"),
            str(a.starts or ""),
            f"{a.wall_time:.1f}",
            a.sentence,
        ]
        for a in answers
    ]
    columns = ["scenario", "verdict", "runs", "wall, s", "in words"]
    blocks: list[Block] = [Section(title="Scenarios", blocks=[Table(columns=columns, rows=rows, numeric=(2, 3))])]
    changed: list[list[str | Cell]] = [[a.scenario, *_row(d)] for a in answers for d in a.differences if not d.same]
    if changed:
        table = Table(columns=["scenario", *COLUMNS], rows=changed, numeric=range(4, 10))
        blocks.append(Section(title="What changed", blocks=[table]))
    notes: list[Block] = [Note(text=f"{a.scenario}: {n}", warning=True) for a in answers for n in a.notes]
    if notes:
        blocks.append(Section(title="Notes", blocks=notes))
    every: list[Block] = [
        Details(
            summary=f"{a.scenario}: {len(a.differences)} loads",
            blocks=[Table(columns=COLUMNS, rows=[_row(d) for d in a.differences], numeric=range(3, 9))],
        )
        for a in answers
        if a.differences
    ]
    if every:
        blocks.append(Section(title="Every load", blocks=every))
    footer = Footer(command=command, scenario_hash=scenario_hash, hash_of="Scenarios", versions=versions())
    return render(title="Peak loads against their baselines", headline=head, blocks=blocks, footer=footer)


def _row(d: Difference) -> list[str | Cell]:
    unit, factor = series_unit(d.unit)
    times = ["" if t is None else f"{t:.3f}" for t in (d.time_now, d.time_was)]
    return [
        d.load,
        d.filter,
        unit,
        "" if d.was is None else number(d.was, factor),
        "" if d.now is None else number(d.now, factor),
        "" if d.change is None else f"{100.0 * d.change:+.3g} %",
        "" if d.tolerance is None else f"{100.0 * d.tolerance:.3g} %",
        *times,
        Cell("as it was", "pass") if d.same else Cell("changed", "fail"),
    ]
