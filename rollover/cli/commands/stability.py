"""`rollover stability`: on how steep a slope a vehicle stands, against its heading."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from rollover.cli.commands.common import (
    BROKE,
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

JSON, PAGE = "stability.json", "report.html"


@app.command(
    "stability",
    epilog=manual("stability utility_tractor", writes="stability.json, report.html.", status=BROKE),
)
@answering
def stability_(
    name: Annotated[
        str,
        typer.Argument(help="A scenario or vehicle file, or the name of a shipped one.", metavar="SCENARIO|VEHICLE"),
    ],
    headings: Annotated[int, typer.Option(help="How many, evenly spaced.", min=1, max=360)] = 24,
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/stability/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Static stability angle against heading: lift-off, free pivot, stop and overturn, beside closed forms."""
    from ground.compiled import is_warm
    from rollover.assessment import results
    from rollover.assessment.standing import FORMAT, file_of, found_for, json_of, scenario_of
    from rollover.cli import console
    from rollover.spec import document

    chosen = with_settings(scenario_of(name), set_)
    folder = out or Path("out", "stability", Path(name).stem)
    about: dict[str, Any] = {"scenario_hash": document.content_hash(chosen), **chosen.own_code}
    about["origin"] = results.origin(file_of(name), folder, set_ or [])
    results.claim_report(folder, FORMAT, about, (JSON, PAGE), force=force, say=console.say)
    try:
        with console.compiling(not is_warm()), console.counting("headings") as show:
            found = found_for(chosen, headings, show)
    except ArithmeticError as e:
        console.say(f"{name}: {e}")
        raise typer.Exit(FAILED) from None
    answer = json_of(found, about)
    command = " ".join(
        [*map(shlex.quote, ["rollover", "stability", name, "--headings", str(headings)])]
        + [f"--set {shlex.quote(s)}" for s in set_ or []]
    )
    from viz.pages.stability import page

    text = page(answer, command=command)
    hand_out(answer, text, folder, (JSON, PAGE), as_json=as_json, show=lambda: console.stability(answer, str(folder)))
