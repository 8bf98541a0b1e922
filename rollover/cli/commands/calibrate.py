"""`rollover calibrate`: parameters of a scenario from recordings."""

from __future__ import annotations

import json
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import BROKE, AsJson, Force, Setting, answering, app, manual, scenario_with, settings
from rollover.system.arguments import MOST_CLOCK, MOST_SEED, MOST_WORKERS
from rollover.system.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from rollover.calibration.calibrate import Calibration
    from rollover.comparison.misfit import Misfit
    from rollover.recording import Recording
    from rollover.scenario import Scenario

JSON, OVERRIDE, SCENARIO, PAGE = "calibrate.json", "override.yaml", "scenario-calibrated.yaml", "report.html"
DRAWS = "posterior.csv"


@app.command(
    epilog=manual(
        "calibrate drop_test rec/d2.csv rec/d3.csv --fit vehicle.mass --fit ground.law.stiffness_scale=0.3:3",
        writes="calibrate.json, override.yaml, scenario-calibrated.yaml (it runs), report.html; with --posterior "
        "posterior.csv.",
        status=BROKE,
    )
)
@answering
def calibrate(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    recordings: Annotated[
        list[str], typer.Argument(help="Recordings with their conditions, or folders of them.", metavar="RECORDING...")
    ],
    fit: Annotated[
        list[str], typer.Option("--fit", metavar="PATH[=LOW:HIGH]", help="A value to be fitted; may be repeated.")
    ],
    hold_out: Annotated[
        list[str] | None, typer.Option("--hold-out", metavar="NAME", help="A recording to judge by; may be repeated.")
    ] = None,
    set_: Setting = None,
    channel: Annotated[list[str] | None, typer.Option("--channel", help="Use these channels only.")] = None,
    clock_sigma: Annotated[
        float, typer.Option(help="Prior of each recording's clock offset, s.", min=0.0, max=MOST_CLOCK)
    ] = 1e-3,
    starts: Annotated[int, typer.Option(help="Random starts that are screened.", min=0, max=100_000)] = 8,
    seed: Annotated[int, typer.Option(help="Of the random starts.", min=0, max=MOST_SEED)] = 0,
    posterior: Annotated[
        bool, typer.Option("--posterior/--no-posterior", help="Sample what the recordings leave open of the values.")
    ] = False,
    draws: Annotated[int, typer.Option(help="Samples of the posterior.", min=500, max=1_000_000)] = 3000,
    profile: Annotated[Path | None, typer.Option(help="What the columns of foreign files are.")] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/calibrate/NAME")] = None,
    workers: Annotated[
        int, typer.Option(help="Starts followed at once; 0 for this process.", min=0, max=MOST_WORKERS)
    ] = 0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Fit values of a scenario to recordings, with intervals, and say what the recordings cannot determine."""
    from rollover.assessment import results
    from rollover.calibration.io import FORMAT, json_of, table
    from rollover.calibration.posterior import installed
    from rollover.calibration.request import Request
    from rollover.cli import console
    from rollover.comparison.recordings import read
    from rollover.spec import document

    path, chosen = scenario_with(scenario, set_)
    request = Request.of(chosen, read(recordings, profile), fit, hold_out or [], by=("--fit", "--hold-out"))
    folder = out or Path("out", "calibrate", path.stem)
    about: dict[str, Any] = {
        "scenario_hash": document.content_hash(chosen),
        **chosen.own_code,
        "recordings": list(request.recordings),
        "fitted": fit,
        "held_out": request.held_out,
        **({"draws": draws} if posterior else {}),
    }
    if posterior:
        installed()
    about["origin"] = results.origin(path, folder, set_ or [])
    results.claim_report(folder, FORMAT, about, [JSON, OVERRIDE, SCENARIO, PAGE, DRAWS], force=force, say=console.say)
    found = request.calibrated(
        file=path,
        clock_sigma=clock_sigma,
        channels=channel,
        starts=starts,
        seed=seed,
        workers=workers,
        posterior=draws if posterior else 0,
    )
    answer = json_of(found, about)
    with results.whole(folder) as part:
        results.write_json(part / JSON, answer)
        if posterior:
            (part / DRAWS).write_text(table(found), encoding="utf-8")
        _write_scenario(part, folder, path, settings(set_ or []), found)
        from viz.pages.calibration import page

        options = [*_options(fit, hold_out), *(["--profile", str(profile)] if profile else [])]
        options += ["--posterior", "--draws", str(draws)] if posterior else []
        command = " ".join(map(shlex.quote, ["rollover", "calibrate", scenario, *recordings, *options]))
        curves, open_by = _curves(chosen, found, request.recordings)
        text = page(
            found,
            curves=curves,
            open_by=open_by,
            command=command,
            scenario_hash=about["scenario_hash"],
            versions=results.versions(),
        )
        (part / PAGE).write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps(results.plain(answer), indent=2))
    else:
        console.calibration(found, str(folder))


def _curves(
    chosen: Scenario, found: Calibration, recordings: Mapping[str, Recording]
) -> tuple[list[tuple[Misfit, Misfit]], Mapping[tuple[str, str], NDArray[np.float64]]]:
    """Each recording against the scenario before and after, and how far the fitted values leave the latter open."""
    from rollover.cli import console
    from rollover.comparison.compared import compared

    try:
        before, after = (compared(each, recordings).misfits for each in (chosen, found.calibrated))
        return list(zip(before, after, strict=True)), _open_by(found, recordings)
    except InputError as e:  # the fit stands; what cannot be rated is not drawn
        console.say(f"{PAGE} is without curves before and after: {e.faults[0]}")
        return [], {}


def _open_by(found: Calibration, recordings: Mapping[str, Recording]) -> dict[tuple[str, str], NDArray[np.float64]]:
    """One sigma (n,) of each simulated curve by recording and channel, SI, that the fitted values leave open."""
    from rollover.calibration.prediction import prediction_error
    from rollover.comparison.compared import compared

    def curves(scenario: Scenario) -> dict[tuple[str, str], NDArray[np.float64]]:
        made = compared(scenario.of_many(), recordings).misfits
        return {(m.recording, c.channel): c.simulated for m in made for c in m.channels}

    return prediction_error(found, curves)


def _options(fit: list[str], hold_out: list[str] | None) -> list[str]:
    return [
        part for name, texts in (("--fit", fit), ("--hold-out", hold_out or [])) for t in texts for part in (name, t)
    ]


def _write_scenario(part: Path, folder: Path, base: Path, given: dict[str, Any], found: Calibration) -> None:
    """What was fitted by path, and the scenario with it: laid over the file it came from where that is possible."""
    from rollover import scenario as scenarios
    from rollover.spec import document

    head = "Fitted values by path."
    (part / OVERRIDE).write_text(f"# {head}\n" + document.dump_mapping(found.override), encoding="utf-8")
    target = part / SCENARIO
    short = "# Calibrated; every other value is that of the base.\n"
    if not given and not any(step.isdecimal() for p in found.override for step in p.split(".")):
        shipped = base.resolve().parent == document.shipped_folder().resolve()
        name = base.name if shipped else Path(os.path.relpath(base.resolve(), folder.resolve())).as_posix()
        target.write_text(short + document.dump_mapping({"base": name, **_nested(found.override)}), encoding="utf-8")
        try:
            # read back from where it will stand: a sibling of the folder that is swapped in has the same parents
            if document.content_hash(scenarios.load(target)) == document.content_hash(found.calibrated):
                return
        except InputError:
            pass
    target.write_text(document.dump(found.calibrated, f"{found.calibrated.title}\nCalibrated."), encoding="utf-8")


def _nested(values: dict[str, float]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *above, last = path.split(".")
        at = tree
        for step in above:
            at = at.setdefault(step, {})
        at[last] = value
    return tree
