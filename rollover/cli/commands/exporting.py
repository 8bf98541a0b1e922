"""`rollover export`: the channels of a result in a form that other programs read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import AsJson, Force, answering, app, manual
from rollover.cli.commands.recordings_out import check_format, written
from rollover.system.errors import Fault, InputError

FORMATS = ("csv", "xlsx", "mme.zip", "mat")
NO_ROOM = ("conditions", "uncertainty", "noise")  # in an ISO-MME test as it is written here


@app.command(
    epilog=manual(
        "export out/demo --to mat",
        "export out/demo --to xlsx --channel 'rops/*' --out rops.xlsx",
        "export out/compare/drop_test --to csv",
        writes="NAME.csv with its sidecar NAME.yaml, or NAME.xlsx, NAME.mme.zip, NAME.mat.",
    )
)
@answering
def export(
    result: Annotated[
        Path,
        typer.Argument(help="Results of a run or a comparison, a recording, or a folder of these.", metavar="RESULT"),
    ],
    to: Annotated[str, typer.Option(help=f"{', '.join(FORMATS[:-1])} or {FORMATS[-1]}.")] = "csv",
    channel: Annotated[
        list[str] | None, typer.Option(help="Channels to keep, such as 'rops/*'; may be repeated.", show_default="all")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder, or the file where it is one.", show_default="out/export/NAME")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write the channels of a result for other programs: SI units, names and units in the headings.

    `rollover import` reads each of them back: CSV and MATLAB to the last bit, a workbook to 16 digits, ISO-MME with
    its time to 1e-12 s.
    """
    from rollover.cli import console
    from rollover.comparison.curves import read_curves
    from rollover.recording.importers import name_of, read_named, with_channels

    check_format(to, FORMATS)
    other = [f for f in FORMATS if out is not None and out.name.endswith(f".{f}") and not out.is_dir()]
    if out is not None and other and to not in other:
        message = f"another ending than --to {to}, got {out.name!r}; NAME.{to} or --to {other[0]}"
        raise InputError(Fault(file="--out", message=message))
    name = name_of(result)
    read = read_curves(result) if result.is_dir() else {}
    read = read or read_named([result])
    made = {n: (at, with_channels(r, channel or ("*",), str(result))) for n, (at, r) in read.items()}
    place = out or Path("out", "export", name)
    written(made, place, to, source=str(result), force=force, as_json=as_json, with_units=True)
    if to == "mme.zip" and (lost := [k for k in NO_ROOM if any(getattr(r, k) for _, r in made.values())]):
        console.say(f"{result}: without its {', '.join(lost)}, for which an ISO-MME test has no place")
