"""`rollover identify`: a ground law from recorded drops."""

from __future__ import annotations

import json
import shlex
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import AsJson, Force, Setting, answering, app, manual, settings
from rollover.system.arguments import LEAST_DEPTH, MOST_DEPTH, MOST_FORCE
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.calibration.identification import Identification

SOIL, ANSWER, PAGE = "soil.yaml", "identify.json", "report.html"


class Form(StrEnum):
    """Which law is identified."""

    ye = "ye-2006"
    bearing = "bearing"


class StrikerMass(StrEnum):
    """Which mass stands in eq (5), as `ground.striker_mass` of a scenario."""

    reference = "reference"
    effective = "effective"


@app.command(
    "identify",
    epilog=manual(
        "identify rec/d2.csv rec/d3.csv --out out/soil",
        writes="identify.json, a soil file that a scenario can name, report.html.",
    ),
)
@answering
def identify_(
    recordings: Annotated[
        list[str], typer.Argument(help="Recorded drops, or folders of them.", metavar="RECORDING...")
    ],
    scenario: Annotated[str, typer.Option(help="Whose striker fell, unless a recording says otherwise.")] = "drop_test",
    set_: Setting = None,
    form: Annotated[Form | None, typer.Option("--law", help="Law", show_default="ye-2006; bearing for a cone")] = None,
    fraction: Annotated[
        float | None, typer.Option(min=0.0, max=10.0, help="m_b1/m_s", show_default="the scenario's co-moving mass")
    ] = None,
    striker_mass: Annotated[StrikerMass, typer.Option(help="m_s in eq (5).")] = StrikerMass.reference,
    buoyancy: Annotated[
        float, typer.Option(min=0.0, max=MOST_FORCE, help="Of the striker in what it falls through, N.")
    ] = 0.0,
    terminal_speed: Annotated[
        bool, typer.Option("--terminal-speed", help="It fell at terminal speed: take the drag from there.")
    ] = False,
    keep: Annotated[bool, typer.Option("--keep", help="Published values for what the drops cannot determine.")] = False,
    to_depth: Annotated[
        float | None,
        typer.Option(
            min=LEAST_DEPTH, max=MOST_DEPTH, help="Down to which depth it is one soil, m.", show_default="all of it"
        ),
    ] = None,
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign files are.")] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/identify/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Identify a ground law from drops: stiffness over depth, coefficients with intervals, a soil file."""
    from rollover import scenario as scenarios
    from rollover.calibration import identification
    from rollover.cli import console
    from rollover.comparison.recordings import gathered
    from rollover.recording.importers import name_of
    from rollover.spec import document
    from rollover.system.writing import hold
    from viz.pages.identification import headline

    chosen = scenarios.load(document.find(scenario))
    if set_:
        chosen = chosen.replaced(settings(set_), origin="--set")
    found = gathered(recordings, profile)
    folder = out or Path("out", "identify", name_of(Path(recordings[0])))
    if not folder.exists() or folder.is_dir():
        hold(folder)
    _claim(folder, force)
    answer = identification.identified(
        found,
        chosen,
        form=None if form is None else form.value,
        fraction=fraction,
        law_mass=striker_mass.value,
        buoyancy=buoyancy,
        terminal=terminal_speed,
        keep=keep,
        to_depth=to_depth,
    )
    report = identification.json_of(answer)
    _write(folder, answer, report, shlex.join(["rollover", "identify", *recordings]))
    for reason in answer.refused:
        console.say(f"left out: {reason}")
    if as_json:
        print(json.dumps(report, indent=2))
        return
    console.tell(f"{headline(report)}.")
    widths = [max(map(len, column)) for column in zip(*answer.table, strict=True)]
    for row in answer.table:
        console.tell("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for remark in answer.remarks:
        console.tell(remark)
    console.tell(f"Soil: {folder / SOIL}")


def _claim(folder: Path, force: bool) -> None:
    if not folder.exists():
        return
    from rollover.system.writing import own

    there = [p.name for p in folder.iterdir() if not own(folder.resolve(), p.name)] if folder.is_dir() else []
    foreign = [name for name in there if name not in (SOIL, ANSWER, PAGE)] if folder.is_dir() else [folder.name]
    if foreign:
        raise InputError(
            Fault(file=str(folder), message=f"holds files that are not results, got {foreign[0]!r}; another --out")
        )
    if there and not force:
        raise InputError(
            Fault(file=str(folder), message="holds an identification; --force replaces it, --out leaves it")
        )


def _write(folder: Path, answer: Identification, report: dict[str, Any], command: str) -> None:
    """All files, or none."""
    from rollover.assessment.results import versions
    from rollover.system.writing import whole
    from viz.pages.identification import page

    text = page(
        answer.law,
        report,
        refused=answer.refused,
        remarks=answer.remarks,
        command=command,
        versions=versions(),
    )
    with whole(folder) as part:
        (part / SOIL).write_text(answer.soil, encoding="utf-8")
        (part / ANSWER).write_text(json.dumps(report, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        (part / PAGE).write_text(text, encoding="utf-8")
