"""`rollover list`: what exists."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from rollover.cli.commands.common import AsJson, answering, app, manual
from rollover.system.errors import Fault, InputError, hint

LISTED = ("scenarios", "studies", "vehicles", "soils", "steels", "laws", "effects", "channels", "importers", "paths")


@app.command(
    "list",
    epilog=manual("list scenarios", "list paths side_overturn", writes="nothing; the table goes to standard output."),
)
@answering
def list_(
    what: Annotated[str, typer.Argument(help=f"What to list: {', '.join(LISTED)}.", metavar="WHAT")],
    scenario: Annotated[str | None, typer.Argument(help="Whose paths.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what exists, one line each."""
    from rollover.cli import catalogue, console

    if what not in LISTED:
        raise InputError(Fault(file="rollover list", message=f"no such thing, got {what!r}; {hint(what, LISTED)}"))
    if what == "paths" and scenario is None:
        raise InputError(Fault(file="rollover list paths", message="whose paths, got no scenario; name one"))
    if what != "paths" and scenario is not None:
        raise InputError(Fault(file=f"rollover list {what}", message=f"one argument too many, got {scenario!r}"))
    rows = catalogue.paths(scenario) if scenario is not None else catalogue.TABLES[what]()
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    if not rows:
        console.say(f"There are no {what} in this version.")
        return
    if what == "channels":  # no word for what does not wrap
        rows = [{**row, "period": f"wraps at {row['period']:.4g}" if row["period"] else ""} for row in rows]
    cells = [[catalogue.text(value) for value in row.values()] for row in rows]
    widths = [min(48, max(map(len, column))) for column in zip(*cells, strict=True)]
    for row in cells:
        console.tell("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
