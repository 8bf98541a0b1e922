"""`rollover schema`: JSON Schema for editors."""

from __future__ import annotations

import json
from typing import Annotated, Any

import typer

from rollover.cli.commands.common import AsJson, answering, app, manual
from rollover.system.errors import Fault, InputError, hint

PARTS = ("scenario", "vehicle", "rops", "steel", "soil", "study", "recording", "profile")


@app.command(epilog=manual("schema > scenario.schema.json", writes="nothing; the schema goes to standard output."))
@answering
def schema(
    part: Annotated[str, typer.Argument(help=f"Whose schema: {', '.join(PARTS)}.", metavar="[PART]")] = "scenario",
    as_json: AsJson = True,
) -> None:
    """Print the JSON Schema of a kind of file, for editors; it is JSON with or without --json."""
    if part not in PARTS:
        raise InputError(Fault(file="rollover schema", message=f"no such part, got {part!r}; {hint(part, PARTS)}"))
    print(json.dumps(_schema(part), indent=2))


def _schema(part: str) -> dict[str, Any]:
    if part == "study":
        from rollover import studies

        return studies.schema()
    if part in ("recording", "profile"):
        from rollover.recording.importers import sidecar

        return sidecar.schema(sidecar.Sidecar if part == "recording" else sidecar.Profile, f"rollover {part}")
    from rollover import scenario as scenarios

    return scenarios.schema(part)  # type: ignore[arg-type]
