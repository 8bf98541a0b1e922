"""What differs from the shipped scenario whose title a page bears."""

from __future__ import annotations

from rollover.assessment.shipped import MOST_IN_WORDS, origin
from rollover.scenario import Scenario
from viz.content.blocks import Block, Details, Note, Section, Table


def differences_section(scenario: Scenario) -> list[Block]:
    """Each value by its path, as shipped and now; nothing for a scenario with a title of its own, or as shipped."""
    made_from = origin(scenario)
    if made_from is None or not made_from.differences:
        return []
    rows = [[d.path, d.shipped, d.now] for d in made_from.differences]
    note = Note(text=f"The title is that of the shipped {made_from.name}; these values are not its own.", warning=True)
    table: Block = Table(columns=["value", "shipped", "now"], rows=rows)
    if len(rows) > MOST_IN_WORDS:  # so many are a scenario of its own; the answer does not wait below them
        table = Details(summary=f"{len(rows)} values", blocks=[table])
    return [Section(title=f"Differs from the shipped {made_from.name}", blocks=[note, table])]


def differences_lines(scenario: Scenario) -> list[str]:
    """The same in Markdown."""
    made_from = origin(scenario)
    if made_from is None or not made_from.differences:
        return []
    rows = [f"| {d.path} | {d.shipped} | {d.now} |" for d in made_from.differences]
    return [
        f"**Differs from the shipped {made_from.name}:**",
        "",
        "| value | shipped | now |",
        "|---|---|---|",
        *rows,
        "",
    ]
