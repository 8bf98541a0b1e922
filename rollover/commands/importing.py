"""`rollover import`: recordings of other programs and published sets into our own format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rollover.commands.door import AsJson, Force, answering, app, manual
from rollover.faults import Fault, InputError, hint

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rollover.recording import Recording


@app.command(
    "import",
    epilog=manual(
        "import test.mme --out rec",
        "import tosses --as cube-tosses --select 'toss00*'",
        writes="NAME.csv (or .parquet, .mme.zip) with its sidecar NAME.yaml for each recording.",
    ),
)
@answering
def import_(
    source: Annotated[Path, typer.Argument(help="A file or folder.")],
    kind: Annotated[str, typer.Option("--as", help="What it is; found out by itself where that is possible.")] = "",
    profile: Annotated[Path | None, typer.Option(help="What the columns are (rollover-profile/1).")] = None,
    select: Annotated[
        list[str] | None, typer.Option(help="Of a set of recordings, those whose names fit; may be repeated.")
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
    from rollover.importers import COLLECTIONS, with_channels, write_recording

    endings = ("csv", "parquet", "mme.zip")
    if to not in endings:
        raise InputError(Fault(file="--to", message=f"no such format, got {to!r}; {', '.join(endings)} are allowed"))
    folder = out or Path("out", "import", source.name.split(".")[0])
    usual = COLLECTIONS[kind].channels if kind in COLLECTIONS else lambda _: ("*",)
    made: list[tuple[str, Recording]] = []  # all are read before the first is written
    for name, recording in _recordings(source, kind, profile, select):
        made.append((name, with_channels(recording, channel or usual(recording), str(source))))
    rows = []
    targets = [folder / f"{name}.{to}" for name, _ in made]
    for target in targets:
        if target.exists() and not force:
            raise InputError(Fault(file=str(target), message="exists; --force replaces it, --out leaves it"))
    for target, (_, recording) in zip(targets, made, strict=True):
        write_recording(recording, target, force=force)
        channels = list(recording.channels)
        rows.append({"file": str(target), "samples": recording.time.size, "channels": channels})
        if not as_json:
            print(f"{target}: {recording.time.size} samples of {len(channels)} channels")
    if as_json:
        print(json.dumps({"files": rows}, indent=2))


def _recordings(
    source: Path, kind: str, profile: Path | None, select: list[str] | None
) -> Iterator[tuple[str, Recording]]:
    from rollover.importers import COLLECTIONS, importers, read_recording

    if kind in COLLECTIONS:
        if profile is not None:
            raise InputError(Fault(file=str(profile), message=f"{kind} needs no profile; leave it out"))
        found = list(COLLECTIONS[kind].read(source, select or ["*"]))
        if not found:
            raise InputError(Fault(file=str(source), message=f"nothing fits, got {select}; names such as toss001, *"))
        yield from found
        return
    known = [*importers(), *COLLECTIONS]
    if kind and kind not in known:
        raise InputError(Fault(file="--as", message=f"no such format, got {kind!r}; {hint(kind, known)}"))
    if select:
        raise InputError(
            Fault(file="--select", message=f"one recording, got {select}; only of a set can some be taken")
        )
    yield source.name.split(".")[0], read_recording(source, profile=profile, kind=kind)
