"""`rollover schema`: JSON Schema for editors."""

from __future__ import annotations

import json
from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any

import typer

from rollover.commands.door import AsJson, answering, app


class Part(StrEnum):
    """What `schema` can describe."""

    scenario = "scenario"
    vehicle = "vehicle"
    soil = "soil"
    study = "study"


@app.command()
@answering
def schema(
    part: Annotated[Part, typer.Argument(help="Whose schema.")] = Part.scenario,
    as_json: AsJson = True,
) -> None:
    """Print the JSON Schema of a scenario or study file, for editors; it is JSON with or without --json."""
    from rollover import scenario as scenarios
    from rollover import study

    schemas: dict[Part, Callable[[], Any]] = {
        Part.scenario: scenarios.schema,
        Part.vehicle: lambda: scenarios.schema("vehicle"),
        Part.soil: lambda: scenarios.schema("soil"),
        Part.study: study.schema,
    }
    print(json.dumps(schemas[part](), indent=2))
