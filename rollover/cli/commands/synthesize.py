"""`rollover synthesize`: recordings of a scenario as instruments would have made them."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Annotated

import typer

from rollover.cli.commands.common import BROKE, FAILED, AsJson, Force, Setting, answering, app, manual, noises, settings
from rollover.system.arguments import LEAST_CFC, MOST_CFC, MOST_LATE, MOST_SEED


@app.command(
    epilog=manual(
        "synthesize drop_test --set initiation.speed=3 --hide vehicle.mass=140 --out rec --name d3",
        writes="NAME.csv with its sidecar NAME.yaml, which states what a test engineer would know, not what is hidden.",
        status=BROKE,
    )
)
@answering
def synthesize(
    scenario: Annotated[str, typer.Argument(help="A scenario file, or the name of a shipped one.")],
    out: Annotated[Path, typer.Option(help="Folder of the recording.")] = Path("out/synthesize"),
    name: Annotated[str | None, typer.Option(help="Name of the recording", show_default="the scenario's")] = None,
    set_: Setting = None,
    hidden: Annotated[
        list[str] | None,
        typer.Option("--hide", metavar="PATH=VALUE", help="Like --set, but not stated among the conditions."),
    ] = None,
    channel: Annotated[
        list[str] | None,
        typer.Option("--channel", help="A recorded channel; may be repeated", show_default="the usual ones"),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            "--noise",
            metavar="SHARE or CHANNEL=SIGMA",
            help="White noise, 1 sigma: a share of each channel's range, or SI for one",
            show_default="0.005",
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sampling rate, Hz.", min=1.0, max=1e6)] = 1000.0,
    cfc: Annotated[
        int | None, typer.Option(help="Filter class that the instruments apply.", min=LEAST_CFC, max=MOST_CFC)
    ] = None,
    late: Annotated[
        float, typer.Option(help="How late the instruments' clock is, s.", min=-MOST_LATE, max=MOST_LATE)
    ] = 0.0,
    seed: Annotated[
        int | None, typer.Option(help="Of the noise", min=0, max=MOST_SEED, show_default="another for each name")
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Simulate a scenario and write what instruments with noise would have recorded of it."""
    from rollover import scenario as scenarios
    from rollover.cli import console
    from rollover.comparison.synthesis import check_clock, instrumented
    from rollover.dynamics import simulate
    from rollover.recording.importers import write_recording
    from rollover.spec import document
    from rollover.system.names import inside
    from rollover.system.writing import hold

    check_clock(rate, late)
    path = document.find(scenario)
    stated, unstated = settings(set_ or []), settings(hidden or [], "--hide")
    chosen = scenarios.load(path).replaced(stated, origin="--set").replaced(unstated, origin="--hide")
    for line in chosen.idle:
        console.say(f"{path}: {line}")
    target = inside(out, f"{name or path.stem}.csv", file="--name")
    hold(target)  # before a run that may take minutes
    share, sigmas = noises(noise or [])
    with document.named(path):
        done = simulate.run(chosen)
    if done.status == "failed":
        console.say(f"{path}: the simulation failed: {done.sentence}")
        raise typer.Exit(FAILED)
    made = instrumented(
        done,
        stated,
        channels=channel,
        rate=rate,
        share=share,
        sigmas=sigmas,
        cfc=cfc,
        late=late,
        seed=zlib.crc32(target.stem.encode()) if seed is None else seed,  # two recordings never share their noise
        by="rollover synthesize",
    )
    write_recording(made, target, force=force)
    if as_json:
        print(json.dumps({"recording": str(target), "samples": made.time.size, "noise": dict(made.noise)}, indent=2))
    else:
        console.tell(f"{made.time.size} samples of {len(made.channels)} channels: {target}")
