"""Options of `rollover` itself, before any command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import app
from rollover.system import own_code


def _print_version(wanted: bool) -> None:
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
        bool, typer.Option("--version", help="Say which version this is.", is_eager=True, callback=_print_version)
    ] = False,
    laws: Annotated[
        list[Path] | None,
        typer.Option("--laws", metavar="FILE", help="A Python file with ground laws of your own; may be repeated."),
    ] = None,
) -> None:
    """Vehicle rollover load studies: what the ground does to a ROPS."""
    own_code.add("effects", effects or [])
    own_code.add("laws", laws or [])
