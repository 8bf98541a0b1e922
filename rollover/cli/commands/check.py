"""`rollover check`: validate files, and say what recordings tell about their sensors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import AsJson, answering, app, manual
from rollover.comparison.profiles import profile_of
from rollover.system.errors import Fault, InputError, excerpt

if TYPE_CHECKING:
    from rollover.recording import Recording
    from rollover.recording.importers.sidecar import Described


@app.command(
    epilog=manual("check my_scenario.yaml rec/d3.csv", writes="nothing; what each file is goes to standard output.")
)
@answering
def check(
    files: Annotated[
        list[str],
        typer.Argument(
            help="Files of any kind, folders of recordings, Python files with laws or effects.",
            metavar="FILE...",
        ),
    ],
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign recordings are.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Whose values the recordings' conditions must be.")] = None,
    as_json: AsJson = False,
) -> None:
    """Validate files and run nothing; recordings are searched for faults of their sensors."""
    rows: list[dict[str, Any]] = []
    read: dict[str, Recording] = {}
    faults: list[Fault] = []
    given = profile_of(profile)
    for name in (one for text in files for one in _each(text, given)):
        found: list[Fault] = []
        row: dict[str, Any] = {"file": name, "is": ""}
        try:
            row |= _recording(name, given, scenario, read) if _is_recording(name, given) else _document(name)
        except InputError as e:
            found = e.faults
        faults += found
        rows.append({**row, "faults": [{**vars(f), "text": str(f)} for f in found]})
    _shared(rows, read)
    for row in rows if not as_json else ():
        if not row["faults"]:
            _print(row["file"], row)
    if as_json:
        print(json.dumps({"ok": not faults, "files": rows}, indent=2))
    if faults:
        raise InputError(*faults)


def _each(name: str, profile: Described | None) -> list[str]:
    """A file, or the recordings of a folder one by one; a folder without any is left to be refused."""
    from rollover.recording.importers import recordings_at

    try:
        return [str(p) for p in recordings_at(Path(name), profile)] if Path(name).is_dir() else [name]
    except InputError:
        return [name]


def _document(name: str) -> dict[str, Any]:
    from rollover import scenario as scenarios
    from rollover.cli import catalogue
    from rollover.spec import document

    what = catalogue.check(name)
    return {"is": what, "notes": list(scenarios.load(document.find(name)).idle) if what == "scenario" else []}


def _is_recording(name: str, profile: Described | None) -> bool:
    """Whatever is there and no YAML of ours; a sidecar by its format. Without an ending it is one by its profile."""
    path = Path(name)
    if path.suffix.lower() == ".py":
        return False
    if path.suffix.lower() not in (".yaml", ".yml"):
        return bool(path.suffix) or path.is_dir() or (profile is not None and path.is_file())
    try:
        with path.open("rb") as file:
            return b"rollover-recording/" in file.read(2000)
    except OSError:
        return False


def _recording(
    name: str, profile: Described | None, scenario: str | None, read: dict[str, Recording]
) -> dict[str, Any]:
    import numpy as np

    from rollover.recording.checks import noise_floors, prechecks
    from rollover.recording.importers import read_recording
    from rollover.recording.time_stamps import is_far
    from rollover.spec.channels import describe

    recording = read[name] = read_recording(name, profile=profile)
    gravity, clock, notes = 9.81, None, list(recording.notes)
    if scenario is not None:
        from rollover import scenario as scenarios
        from rollover.comparison.onset import UnknownOnsetError, timed

        under = scenarios.load(scenario).replaced(recording.conditions, origin=f"{name}: conditions")
        gravity = under.gravity
        try:
            clock = timed(name, recording, under).zero
        except UnknownOnsetError as e:
            notes += [fault.message for fault in e.faults]
    first = float(recording.time[0]) if is_far(recording.time) else 0.0
    if clock is not None:
        notes.append(clock.sentence)
    elif first and recording.clock.zero == "known":
        notes.append(
            f"its stamps begin at {first:.10g} s, further from zero than they last: read as a clock without a zero"
        )
    floors = noise_floors(recording)
    return {
        "is": "recording",
        "title": recording.title,
        "samples": recording.time.size,
        "start": float(recording.time[0]),
        "end": float(recording.time[-1]),
        "step": float(np.median(np.diff(recording.time))) if recording.time.size > 1 else 0.0,
        "first": first,
        "notes": notes,
        **({} if clock is None else {"clock": clock.answer}),
        "channels": [
            {
                "channel": channel,
                "unit": describe(channel).unit,
                "noise": floors[channel].sigma if channel in floors else None,
                "independence": floors[channel].independence if channel in floors else None,
            }
            for channel in recording.channels
        ],
        "findings": [vars(f) for f in prechecks(recording, gravity=gravity)],
    }


def _shared(rows: list[dict[str, Any]], read: dict[str, Recording]) -> None:
    """Add to each recording what only several of them show together, where it is not there already."""
    if len(read) < 2:
        return
    from rollover.recording.checks import shared_rails

    by_name = {row["file"]: row for row in rows if row["is"] == "recording"}
    for name, f in shared_rails(read):
        listed = by_name[name]["findings"] if name in by_name else None
        if listed is not None and not any((t["check"], t["channel"]) == (f.check, f.channel) for t in listed):
            listed.append(vars(f))


def _print(name: str, row: dict[str, Any]) -> None:
    from rollover.cli.console import tell

    if row["is"] != "recording":
        tell(f"{name}: {row['is']}, valid")
        for note in row["notes"]:
            tell(f"  note: {note}")
        return
    from rollover.recording.checks import when

    first, step = row["first"], row["step"]
    span = f"{row['samples']} samples, {when(row['start'] - first, row['end'] - first, step)}"
    span += f" from its first stamp at {first:.10g} s" if first else ""
    tell(f"{name}: recording, valid: {excerpt(row['title'])}, {span}")
    for channel in row["channels"]:
        noise = "noise not known" if channel["noise"] is None else f"noise {channel['noise']:.3g} {channel['unit']}"
        tell(f"  {channel['channel']}: {noise}")
    for note in row["notes"]:
        tell(f"  note: {note}")
    for f in row["findings"]:
        tell(f"  {f['check']}: {f['channel']}, {when(f['start'] - first, f['end'] - first, step)}: {f['sentence']}")
    if all(f["check"] == "wrap-around" for f in row["findings"]):
        tell("  no fault of a sensor found")
