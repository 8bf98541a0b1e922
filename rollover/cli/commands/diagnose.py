"""`rollover diagnose`: what physics a scenario left out, from recordings."""

from __future__ import annotations

import json
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import AsJson, Force, Setting, answering, app, manual, settings

if TYPE_CHECKING:
    from rollover.diagnosis import Diagnosis
    from rollover.diagnosis.overlay import Told


@app.command(
    epilog=manual(
        "diagnose drop_test rec --out out/diagnosis",
        writes="diagnosis.json, scenario-diagnosed.yaml (it runs), report.html, diagnosis.rrd.",
    )
)
@answering
def diagnose(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    recordings: Annotated[
        list[str], typer.Argument(help="Recordings with their conditions, or folders of them.", metavar="RECORDING...")
    ],
    hold_out: Annotated[
        list[str] | None,
        typer.Option(
            "--hold-out",
            metavar="NAME",
            help="A recording to judge by; may be repeated",
            show_default="each condition in turn",
        ),
    ] = None,
    tolerance: Annotated[
        float,
        typer.Option(
            help="Share of a channel's range by which a scenario that lacks nothing may miss it.", min=0, max=0.5
        ),
    ] = 0.0,
    set_: Setting = None,
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign files are.")] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/diagnose/NAME")] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Processes that fit at once; the answer is the same.", show_default="number of cores", min=0),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say what separates a scenario from recordings: which physics, value or sensor, where, and how sure that is."""
    from concurrent.futures import ThreadPoolExecutor

    from rollover.system.processes import begin_server, cores

    workers = cores() if workers is None else workers
    if workers > 1:
        begin_server(
            "rollover.diagnosis.fit.warmup"
        )  # as `Executor` does, but beside all that is imported and read here

    from rollover import scenario as scenarios
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.comparison.recordings import held_out, read
    from rollover.diagnosis import account, diagnosed_text
    from rollover.diagnosis.fit.jobs import Executor
    from rollover.diagnosis.io import FILES, FORMAT, JSON, PAGE, PICTURE, SCENARIO
    from rollover.diagnosis.overlay import series
    from rollover.diagnosis.sensors_first import check, diagnosed, plain, prechecked
    from rollover.spec import document
    from rollover.system.writing import notes

    path = document.find(scenario)
    chosen = scenarios.load(path)
    if set_:
        chosen = chosen.replaced(settings(set_), origin="--set")
    measured = read(recordings, profile)
    check(chosen, measured)
    held = held_out(list(measured), hold_out or [], "--hold-out")
    folder = out or Path("out", "diagnose", path.stem)
    about: dict[str, Any] = {
        "scenario_hash": document.content_hash(chosen),
        **chosen.own_code,
        "recordings": list(measured),
        "hold_out": held,
        "tolerance": tolerance,
    }
    about["origin"] = results.origin(path, folder, set_ or [])
    results.claim_account(folder, FORMAT, about, FILES, force=force, say=console.say)
    console.say("asking the sensors first")
    findings = prechecked(chosen, measured)
    # beside the results folder, which is written whole or not at all: what an interrupted diagnosis had fitted
    notebook = notes(folder)
    about_fits = json.dumps([about, results.versions()], sort_keys=True)
    words = ["rollover", "diagnose", scenario, *recordings, *_options(hold_out, set_, tolerance, profile)]
    with Executor(workers, notebook, about_fits) as executor:
        found = diagnosed(
            chosen, measured, findings, hold_out=held, tolerance=tolerance, say=console.say, executor=executor
        )
        told = series(chosen, list(measured.items()), found, executor.children)
        answer = account(found, about, plain(findings))
        with results.whole(folder) as part, ThreadPoolExecutor(1) as beside:
            results.write_json(part / JSON, answer)
            (part / SCENARIO).write_text(diagnosed_text(chosen, found), encoding="utf-8")
            drawn = beside.submit(_draw, found, told, part / PICTURE, chosen.title)
            from viz.pages.diagnosis import page

            text = page(
                found,
                told,
                title=chosen.title,
                scenario=chosen,
                prechecks=findings,
                command=" ".join(map(shlex.quote, words)),
                scenario_hash=about["scenario_hash"],
                versions=results.versions(),
                each=executor.each,
            )
            (part / PAGE).write_text(text, encoding="utf-8")
            drawn.result()
    executor.close()
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.diagnosis(found, str(folder))


def _options(hold_out: list[str] | None, set_: list[str] | None, tolerance: float, profile: Path | None) -> list[str]:
    stated, by = [f"{tolerance:g}"] if tolerance else [], [str(profile)] if profile else []
    given = (("--hold-out", hold_out or []), ("--set", set_ or []), ("--tolerance", stated), ("--profile", by))
    return [part for name, texts in given for text in texts for part in (name, text)]


def _draw(found: Diagnosis, told: Sequence[Told], path: Path, title: str) -> None:
    """The recording for the viewer, where there is a wheel to write it."""
    from rollover.cli import console

    try:
        from viz.recordings.diagnosis import write_diagnosis
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say(f"No rerun wheel for this platform: {path.name} was not written.")
        return
    write_diagnosis(found, told, path, title)
