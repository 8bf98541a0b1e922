"""`rollover check`: validate files."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from rollover.commands.door import AsJson, answering, app
from rollover.faults import Fault, InputError


@app.command()
@answering
def check(
    files: Annotated[list[str], typer.Argument(help="Scenarios, vehicles or soils.", metavar="FILE...")],
    as_json: AsJson = False,
) -> None:
    """Validate files and run nothing."""
    from rollover import catalogue

    rows, faults = [], []
    for name in files:
        found: list[Fault] = []
        try:
            what = catalogue.check(name)
        except InputError as e:
            what, found = "", e.faults
        faults += found
        rows.append({"file": name, "is": what, "faults": [{**vars(f), "text": str(f)} for f in found]})
        if not as_json and not found:
            print(f"{name}: {what}, in order")
    if as_json:
        print(json.dumps({"ok": not faults, "files": rows}, indent=2))
    if faults:
        raise InputError(*faults)
