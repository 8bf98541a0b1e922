"""`rollover view`: the recorded visualisation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rollover.commands.door import answering, app
from rollover.faults import Fault, InputError


@app.command()
@answering
def view(
    results: Annotated[Path, typer.Argument(help="A results folder or an .rrd file.", metavar="DIR_OR_RRD")],
) -> None:
    """Open the recorded visualisation in the native viewer."""
    from rollover.store import PICTURE

    path = results / PICTURE if results.is_dir() else results
    if not path.is_file():
        raise InputError(Fault(file=str(results), message=f"no {PICTURE} there; `rollover run` writes one"))
    from viz.viewer import open_viewer

    try:
        status = open_viewer(path)
    except FileNotFoundError as e:
        raise InputError(Fault(message=str(e))) from None
    if status != 0:
        raise InputError(Fault(file=str(path), message=f"the viewer could not show it, it ended with status {status}"))
