"""`rollover schema`: JSON Schema for editors."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from rollover.cli.commands.common import AsJson, answering, app, manual
from rollover.system.errors import Fault, InputError, hint

PARTS = ("scenario", "vehicle", "soil", "study")


@app.command(epilog=manual("schema > scenario.schema.json", writes="nothing; the schema goes to standard output."))
@answering
def schema(
    part: Annotated[str, typer.Argument(help=f"Whose schema: {', '.join(PARTS)}.", metavar="[PART]")] = "scenario",
    as_json: AsJson = True,
) -> None:
    """Print the JSON Schema of a scenario or study file, for editors; it is JSON with or without --json."""
    if part not in PARTS:
        raise InputError(Fault(file="rollover schema", message=f"no such part, got {part!r}; {hint(part, PARTS)}"))
    from rollover import scenario as scenarios
    from rollover import studies

    print(json.dumps(studies.schema() if part == "study" else scenarios.schema(part), indent=2))  # type: ignore[arg-type]
