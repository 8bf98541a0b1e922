"""`rollover regress`: peak loads against baselines."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Mapping, Sequence
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
    answering,
    app,
    manual,
)
from rollover.system.arguments import LONGEST, MOST_WORKERS
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.studies.baseline import Answer, Baseline


@app.command(
    epilog=manual(
        "regress",
        "regress side_overturn --update --reason 'stiffer rear tyres'",
        writes="regress.json, regress.csv, report.html; with --update the baselines beside the scenarios.",
        status=f"{NO}: a load has changed; {BROKE}",
    )
)
@answering
def regress(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios or folders of them", show_default="all shipped", metavar="[SCENARIO]..."),
    ] = None,
    update: Annotated[bool, typer.Option("--update", help="Write the baselines anew; needs --reason.")] = False,
    reason: Annotated[str, typer.Option(help="Why the loads may be others from now on; kept in the baseline.")] = "",
    out: Annotated[Path, typer.Option(help="Folder of the full report.")] = Path("out/regress"),
    workers: Annotated[
        int | None, typer.Option(help="Runs at once", show_default="number of cores", min=0, max=MOST_WORKERS)
    ] = None,
    time_limit: Annotated[float, typer.Option(help="Wall time for each run, s.", min=1.0, max=LONGEST)] = 600.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Compare peak loads with their baselines; exit status 1 if any has changed."""
    if update and not reason.strip():
        raise InputError(Fault(file="--update", message="without a reason; --reason TEXT is needed"))
    if reason.strip() and not update:
        raise InputError(Fault(file="--reason", message="nothing to give a reason for; --update is needed"))
    from ground.compiled import is_warm
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.studies import baseline as baselines
    from rollover.studies import regression
    from rollover.system.transaction import update as updating

    choice = regression.chosen(scenarios or [])
    selection = sorted(f.stem for f in choice.files)
    _settled(choice.files, update)
    for file in choice.left_out:
        console.say(f"{file}: left out, no scenario")

    def overlaps(found: Mapping[str, Any]) -> str:
        named = found.get("scenarios")
        before = {*map(str, named if isinstance(named, list) else ())}
        shared = before & {*selection}
        return f"replaces the report of {', '.join(sorted(before))}" if shared else ""

    results.claim_report(
        out, FORMAT, {"scenarios": selection}, REPORT_FILES, force=force, own_report=overlaps, say=console.say
    )
    failed: list[Answer] = []
    new: dict[Path, Baseline] = {}
    with console.compiling(not is_warm()), console.counting("runs") as show:
        if update:
            try:
                answers = regression.updated(
                    choice, reason.strip(), workers=workers, time_limit=time_limit, show=show, write=new.update
                )
            except regression.FailedUpdateError as e:
                answers = failed = e.answers
        else:
            answers = regression.compared(choice, workers=workers, time_limit=time_limit, show=show)
    report = _report(selection, answers, _hash(choice.files))
    with updating(out, baselines.texts(new)) as part:
        results.write_json(part / JSON, report)
        results.write_csv(part / CSV, _rows(answers))
        (part / PAGE).write_text(_page(answers, scenarios or [], report["scenario_hash"]), encoding="utf-8")
    if as_json:
        print(json.dumps(report, indent=2))
    else:
        console.regression(answers, str(out))
    if failed:
        console.say("Nothing was written to the baselines.")
        raise typer.Exit(FAILED)
    if not report["ok"]:
        raise typer.Exit(THE_ANSWER_IS_NO)


FORMAT = "rollover-regress/1"
JSON, CSV, PAGE = "regress.json", "regress.csv", "report.html"
REPORT_FILES = (JSON, CSV, PAGE)


def _settled(files: Sequence[Path], update: bool) -> None:
    """Keep the baselines to this process if they are to be written, and finish what a killed update began there."""
    from rollover.studies.baseline import FOLDER
    from rollover.system.transaction import JOURNAL, finish
    from rollover.system.writing import hold, sweep

    for folder in sorted({file.parent.resolve() / FOLDER for file in files}):
        if update or (folder / JOURNAL).exists():
            hold(folder)
            finish(folder / JOURNAL)
            sweep(folder)


def _hash(files: Sequence[Path]) -> str:
    """One hash over all scenarios; of a file that cannot be read its bytes."""
    from rollover import scenario as scenarios
    from rollover.spec import document

    digest = hashlib.sha256()
    for file in sorted(files, key=lambda f: f.stem):
        try:
            own = document.content_hash(scenarios.load(file))
        except InputError:
            own = hashlib.sha256(file.read_bytes()).hexdigest()
        digest.update(f"{file.stem} {own}\n".encode())
    return digest.hexdigest()


def _report(selection: list[str], answers: list[Answer], scenario_hash: str) -> dict[str, Any]:
    from rollover.assessment import results

    found: dict[str, Any] = results.plain(
        {
            "format": FORMAT,
            "ok": all(a.ok for a in answers),
            "scenarios": selection,
            "scenario_hash": scenario_hash,
            "versions": results.versions(),
            "answers": [asdict(a) for a in answers],
        }
    )
    return found


def _rows(answers: list[Answer]) -> list[dict[str, Any]]:
    return [{"scenario": a.scenario, "verdict": a.verdict, **asdict(d)} for a in answers for d in a.differences]


def _page(answers: list[Answer], names: list[str], scenario_hash: str) -> str:
    from viz.pages.regression import page

    return page(
        answers, command=" ".join(map(shlex.quote, ["rollover", "regress", *names])), scenario_hash=scenario_hash
    )
