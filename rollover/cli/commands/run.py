"""`rollover run`: one scenario."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import (
    BROKE,
    FAILED,
    NO,
    THE_ANSWER_IS_NO,
    AsJson,
    Force,
    Setting,
    answering,
    app,
    manual,
    scenario_with,
)

if TYPE_CHECKING:
    from rollover.assessment.assessed import AssessedRun, Progress
    from rollover.assessment.criteria import Criterion
    from rollover.scenario import Scenario


@app.command(
    epilog=manual(
        "run side_overturn --set vehicle=vehicles/vineyard_tractor.yaml --out out/vineyard",
        "run drop_test --set initiation.speed=3.5 --json",
        writes="run.json (status, versions, hash, peak loads, criteria), scenario.yaml, channels.parquet, events.json, "
        "report.html, recording.rrd.",
        status=f"{NO}: a criterion is not met under --require; {BROKE}",
    )
)
@answering
def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/run/NAME")] = None,
    force: Force = False,
    half_step: Annotated[
        bool, typer.Option("--half-step/--no-half-step", help="Run again at half the step to see what it changes.")
    ] = True,
    ensemble: Annotated[
        int,
        typer.Option(
            help="Neighbouring starts, within the uncertainty of the initial state, for mean and scatter of each load.",
            min=1,
            max=100,
        ),
    ] = 1,
    require: Annotated[
        bool, typer.Option("--require", help="Exit with 1 if a criterion of loads.standards is not met.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Simulate one scenario: results, peak loads and a recording to look at."""
    from ground.compiled import is_warm
    from rollover.cli import console
    from rollover.spec import document

    path, chosen = scenario_with(scenario, set_)
    compiles = not is_warm(chosen.integrator)
    from rollover.assessment import results
    from rollover.assessment.assessed import assessed

    folder = out or Path("out", "run", path.stem)
    made_from = results.origin(path, folder, set_ or [])
    # before a run that may take minutes
    results.claim(folder, document.content_hash(chosen), force=force, made_from=made_from, say=console.say)
    with console.compiling(compiles), document.named(path):
        found = assessed(chosen, half_step=half_step, watch=_watched)
    done, again, rows = found.result, found.half_step, found.criteria
    if found.peaks and ensemble > 1:
        found = _with_scatter(found, ensemble)
    peaks = found.peaks
    command = " ".join(["rollover", "run", scenario, *(f"--set {shlex.quote(s)}" for s in set_ or [])])
    answer = results.write(
        folder,
        done,
        peaks,
        criteria=[asdict(row) for row in rows],
        half_step=again,
        picture=_picture(found),
        page=lambda answer: _page(found, answer, command),
        force=force,
        made_from=made_from,
    )
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.report(done, peaks, rows, answer, str(folder), headline=_headline(found), compiled=compiles)
    if done.status == "failed":
        console.say(f"{path}: the simulation failed: {done.sentence}")
        raise typer.Exit(FAILED)
    if require:
        _require(rows, str(path))


def _require(rows: Sequence[Criterion], path: str) -> None:
    """Say which verdicts are not met, or not given because the test did not go far enough. Raises `typer.Exit`."""
    from rollover.cli import console

    missed = [row for row in rows if row.verdict in ("not met", "no verdict")]
    for row in missed:
        asked, simulated, _ = row.in_words
        name = f"{row.requirement.standard}: {row.requirement.name}"
        console.say(f"{path}: {row.verdict}: {name}, got {simulated}; asked: {asked}. {row.note}")
    if missed:
        raise typer.Exit(THE_ANSWER_IS_NO)
    count = sum(row.verdict == "met" for row in rows)
    answer = f"all {count} verdicts are met" if count else "nothing to judge, no verdict was given"
    console.say(f"{path}: {answer}.")


@contextmanager
def _watched(what: str, scenario: Scenario) -> Iterator[Progress]:
    """Progress of a run, shown."""
    from rollover.cli import console

    lead = getattr(scenario.initiation, "lead_time", 0.0)
    with console.progress(what, -lead, scenario.simulation.duration) as show:
        yield show


def _with_scatter(found: AssessedRun, starts: int) -> AssessedRun:
    from rollover.cli import console
    from rollover.studies.ensemble import FailedRunError, with_scatter

    try:
        return with_scatter(found, starts)
    except FailedRunError as e:
        console.say(f"No scatter: {e}")
        return found


def _headline(found: AssessedRun) -> str:
    from viz.pages import report

    return report.headline(found.result, found.peaks, found.criteria, found.approaches).sentence


def _page(found: AssessedRun, answer: Mapping[str, Any], command: str) -> str:
    from viz.pages import report

    return report.page(
        found.result,
        found.peaks,
        answer,
        rows=found.criteria,
        near=found.approaches,
        bands=found.bands,
        command=command,
    )


def _picture(found: AssessedRun) -> Callable[[Path], None] | None:
    from rollover.cli import console

    try:
        from viz.recordings import log
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say("No rerun wheel for this platform: recording.rrd was not written.")
        return None
    return lambda path: log.write_rrd(found.result, path, peaks=found.peaks, bands=found.bands)
