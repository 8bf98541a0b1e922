"""`rollover import`: recordings of other programs and published sets into our own format."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rollover.cli.commands.common import AsJson, Force, answering, app, manual
from rollover.comparison.profiles import profile_of
from rollover.system.errors import Fault, InputError, hint

if TYPE_CHECKING:
    from collections.abc import Mapping

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
    from rollover.cli import console
    from rollover.recording.importers import COLLECTIONS, name_of, with_channels
    from rollover.system.names import distinct, inside
    from rollover.system.writing import hold

    endings = ("csv", "parquet", "mme.zip")
    if to not in endings:
        raise InputError(Fault(file="--to", message=f"no such format, got {to!r}; {', '.join(endings)} are allowed"))
    folder = out or Path("out", "import", name_of(source))
    usual = COLLECTIONS[kind].channels if kind in COLLECTIONS else lambda _: ("*",)
    read = _recordings(source, kind, profile, select)  # all of it before the first is written
    made = {name: (at, with_channels(r, channel or usual(r), str(source))) for name, (at, r) in read.items()}
    spelt = distinct(made, f".{to}", file=str(source))
    targets = {name: inside(folder, f"{spelt[name]}.{to}") for name in made}
    for target, (at, _) in zip(targets.values(), made.values(), strict=True):
        hold(target)
        if at is not None and target.exists() and target.samefile(at):
            raise InputError(Fault(file=str(target), message="would replace the recording that is read; another --out"))
    beside = [t if to == "mme.zip" else t.with_name(f"{spelt[name]}.yaml") for name, t in targets.items()]
    taken = [t for t in (*targets.values(), *beside) if t.exists()]
    if taken and not force:
        raise InputError(Fault(file=str(taken[0]), message="exists; --force replaces it, --out leaves it"))
    for name in [n for n in made if spelt[n] != n]:
        at, recording = made[name]
        what = f"stands for {name!r}, which is no name for a file"
        made[name] = at, replace(recording, notes=(*recording.notes, what))
        console.say(f"{targets[name]}: {what}")
    _write({targets[name]: recording for name, (_, recording) in made.items()})
    rows = []
    for name, (_, recording) in made.items():
        channels = list(recording.channels)
        notes = list(recording.notes)
        rows.append({"file": str(targets[name]), "samples": recording.time.size, "channels": channels, "notes": notes})
        if not as_json:
            console.tell(f"{targets[name]}: {recording.time.size} samples of {len(channels)} channels")
            for note in notes:
                console.tell(f"  note: {note}")
    if as_json:
        print(json.dumps({"files": rows}, indent=2))


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


def _write(made: Mapping[Path, Recording]) -> None:
    """All recordings, or none. Raises `InputError`."""
    from rollover.recording.importers import write_recording
    from rollover.system.writing import together

    with together(list(made)[-1]) as part:
        for target, recording in made.items():
            try:
                write_recording(recording, part / target.name)
            except InputError as e:  # which names the file that stands there for a while only
                raise InputError(*(replace(fault, file=str(target)) for fault in e.faults)) from None
