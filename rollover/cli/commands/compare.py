"""`rollover compare`: measured against simulated."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import (
    BROKE,
    FAILED,
    AsJson,
    Force,
    Setting,
    answering,
    app,
    manual,
    scenario_with,
)
from rollover.system.arguments import LEAST_CFC, MOST_CFC
from rollover.system.errors import THERE, Fault, InputError, absent, cured

if TYPE_CHECKING:
    from rollover.comparison.compared import Progress
    from rollover.comparison.misfit import Misfit
    from rollover.comparison.run_pair import Pair
    from rollover.dynamics.result import Run
    from rollover.scenario import Scenario

PAIR = "rollover-compare-runs/1"
JSON, PAGE, PICTURE = "compare.json", "report.html", "compare.rrd"


@app.command(
    epilog=manual(
        "compare drop_test rec/d3.csv",
        "compare out/run/side_overturn out/vineyard",
        writes="compare.json, report.html, compare.rrd (one for each recording; two runs in one); of recordings also "
        "measured.parquet and simulated.parquet, the histories as they were rated.",
        status=BROKE,
    )
)
@answering
def compare(
    scenario: Annotated[
        str,
        typer.Argument(
            help="A scenario file, the name of a shipped one, or a run's results.", metavar="SCENARIO_OR_DIR"
        ),
    ],
    recordings: Annotated[
        list[str],
        typer.Argument(
            help="Recordings with their conditions, or folders of them; beside results another run's.",
            metavar="RECORDING...",
        ),
    ],
    set_: Setting = None,
    cfc: Annotated[
        int | None,
        typer.Option(
            help="Filter class for both sides, refused where one is too slow",
            show_default="loads.cfc if possible",
            min=LEAST_CFC,
            max=MOST_CFC,
        ),
    ] = None,
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign files are.")] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/compare/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Compare recordings with runs under their conditions: rated, by channel and phase.

    Nothing is shifted in time but a clock in doubt, to the zero that the recording shows.
    """
    from ground.compiled import is_warm
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.comparison.compared import FORMAT, compared, json_of
    from rollover.comparison.curves import curve_files, files_of, write_curves
    from rollover.comparison.recordings import read
    from rollover.comparison.run_pair import is_result
    from rollover.spec import document

    if is_result(scenario):
        refused = {"--set": set_, "--cfc": cfc, "--profile": profile}
        _two_runs(scenario, recordings, [name for name, given in refused.items() if given], out, force, as_json)
        return
    path, chosen = scenario_with(scenario, set_)
    measured = read(recordings, profile)
    folder = out or Path("out", "compare", path.stem)
    pictures, curves = files_of(list(measured), "compare", ".rrd"), curve_files(list(measured))
    about: dict[str, Any] = {
        "scenario_hash": document.content_hash(chosen),
        **chosen.own_code,
        "recordings": list(measured),
    }
    about["origin"] = results.origin(path, folder, set_ or [])
    files = [JSON, PAGE, *pictures.values(), *curves.values()]
    results.claim_report(folder, FORMAT, about, files, force=force, say=console.say)
    with console.compiling(not is_warm()):
        done = compared(chosen, measured, file=path, cfc=cfc, watch=_watched)
    found, runs = done.misfits, done.runs
    answer = json_of(done, about)
    by = ["--profile", str(profile)] if profile else []
    command = " ".join(map(shlex.quote, ["rollover", "compare", scenario, *recordings, *by]))
    with results.whole(folder) as part:
        results.write_json(part / JSON, answer)
        from viz.pages.comparison import page

        text = page(
            found,
            title=chosen.title,
            scenario=chosen,
            command=command,
            scenario_hash=about["scenario_hash"],
            versions=results.versions(),
        )
        (part / PAGE).write_text(text, encoding="utf-8")
        write_curves(found, curves, part)
        draw = _picture()
        for each in found if draw is not None else ():
            assert draw is not None
            draw(runs[each.recording], each, part / pictures[each.recording])
    if as_json:
        print(json.dumps(results.plain(answer), indent=2))
    else:
        console.comparison(found, str(folder))
    failed = [name for name, run in runs.items() if run.status == "failed"]
    for name in failed:
        console.say(f"{name}: the simulation failed: {runs[name].sentence}")
    if failed:
        raise typer.Exit(FAILED)


def _two_runs(
    baseline: str, others: list[str], refused: list[str], out: Path | None, force: bool, as_json: bool
) -> None:
    """A baseline's results against a candidate's. Raises `InputError`."""
    from rollover.assessment import results
    from rollover.cli import console
    from rollover.comparison.run_pair import is_result, pair, summary
    from rollover.comparison.run_pair import read as result
    from viz.content.pair_words import answer as in_words
    from viz.pages.pair import page

    if refused:
        raise InputError(Fault(file=refused[0], message="two runs are compared as they are; leave it out"))
    if len(others) == 1 and not Path(others[0]).exists():
        raise InputError(cured(Fault(file=others[0], message=absent(others[0])), THERE))
    if len(others) != 1 or not is_result(others[0]):
        got = " ".join(others)
        message = f"the results of a run, got {got!r} beside them; the results of one other run are needed"
        raise InputError(Fault(file=baseline, message=message))
    found = pair(result(Path(baseline)), result(Path(others[0])))
    folder = out or Path("out", "compare", Path(others[0]).resolve().name)
    about = {side: getattr(found, side).answer["scenario_hash"] for side in ("baseline", "candidate")}
    results.claim_report(folder, PAIR, {"hashes": about}, [JSON, PAGE, PICTURE], force=force)
    answer = {"format": PAIR, "hashes": about, **summary(found), "answer": in_words(found)}
    command = " ".join(map(shlex.quote, ["rollover", "compare", baseline, *others]))
    with results.whole(folder) as part:
        results.write_json(part / JSON, answer)
        (part / PAGE).write_text(page(found, command=command, versions=results.versions()), encoding="utf-8")
        _draw_pair(found, part / PICTURE)
    if as_json:
        print(json.dumps(results.plain(answer), indent=2))
    else:
        console.pair(found, str(folder))


def _draw_pair(found: Pair, path: Path) -> None:
    from rollover.cli import console

    try:
        from viz.recordings.pair import write_pair

        write_pair(found, path)
    except FileNotFoundError as e:
        console.say(f"{e}; {path.name} was not written")
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say(f"No rerun wheel for this platform: {path.name} was not written.")


@contextmanager
def _watched(name: str, under: Scenario) -> Iterator[Progress]:
    """Progress of one recording's run, shown."""
    from rollover.cli import console

    lead = getattr(under.initiation, "lead_time", 0.0)
    with console.progress(f"simulating {name}", -lead, under.simulation.duration) as show:
        yield show


def _picture() -> Callable[[Run, Misfit, Path], None] | None:
    from rollover.cli import console

    try:
        from viz.recordings.comparison import write_comparison
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say(f"No rerun wheel for this platform: {PICTURE} was not written.")
        return None
    return write_comparison
