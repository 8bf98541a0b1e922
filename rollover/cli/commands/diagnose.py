"""`rollover diagnose`: what physics a scenario left out, from recordings."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import AsJson, Force, Setting, answering, app, manual, settings
from rollover.cli.commands.profiles import profile_of
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.diagnosis import Diagnosis
    from rollover.diagnosis.overlay import Told
    from rollover.recording import Recording
    from rollover.recording.checks import Finding
    from rollover.scenario import Scenario

SPELT_OUT = 3  # findings alike of one channel


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
    from dataclasses import replace

    from rollover.system.processes import begin_server, cores

    workers = cores() if workers is None else workers
    if workers > 1:
        begin_server(
            "rollover.diagnosis.fit.warmup"
        )  # as `Executor` does, but beside all that is imported and read here

    from rollover import scenario as scenarios
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.diagnosis import account, diagnosed_text
    from rollover.diagnosis import diagnose as diagnosed
    from rollover.diagnosis.fit.jobs import Executor
    from rollover.diagnosis.io import FILES, FORMAT, JSON, PAGE, PICTURE, SCENARIO
    from rollover.diagnosis.overlay import series
    from rollover.spec import document
    from rollover.system.writing import notes

    path = document.find(scenario)
    chosen = scenarios.load(path)
    if set_:
        chosen = chosen.replaced(settings(set_), origin="--set")
    measured = read(recordings, profile)
    _check(chosen, measured)
    held = _held_out(list(measured), hold_out or [])
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
    findings = _prechecks(chosen, measured)
    # beside the results folder, which is written whole or not at all: what an interrupted diagnosis had fitted
    notebook = notes(folder)
    about_fits = json.dumps([about, results.versions()], sort_keys=True)
    words = ["rollover", "diagnose", scenario, *recordings, *_options(hold_out, set_, tolerance, profile)]
    with Executor(workers, notebook, about_fits) as executor:
        found = diagnosed(
            chosen, list(measured.items()), hold_out=held, tolerance=tolerance, say=console.say, executor=executor
        )
        found = replace(found, notes=(*in_words(findings), *found.notes))
        told = series(chosen, list(measured.items()), found, executor.children)
        answer = account(found, about, [{"recording": name, **_plain(f)} for name, f in findings])
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


def read(paths: Sequence[str], profile: Path | None = None) -> dict[str, Recording]:
    """Recordings by name, those in folders too. Raises `InputError` for all faults at once."""
    from rollover.recording.importers import read_named

    return {name: recording for name, (_, recording) in read_named(paths, profile_of(profile)).items()}


def _check(scenario: Scenario, measured: Mapping[str, Recording]) -> None:
    """Refuse conditions that the scenario does not know, all at once. Raises `InputError`."""
    from rollover.diagnosis.forward.forward_model import set_up

    faults: list[Fault] = []
    for recording in measured.values():
        try:
            set_up(scenario, recording)
        except InputError as e:
            faults += e.faults
    if faults:
        raise InputError(*faults)


def _held_out(names: list[str], given: list[str]) -> list[str]:
    from rollover.system.errors import hint

    for name in given:
        if name not in names:
            raise InputError(Fault(file="--hold-out", message=f"no such recording, got {name!r}; {hint(name, names)}"))
    if set(names) <= set(given):
        raise InputError(Fault(file="--hold-out", message=f"nothing left to fit, got all of {', '.join(names)}"))
    return sorted(set(given))


def in_words(findings: Sequence[tuple[str, Finding]]) -> Iterator[str]:
    """A line for each finding; of many alike in one channel of one recording the first ones, and how many more."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for name, f in findings:
        alike.setdefault((name, f.channel, f.check), []).append(f.sentence)
    for (name, channel, check), sentences in alike.items():
        yield from (f"{name}: {channel}: {s}" for s in sentences[:SPELT_OUT])
        if len(sentences) > SPELT_OUT:
            yield f"{name}: {channel}: {len(sentences) - SPELT_OUT} more such findings ({check})"


def _prechecks(scenario: Scenario, measured: Mapping[str, Recording]) -> list[tuple[str, Finding]]:
    """What the recordings alone give away about their sensors, before any model is asked."""
    from rollover.diagnosis.forward.forward_model import set_up
    from rollover.recording.checks import prechecks, shared_rails

    found = []
    for name, recording in measured.items():
        own = set_up(scenario, recording)
        mass = getattr(own.vehicle, "mass", None)
        found += [(name, f) for f in prechecks(recording, mass=mass, gravity=own.gravity)]
    told = {(name, f.check, f.channel) for name, f in found}
    return found + [(name, f) for name, f in shared_rails(measured) if (name, f.check, f.channel) not in told]


def _plain(finding: Finding) -> dict[str, Any]:
    from dataclasses import asdict

    from rollover.assessment import results

    bare: dict[str, Any] = results.plain(asdict(finding))
    return bare


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
