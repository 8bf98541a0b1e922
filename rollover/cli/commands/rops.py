"""`rollover rops`: a frame of members with sections alone, under the loads of a static test."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from rollover.cli.commands.common import (
    FAILED,
    AsJson,
    Force,
    Setting,
    answering,
    app,
    hand_out,
    manual,
    with_settings,
)
from rollover.system.arguments import SEGMENTS

JSON, PAGE = "rops.json", "report.html"


@app.command(
    "rops",
    epilog=manual(
        "rops two_post_rear_tubes_3t --mass 3000",
        "rops static_rops_test --set vehicle.rops=FRAME.yaml",
        writes=f"{JSON}, {PAGE}.",
    ),
)
@answering
def rops_(
    name: Annotated[
        str,
        typer.Argument(
            help="A ROPS, vehicle or scenario file, or the name of a shipped one.", metavar="ROPS|VEHICLE|SCENARIO"
        ),
    ],
    mass: Annotated[
        float | None, typer.Option(help="Of the vehicle, kg: needed for a ROPS by itself.", min=1.0, max=1e6)
    ] = None,
    segments: Annotated[int, typer.Option(help="Elements to a member.", min=2, max=200)] = SEGMENTS,
    clamped: Annotated[bool, typer.Option("--clamped", help="Feet held still instead of on their mounts.")] = False,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Of each load, m/s: what has a rate factor yields higher by it.",
            show_default="infinitely slow",
            min=1e-6,
            max=50.0,
        ),
    ] = None,
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/rops/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Load over deflection of a frame given by its sections: the static sequence, hinges, collapse, verdict."""
    from rollover.assessment import results
    from rollover.assessment.frame_json import FORMAT, faults_of, file_of, json_of, scenario_of
    from rollover.assessment.frame_test import frame_test
    from rollover.cli import console
    from rollover.spec import document
    from viz.pages.rops import page

    chosen = with_settings(scenario_of(name, mass), set_)
    folder = out or Path("out", "rops", Path(name).stem)
    about: dict[str, Any] = {"scenario_hash": document.content_hash(chosen), **chosen.own_code}
    about["origin"] = results.origin(file_of(name), folder, set_ or [])
    results.claim_report(folder, FORMAT, about, (JSON, PAGE), force=force, say=console.say)
    try:
        with faults_of(file_of(name)), console.counting("loads") as show:
            found = frame_test(chosen, segments=segments, clamped=clamped, speed=speed or 0.0, progress=show)
    except ArithmeticError as e:
        console.say(f"{name}: {e}")
        raise typer.Exit(FAILED) from None
    if clamped and not found.rops.mounts:
        console.say(f"{name}: --clamped changes nothing: the frame has no mounts, and feet are held still as they are")
    answer = json_of(found, about)
    words = [] if mass is None else ["--mass", f"{mass:g}"]
    words += ["--segments", str(segments)] if segments != SEGMENTS else []
    words += ["--clamped"] if clamped else []
    words += ["--speed", f"{speed:g}"] if speed else []
    words += [word for s in set_ or [] for word in ("--set", s)]
    text = page(answer, command=" ".join(map(shlex.quote, ["rollover", "rops", name, *words])))
    hand_out(answer, text, folder, (JSON, PAGE), as_json=as_json, show=lambda: console.rops(answer, str(folder)))
