"""`rollover diagnose`: what physics a scenario left out, from recordings."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import (
    AsJson,
    Force,
    Setting,
    answering,
    app,
    manual,
    number_by_channel,
    scenario_with,
)
from rollover.system.arguments import MOST_WORKERS
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.diagnosis import Diagnosis
    from rollover.diagnosis.overlay import Overlay
    from rollover.diagnosis.result import Estimate
    from rollover.recording import Recording

MOST_TOLERATED = 0.5  # of a range: what may miss half of it is no model of it


@app.command(
    epilog=manual(
        "diagnose drop_test rec --out out/diagnosis",
        "diagnose --model duffing rec --out out/model",
        writes="diagnosis.json, scenario-diagnosed.yaml (it runs), report.html, diagnosis.rrd; with --posterior "
        "posterior.csv; of a model the first.",
    )
)
@answering
def diagnose(
    scenario: Annotated[
        str, typer.Argument(help="A scenario file, or the name of a shipped one; with --model a recording as well.")
    ],
    recordings: Annotated[
        list[str] | None,
        typer.Argument(help="Recordings with their conditions, or folders of them.", metavar="RECORDING..."),
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="A Python file with a model of your own (`rollover.ForwardModel`), or the name of a shipped one, "
            "instead of a scenario: recorded inputs drive it.",
        ),
    ] = None,
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
        list[str] | None,
        typer.Option(
            metavar="[CHANNEL=]SHARE",
            help="Share of its range by which a scenario that lacks nothing may miss a channel; may be repeated",
            show_default="none; see --estimate",
        ),
    ] = None,
    reference: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A recording of the same rig in which nothing is suspected: it teaches that share; may be repeated.",
        ),
    ] = None,
    estimate: Annotated[
        bool | None,
        typer.Option(
            "--estimate/--no-estimate",
            help="Where nothing explains the recordings beside their noise, estimate how far the model misses by "
            "itself, and diagnose again beside that: whatever is stated, or never.",
            show_default="in place of `unexplained` alone, where no share is stated",
        ),
    ] = None,
    second_opinion: Annotated[
        bool | None,
        typer.Option(
            "--second-opinion/--no-second-opinion",
            help="Whether to do so in place of `unexplained`; all other answers stay.",
            show_default="it is done",
        ),
    ] = None,
    posterior: Annotated[
        bool, typer.Option("--posterior/--no-posterior", help="Sample what the recordings leave open of what is named.")
    ] = False,
    draws: Annotated[int, typer.Option(help="Samples of the posterior.", min=500, max=1_000_000)] = 3000,
    set_: Setting = None,
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign files are.")] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/diagnose/NAME")] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            help="Processes that fit at once; the answer is the same.",
            show_default="number of cores",
            min=0,
            max=MOST_WORKERS,
        ),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Say what separates a scenario from recordings: which physics, value or sensor, where, and how sure that is."""
    from concurrent.futures import ThreadPoolExecutor

    from rollover.system.processes import begin_server, cores

    if model is not None:
        given = {
            "--set": set_,
            "--reference": reference,
            "--estimate": estimate,
            "--second-opinion": second_opinion,
            "--posterior": posterior,
        }
        _diagnose_model(
            model,
            [scenario, *(recordings or [])],
            [name for name, value in given.items() if value],
            hold_out=hold_out or [],
            tolerance=tolerance or [],
            profile=profile,
            out=out,
            workers=workers,
            force=force,
            as_json=as_json,
        )
        return
    if not recordings:
        raise InputError(Fault(path="RECORDING", message="missing, got a scenario alone; at least one is needed"))
    workers = cores() if workers is None else workers
    if workers > 1:
        # as `Executor` does, but beside all that is imported and read here
        begin_server("rollover.diagnosis.fit.warmup")

    from rollover.assessment import results
    from rollover.calibration.posterior import OPTION, installed, table
    from rollover.cli import console
    from rollover.comparison.recordings import held_out, read
    from rollover.diagnosis import diagnosed_text, json_of
    from rollover.diagnosis.asked import (
        check_conditions,
        check_is_drop,
        diagnosed_with_prechecks,
        plain_findings,
        sensor_precheck,
    )
    from rollover.diagnosis.fit.jobs import Executor
    from rollover.diagnosis.io import DRAWS, FILES, FORMAT, JSON, PAGE, PICTURE, SCENARIO
    from rollover.diagnosis.overlay import overlays_of
    from rollover.spec import document
    from rollover.system.writing import notes

    path, chosen = scenario_with(scenario, set_)
    if posterior:
        installed()
        check_is_drop(chosen, OPTION)
    measured = read(recordings, profile)
    check_conditions(chosen, measured)
    held = held_out(list(measured), hold_out or [], "--hold-out")
    taught = _references(list(measured), reference or [], held)
    allowed = tolerances(tolerance or [], measured)
    if taught and allowed:
        raise InputError(Fault(file="--reference", message="beside --tolerance, got both; one of them says it"))
    if (estimate and second_opinion is not None) or (estimate is False and second_opinion):
        said = "--estimate" if estimate else "--no-estimate"
        raise InputError(Fault(file="--second-opinion", message=f"beside {said}, got both; one of them says it"))
    how: Estimate = True if estimate else False if False in (estimate, second_opinion) else "unexplained"
    folder = out or Path("out", "diagnose", path.stem)
    about: dict[str, Any] = {
        "scenario_hash": document.content_hash(chosen),
        **chosen.own_code,
        "recordings": list(measured),
        "hold_out": held,
        "tolerance": allowed,
        "reference": taught,
        "estimate": how,
        **({"draws": draws} if posterior else {}),
    }
    about["origin"] = results.origin(path, folder, set_ or [])
    results.claim_report(folder, FORMAT, about, FILES, force=force, say=console.say)
    console.say("asking the sensors first")
    findings = sensor_precheck(chosen, measured)
    # beside the results folder, which is written whole or not at all: what an interrupted diagnosis had fitted
    notebook = notes(folder)
    about_fits = json.dumps([about, results.versions()], sort_keys=True)
    words = ["rollover", "diagnose", scenario, *recordings, *_options(hold_out, tolerance, reference, set_, profile)]
    words += ["--posterior", "--draws", str(draws)] if posterior else []
    words += [] if how == "unexplained" else ["--estimate" if how else "--no-estimate"]
    with Executor(workers, notebook, about_fits) as executor:
        found = diagnosed_with_prechecks(
            chosen,
            measured,
            findings,
            hold_out=held,
            tolerance=allowed,
            reference=taught,
            estimate=how,
            posterior=draws if posterior else 0,
            say=console.say,
            executor=executor,
        )
        overlays = overlays_of(chosen, list(measured.items()), found, executor.children)
        answer = json_of(found, about, plain_findings(findings))
        with results.whole(folder) as part, ThreadPoolExecutor(1) as beside:
            results.write_json(part / JSON, answer)
            if found.posterior is not None:
                (part / DRAWS).write_text(table(found.posterior.names, found.posterior.values), encoding="utf-8")
            (part / SCENARIO).write_text(diagnosed_text(chosen, found), encoding="utf-8")
            drawn = beside.submit(_draw, found, overlays, part / PICTURE, chosen.title)
            from viz.pages.diagnosis import page

            text = page(
                found,
                overlays,
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
    if posterior and found.posterior is None:
        console.say("--posterior: nothing is named, so that there are no samples")
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.diagnosis(found, str(folder))


def _diagnose_model(
    name: str,
    paths: Sequence[str],
    refused: Sequence[str],
    *,
    hold_out: Sequence[str],
    tolerance: Sequence[str],
    profile: Path | None,
    out: Path | None,
    workers: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Diagnose a model of one's own; `refused` are options that only a scenario has."""
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.comparison.recordings import held_out, read
    from rollover.diagnosis.fit.jobs import Executor
    from rollover.diagnosis.io import FORMAT, JSON
    from rollover.diagnosis.own_model import declaration, diagnose_model, json_of
    from rollover.diagnosis.own_model.tables import tables
    from rollover.system.processes import cores
    from rollover.system.writing import notes

    if refused:
        raise InputError(Fault(file=refused[0], message="beside --model, got both; it is of scenarios alone"))
    path = declaration.found_at(name)
    model = declaration.load_model(path)
    with tables(model):
        measured = read(paths, profile)
    held = held_out(list(measured), hold_out, "--hold-out") if hold_out else []
    allowed = tolerances(tolerance, measured)
    if not isinstance(allowed, float):
        message = f"by channel, got {tolerance[0]!r}; beside --model one share for all is allowed"
        raise InputError(Fault(file="--tolerance", message=message))
    folder = out or Path("out", "diagnose", path.stem)
    about: dict[str, Any] = {
        "own_code": {declaration.FOLDER: declaration.hashes(path)},
        "recordings": list(measured),
        "hold_out": held,
        "tolerance": allowed,
        "origin": results.origin(path, folder),
    }
    results.claim_report(folder, FORMAT, about, (JSON,), force=force, say=console.say)
    about_fits = json.dumps([about, results.versions()], sort_keys=True)
    with Executor(cores() if workers is None else workers, notes(folder), about_fits) as executor:
        found = diagnose_model(model, measured, hold_out=held, tolerance=allowed, say=console.say, executor=executor)
    answer = json_of(model, found, about)
    with results.whole(folder) as part:
        results.write_json(part / JSON, answer)
    executor.close()
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.diagnosis(found, str(folder))


def _references(names: list[str], given: list[str], held: list[str]) -> list[str]:
    from rollover.comparison.recordings import check_names

    check_names(names, given, "--reference")
    for name in given:
        if name in held:
            raise InputError(Fault(file="--reference", message=f"held out too, got {name!r}; another one of {names}"))
    if set(names) <= {*given, *held}:
        raise InputError(Fault(file="--reference", message=f"nothing left to fit, got {', '.join(names)}"))
    return sorted(set(given))


def tolerances(given: Sequence[str], measured: Mapping[str, Recording]) -> float | dict[str, float]:
    """Shares as they are given: one for all channels, or by channel, those not named by the one for all.

    Raises `InputError`.
    """
    from rollover.system.errors import hint

    channels = list(dict.fromkeys(channel for recording in measured.values() for channel in recording.channels))
    found: dict[str, float] = {}
    general = 0.0
    for text in given:
        channel, share = number_by_channel(text)
        if not 0.0 <= share <= MOST_TOLERATED:
            number = text.rpartition("=")[2]
            message = f"not a share of a range, got {number!r}; a number from 0 to {MOST_TOLERATED:g}, or CHANNEL=SHARE"
            raise InputError(Fault(file="--tolerance", message=message))
        if channel is None:
            general = share
            continue
        if channel not in channels:
            message = f"no such channel in the recordings, got {channel!r}; {hint(channel, channels)}"
            raise InputError(Fault(file="--tolerance", message=message))
        found[channel] = share
    return {channel: found.get(channel, general) for channel in channels} if found else general


def _options(
    hold_out: list[str] | None,
    tolerance: list[str] | None,
    reference: list[str] | None,
    set_: list[str] | None,
    profile: Path | None,
) -> list[str]:
    given = (
        ("--hold-out", hold_out or []),
        ("--set", set_ or []),
        ("--tolerance", tolerance or []),
        ("--reference", reference or []),
        ("--profile", [str(profile)] if profile else []),
    )
    return [part for name, texts in given for text in texts for part in (name, text)]


def _draw(found: Diagnosis, overlays: Sequence[Overlay], path: Path, title: str) -> None:
    """The recording for the viewer, where there is a wheel to write it."""
    from rollover.cli import console

    try:
        from viz.recordings.diagnosis import write_diagnosis
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say(f"No rerun wheel for this platform: {path.name} was not written.")
        return
    write_diagnosis(found, overlays, path, title)
