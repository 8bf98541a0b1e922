"""`rollover list`: what exists."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from rollover.commands.door import AsJson, answering, app
from rollover.faults import Fault, InputError


class Listed(StrEnum):
    """What `list` can list."""

    scenarios = "scenarios"
    studies = "studies"
    vehicles = "vehicles"
    soils = "soils"
    laws = "laws"
    effects = "effects"
    channels = "channels"
    importers = "importers"
    paths = "paths"


@app.command("list")
@answering
def list_(
    what: Annotated[Listed, typer.Argument(help="What to list.")],
    scenario: Annotated[str | None, typer.Argument(help="Whose paths.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what exists, one line each."""
    from rollover import catalogue

    if what is Listed.paths and scenario is None:
        raise InputError(Fault(file="rollover list paths", message="whose paths, got no scenario; name one"))
    if what is not Listed.paths and scenario is not None:
        raise InputError(Fault(file=f"rollover list {what.value}", message=f"one argument too many, got {scenario!r}"))
    rows = catalogue.paths(scenario) if scenario is not None else catalogue.TABLES[what.value]()
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    if not rows:
        from rollover import console

        console.say(f"There are no {what.value} in this version.")
        return
    cells = [[catalogue.text(value) for value in row.values()] for row in rows]
    widths = [min(48, max(map(len, column))) for column in zip(*cells, strict=True)]
    for row in cells:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
