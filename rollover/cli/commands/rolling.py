"""`rollover rolling`: whether a narrow tractor with a front-mounted ROPS rolls on, by the planar calculation."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from rollover.cli.commands.common import (
    AsJson,
    Force,
    Setting,
    answering,
    app,
    hand_out,
    manual,
    settings,
    with_settings,
)

JSON, PAGE = "rolling.json", "report.html"


@app.command(
    "rolling",
    epilog=manual(
        "rolling vineyard_tractor", "rolling vineyard_tractor --input H6=1.6", writes="rolling.json, report.html."
    ),
)
@answering
def rolling_(
    name: Annotated[
        str,
        typer.Argument(help="A scenario or vehicle file, or the name of a shipped one.", metavar="SCENARIO|VEHICLE"),
    ],
    set_: Setting = None,
    input_: Annotated[
        list[str] | None,
        typer.Option(
            "--input", metavar="SYMBOL=VALUE", help="An input of the calculation, SI and rad; may be repeated."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/rolling/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Continuous or interrupted rolling of a narrow tractor, front ROPS: the planar calculation of Code 6."""
    from rollover.assessment import results
    from rollover.assessment.rolled import FORMAT, OPTION, json_of, rolled
    from rollover.assessment.standing import file_of, scenario_of
    from rollover.cli import console
    from rollover.spec import document
    from viz.pages.rolling import page

    chosen = with_settings(scenario_of(name), set_)
    given = {symbol: value.plain for symbol, value in settings(input_ or [], OPTION).items()}
    asked, found = rolled(chosen, given)
    folder = out or Path("out", "rolling", Path(name).stem)
    about: dict[str, Any] = {"scenario_hash": document.content_hash(chosen), "given": given, **chosen.own_code}
    about["origin"] = results.origin(file_of(name), folder, set_ or [])
    results.claim_report(folder, FORMAT, about, (JSON, PAGE), force=force, say=console.say)
    answer = json_of(asked, found, about)
    words = [f"--set {shlex.quote(s)}" for s in set_ or []] + [f"{OPTION} {shlex.quote(s)}" for s in input_ or []]
    text = page(answer, command=" ".join(["rollover rolling", shlex.quote(name), *words]))
    hand_out(answer, text, folder, (JSON, PAGE), as_json=as_json, show=lambda: console.rolling(answer, str(folder)))
