"""Options of `rollover` itself, before any command."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import app


def _told(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"rollover {version('rollover')}")
        raise typer.Exit


@app.callback()
def root(
    effects: Annotated[
        list[Path] | None,
        typer.Option("--effects", metavar="FILE", help="A Python file with effects of your own; may be repeated."),
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", help="Say which version this is.", is_eager=True, callback=_told)
    ] = False,
) -> None:
    """Vehicle rollover load studies: what the ground does to a ROPS."""
    if effects:
        # the variable reaches the processes that a study or a diagnosis starts
        known = os.environ.get("ROLLOVER_EFFECTS", "")
        files = [str(path.resolve()) for path in effects]
        os.environ["ROLLOVER_EFFECTS"] = os.pathsep.join([*filter(None, [known]), *files])
