"""`rollover schema`: JSON Schema for editors."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Annotated

import typer

from rollover.commands.door import AsJson, answering, app


class Part(StrEnum):
    """What `schema` can describe."""

    scenario = "scenario"
    vehicle = "vehicle"
    soil = "soil"


@app.command()
@answering
def schema(
    part: Annotated[Part, typer.Argument(help="Whose schema.")] = Part.scenario,
    as_json: AsJson = True,
) -> None:
    """Print the JSON Schema of a scenario file, for editors; it is JSON with or without --json."""
    from rollover import scenario as scenarios

    print(json.dumps(scenarios.schema(part.value), indent=2))
