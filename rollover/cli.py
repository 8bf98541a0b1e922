"""The commands. Exit status: 0 done, 1 the answer is no, 2 the input is wrong, 3 the simulation failed."""

from __future__ import annotations

import functools
import json
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

# what takes long to import is imported by the command that needs it: `rollover --help` answers at once
from rollover.faults import Fault, InputError

if TYPE_CHECKING:
    from rollover.loads import PeakLoad
    from rollover.run import Run
    from rollover.scenario import Scenario

WRONG_INPUT, FAILED, INTERRUPTED, BUG = 2, 3, 130, 70
COMPILING = 25  # s, roughly, on two cores

C = TypeVar("C", bound=Callable[..., None])

app = typer.Typer(
    help="Vehicle rollover load studies: what the ground does to a ROPS.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Listed(StrEnum):
    """What `list` can list."""

    scenarios = "scenarios"
    vehicles = "vehicles"
    soils = "soils"
    laws = "laws"
    effects = "effects"
    channels = "channels"
    paths = "paths"


class Part(StrEnum):
    """What `schema` can describe."""

    scenario = "scenario"
    vehicle = "vehicle"
    soil = "soil"


AsJson = Annotated[bool, typer.Option("--json", help="Print the answer as JSON on standard output.")]


def _answering(command: C) -> C:
    """Turn wrong input and an interrupt into their exit status; any other exception is a bug and stays one."""

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except InputError as e:
            print(e, file=sys.stderr)
            raise typer.Exit(WRONG_INPUT) from None
        except KeyboardInterrupt:
            print("Interrupted.", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None

    return wrapped  # type: ignore[return-value]


@app.command()
@_answering
def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Replace a value; may be repeated.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Results folder  [default: out/run/NAME]")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace another run's results.")] = False,
    half_step: Annotated[
        bool, typer.Option("--half-step/--no-half-step", help="Run again at half the step to see what it changes.")
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Simulate one scenario: results, peak loads and a recording to look at."""
    from ground.compiled import is_warm
    from rollover import console, document

    path = document.find(scenario)
    from rollover import scenario as scenarios

    chosen = scenarios.load(path)
    if set_:
        chosen = chosen.replaced(_settings(set_), origin="--set")
    if not is_warm():
        console.say(f"Compiling the contact kernels, once per installation: about {COMPILING} s.")
    from rollover import loads, store

    folder = out or Path("out", "run", path.stem)
    store.claim(folder, document.content_hash(chosen), force=force)  # before a run that may take minutes
    done, again = _simulated(chosen, half_step)
    # what a run that broke off reached is in its channels; a peak of it would pass for the peak
    peaks = loads.peak_loads(done, again if again and again.status == "done" else None) if done.status == "done" else ()
    answer = store.write(folder, done, peaks, half_step=again, picture=_picture(done, peaks), force=force)
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.report(done, peaks, answer, str(folder))
    if done.status == "failed":
        console.say(f"{path}: the simulation failed: {done.sentence}")
        raise typer.Exit(FAILED)


def _settings(given: list[str]) -> dict[str, Any]:
    from rollover import document

    settings: dict[str, Any] = {}
    for text in given:
        path, value = document.parse_setting(text)
        if path in settings:
            raise InputError(Fault(file="--set", path=path, message="given twice; once is allowed"))
        settings[path] = value
    return settings


def _simulated(scenario: Scenario, half_step: bool) -> tuple[Run, Run | None]:
    from rollover import console, simulate

    lead = getattr(scenario.initiation, "lead_time", 0.0)
    settings = scenario.simulation
    with console.progress("simulating", -lead, settings.duration) as show:
        done = simulate.run(scenario, progress=show)
    if not half_step or done.status == "failed":
        return done, None
    finer = scenario.replaced({"simulation.step": 0.5 * settings.step})
    with console.progress("again at half the step", -lead, settings.duration) as show:
        return done, simulate.run(finer, progress=show)


def _picture(done: Run, peaks: Sequence[PeakLoad]) -> Callable[[Path], None] | None:
    from rollover import console

    try:
        from viz import log
    except ImportError as e:
        if (e.name or "").partition(".")[0] != "rerun":
            raise
        console.say("No rerun wheel for this platform: recording.rrd was not written.")
        return None
    return lambda path: log.write_rrd(done, path, peaks=peaks)


@app.command()
@_answering
def view(
    results: Annotated[Path, typer.Argument(help="A results folder or an .rrd file.", metavar="DIR_OR_RRD")],
) -> None:
    """Open the recorded visualisation in the native viewer."""
    from rollover.store import PICTURE

    path = results / PICTURE if results.is_dir() else results
    if not path.is_file():
        raise InputError(Fault(file=str(results), message=f"no {PICTURE} there; `rollover run` writes one"))
    from viz.viewer import open_viewer

    try:
        status = open_viewer(path)
    except FileNotFoundError as e:
        raise InputError(Fault(message=str(e))) from None
    if status != 0:
        raise InputError(Fault(file=str(path), message=f"the viewer could not show it, it ended with status {status}"))


@app.command("list")
@_answering
def list_(
    what: Annotated[Listed, typer.Argument(help="What to list.")],
    scenario: Annotated[str | None, typer.Argument(help="Whose paths.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what exists, one line each."""
    from rollover import catalogue

    if what is Listed.paths and scenario is None:
        raise InputError(Fault(file="rollover list paths", message="whose paths, got no scenario; name one"))
    if what is not Listed.paths and scenario is not None:
        raise InputError(Fault(file=f"rollover list {what.value}", message=f"one argument too many, got {scenario!r}"))
    rows = catalogue.paths(scenario) if scenario is not None else catalogue.TABLES[what.value]()
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    if not rows:
        from rollover import console

        console.say(f"There are no {what.value} in this version.")
        return
    cells = [[catalogue.text(value) for value in row.values()] for row in rows]
    widths = [min(48, max(map(len, column))) for column in zip(*cells, strict=True)]
    for row in cells:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


@app.command()
@_answering
def check(
    files: Annotated[list[str], typer.Argument(help="Scenarios, vehicles or soils.", metavar="FILE...")],
    as_json: AsJson = False,
) -> None:
    """Validate files and run nothing."""
    from rollover import catalogue

    rows, faults = [], []
    for name in files:
        found: list[Fault] = []
        try:
            what = catalogue.check(name)
        except InputError as e:
            what, found = "", e.faults
        faults += found
        rows.append({"file": name, "is": what, "faults": [{**vars(f), "text": str(f)} for f in found]})
        if not as_json and not found:
            print(f"{name}: {what}, in order")
    if as_json:
        print(json.dumps({"ok": not faults, "files": rows}, indent=2))
    if faults:
        raise InputError(*faults)


@app.command()
@_answering
def schema(
    part: Annotated[Part, typer.Argument(help="Whose schema.")] = Part.scenario,
    as_json: AsJson = True,
) -> None:
    """Print the JSON Schema of a scenario file, for editors; it is JSON with or without --json."""
    from rollover import scenario as scenarios

    print(json.dumps(scenarios.schema(part.value), indent=2))


def main() -> None:
    """Entry point of the command `rollover`."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # so that half-written folders go
    try:
        app()
    except Exception:  # a bug: show all of it, under a status of its own
        traceback.print_exc()
        sys.exit(BUG)
