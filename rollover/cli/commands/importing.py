"""`rollover import`: recordings of other programs and published sets into our own format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rollover.cli.commands.common import AsJson, Force, answering, app, manual
from rollover.cli.commands.recordings_out import check_format, written
from rollover.comparison.profiles import profile_of
from rollover.system.errors import Fault, InputError, hint

if TYPE_CHECKING:
    from rollover.recording import Recording


@app.command(
    "import",
    epilog=manual(
        "import test.mme --out rec",
        "import raw --profile bench.yaml --out rec",
        "import tosses --as cube-tosses --select 'toss00*'",
        writes="NAME.csv (or .parquet, .mme.zip) with its sidecar NAME.yaml for each recording.",
    ),
)
@answering
def import_(
    source: Annotated[Path, typer.Argument(help="A file, or a folder of them.")],
    kind: Annotated[str, typer.Option("--as", help="What it is; found out by itself where that is possible.")] = "",
    profile: Annotated[
        Path | None, typer.Option(help="What the columns and conditions are (rollover-profile/1).")
    ] = None,
    select: Annotated[
        list[str] | None,
        typer.Option(
            help="Of a set of recordings, or several tests in a file, those whose names fit; may be repeated."
        ),
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option(
            help="Channels to keep, such as 'chassis/position_?'; may be repeated.", show_default="all, or a set's own"
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder", show_default="out/import/NAME")] = None,
    to: Annotated[str, typer.Option(help="csv, parquet or mme.zip.")] = "csv",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Turn recordings of other formats into rollover-recording/1 files."""
    from rollover.recording.importers import COLLECTIONS, name_of, with_channels

    check_format(to, ("csv", "parquet", "mme.zip"))
    folder = out or Path("out", "import", name_of(source))
    usual = COLLECTIONS[kind].channels if kind in COLLECTIONS else lambda _: ("*",)
    read = _recordings(source, kind, profile, select)  # all of it before the first is written
    made = {name: (at, with_channels(r, channel or usual(r), str(source))) for name, (at, r) in read.items()}
    written(made, folder, to, source=str(source), force=force, as_json=as_json)


def _recordings(
    source: Path, kind: str, profile: Path | None, select: list[str] | None
) -> dict[str, tuple[Path | None, Recording]]:
    """File, where it is one, and recording by name. Raises `InputError`, for two of one name too."""
    from rollover.recording.importers import COLLECTIONS, importers, read_named

    if kind in COLLECTIONS:
        if profile is not None:
            raise InputError(Fault(file=str(profile), message=f"{kind} needs no profile; leave it out"))
        found: dict[str, tuple[Path | None, Recording]] = {}
        for name, recording in COLLECTIONS[kind].read(source, select or ["*"]):
            if name in found:
                raise InputError(Fault(file=str(source), message=f"two recordings by one name, got {name!r}; --select"))
            found[name] = (None, recording)
        if not found:
            raise InputError(Fault(file=str(source), message=f"nothing fits, got {select}; names such as toss001, *"))
        return found
    known = [*importers(), *COLLECTIONS]
    if kind and kind not in known:
        raise InputError(Fault(file="--as", message=f"no such format, got {kind!r}; {hint(kind, known)}"))
    return {**read_named([source], profile_of(profile), kind, select or ())}
