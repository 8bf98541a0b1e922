"""`rollover check`: validate files, and say what recordings tell about their sensors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from rollover.commands.door import AsJson, answering, app, manual
from rollover.faults import Fault, InputError, excerpt


@app.command(
    epilog=manual("check my_scenario.yaml rec/d3.csv", writes="nothing; what each file is goes to standard output.")
)
@answering
def check(
    files: Annotated[
        list[str],
        typer.Argument(help="Scenarios, vehicles, soils, recordings or folders of recordings.", metavar="FILE..."),
    ],
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign recordings are.")] = None,
    scenario: Annotated[str | None, typer.Option(help="Whose values the recordings' conditions must be.")] = None,
    as_json: AsJson = False,
) -> None:
    """Validate files and run nothing; recordings are searched for faults of their sensors."""
    rows: list[dict[str, Any]] = []
    faults: list[Fault] = []
    for name in (one for given in files for one in _each(given)):
        found: list[Fault] = []
        row: dict[str, Any] = {"file": name, "is": ""}
        try:
            row |= _recording(name, profile, scenario) if _is_recording(name) or profile else _document(name)
        except InputError as e:
            found = e.faults
        faults += found
        rows.append({**row, "faults": [{**vars(f), "text": str(f)} for f in found]})
        if not as_json and not found:
            _print(name, row)
    if as_json:
        print(json.dumps({"ok": not faults, "files": rows}, indent=2))
    if faults:
        raise InputError(*faults)


def _each(name: str) -> list[str]:
    """A file, or the recordings of a folder one by one; a folder without any is left to be refused."""
    from rollover.importers import recordings_at

    try:
        return [str(p) for p in recordings_at(Path(name))] if Path(name).is_dir() else [name]
    except InputError:
        return [name]


def _document(name: str) -> dict[str, Any]:
    from rollover import catalogue

    return {"is": catalogue.check(name)}


def _is_recording(name: str) -> bool:
    """Whatever is there and no YAML of ours; a sidecar by its format."""
    path = Path(name)
    if path.suffix.lower() not in (".yaml", ".yml"):
        return bool(path.suffix) or path.is_dir()
    try:
        with path.open("rb") as file:
            return b"rollover-recording/" in file.read(2000)
    except OSError:
        return False


def _recording(name: str, profile: Path | None, scenario: str | None) -> dict[str, Any]:
    from rollover.channels import describe
    from rollover.importers import read_recording
    from rollover.prechecks import noise_floors, prechecks

    recording = read_recording(name, profile=profile)
    gravity = 9.81
    if scenario is not None:
        from rollover import scenario as scenarios

        gravity = scenarios.load(scenario).replaced(recording.conditions, origin=f"{name}: conditions").gravity
    floors = noise_floors(recording)
    return {
        "is": "recording",
        "title": recording.title,
        "samples": recording.time.size,
        "start": float(recording.time[0]),
        "end": float(recording.time[-1]),
        "notes": list(recording.notes),
        "channels": [
            {
                "channel": channel,
                "unit": describe(channel).unit,
                "noise": floors[channel].sigma if channel in floors else None,
                "independence": floors[channel].independence if channel in floors else None,
            }
            for channel in recording.channels
        ],
        "findings": [vars(finding) for finding in prechecks(recording, gravity=gravity)],
    }


def _print(name: str, row: dict[str, Any]) -> None:
    from rollover.console import tell

    if row["is"] != "recording":
        tell(f"{name}: {row['is']}, in order")
        return
    span = f"{row['samples']} samples, {row['start']:.6g} to {row['end']:.6g} s"
    tell(f"{name}: recording, in order: {excerpt(row['title'])}, {span}")
    for channel in row["channels"]:
        noise = "noise not known" if channel["noise"] is None else f"noise {channel['noise']:.3g} {channel['unit']}"
        tell(f"  {channel['channel']}: {noise}")
    for note in row["notes"]:
        tell(f"  note: {note}")
    for f in row["findings"]:
        tell(f"  {f['check']}: {f['channel']}, {f['start']:.6g} to {f['end']:.6g} s: {f['sentence']}")
    if not row["findings"]:
        tell("  no fault of a sensor found")
