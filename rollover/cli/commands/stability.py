"""`rollover stability`: on how steep a slope a vehicle stands, against its heading."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rollover.cli.commands.common import (
    BROKE,
    COMPILING,
    FAILED,
    AsJson,
    Force,
    Setting,
    answering,
    app,
    manual,
    settings,
)
from rollover.system.errors import Fault, InputError

if TYPE_CHECKING:
    from rollover.assessment.stability import Loss, StabilityAngle
    from rollover.scenario import Scenario

FORMAT = "rollover-stability/1"
JSON, PAGE = "stability.json", "report.html"
CODE_6 = {
    "limit_deg": 38.0,
    "what": "OECD Codes 6 and 7, narrow tractors: least angle of unstable equilibrium on a tilting plane, pivot free",
    "confidence": "recalled, source not checked",
}


@app.command(
    "stability",
    epilog=manual("stability utility_tractor", writes="stability.json, report.html.", status=BROKE),
)
@answering
def stability_(
    name: Annotated[
        str,
        typer.Argument(help="A scenario or vehicle file, or the name of a shipped one.", metavar="SCENARIO|VEHICLE"),
    ],
    headings: Annotated[int, typer.Option(help="How many, evenly spaced.", min=1, max=360)] = 24,
    set_: Setting = None,
    out: Annotated[Path | None, typer.Option(help="Results folder", show_default="out/stability/NAME")] = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Static stability angle against heading: lift-off, free pivot, stop and overturn, beside closed forms."""
    import numpy as np

    from ground.compiled import is_warm
    from rollover.assessment import results
    from rollover.assessment import stability as statics
    from rollover.cli import console
    from rollover.spec import document

    chosen = _scenario(name)
    if set_:
        chosen = chosen.replaced(settings(set_), origin="--set")
    folder = out or Path("out", "stability", Path(name).stem)
    about: dict[str, Any] = {"scenario_hash": document.content_hash(chosen), **chosen.own_code}
    about["origin"] = results.origin(_file(name), folder, set_ or [])
    results.claim_account(folder, FORMAT, about, (JSON, PAGE), force=force, say=console.say)
    if not is_warm():
        console.say(f"Compiling the contact kernels, once per installation: about {COMPILING} s.")
    try:
        with console.counting("headings") as show:
            found = statics.stability_angles(chosen, 2.0 * math.pi * np.arange(headings) / headings, show)
        parts = statics.losses(chosen)
    except ArithmeticError as e:
        console.say(f"{name}: {e}")
        raise typer.Exit(FAILED) from None
    answer = _answer(chosen, about, found, parts)
    command = " ".join(
        [*map(shlex.quote, ["rollover", "stability", name, "--headings", str(headings)])]
        + [f"--set {shlex.quote(s)}" for s in set_ or []]
    )
    from viz.pages.stability import page

    text = page(answer, command=command)
    with results.whole(folder) as part:
        results.write_json(part / JSON, answer)
        (part / PAGE).write_text(text, encoding="utf-8")
    if as_json:
        print(json.dumps(answer, indent=2))
    else:
        console.stability(answer, str(folder))


def _file(name: str) -> Path:
    """File of the scenario or vehicle of that name. Raises `InputError`."""
    from rollover.spec import document

    try:
        return document.find(name)
    except InputError as no_scenario:
        try:
            return document.find(name, "vehicles")
        except InputError as no_vehicle:
            raise (no_vehicle if "did you mean" in str(no_vehicle) else no_scenario) from None


def _scenario(name: str) -> Scenario:
    """The scenario of that name, or a vehicle on level ground."""
    from ground.array import Elements
    from ground.ye import Ye2006
    from rollover import scenario as scenarios
    from rollover.spec import document
    from rollover.spec.initiation import Standing
    from rollover.spec.vehicle import Vehicle

    path = _file(name)
    keys = document.headings(path)
    kind = keys["kind"].plain if "kind" in keys else None
    if kind not in document.slot_of(scenarios.AnyVehicle).kinds:
        return scenarios.load(path)
    vehicle = document.load(path, scenarios.AnyVehicle)
    if not isinstance(vehicle, Vehicle) or len(vehicle.wheels) < 3:
        message = f"has no wheels to stand on, got {vehicle.name!r}; a vehicle with at least three"
        raise InputError(Fault(file=str(path), path="wheels", message=message))
    return scenarios.Scenario(
        title=vehicle.name,
        vehicle=vehicle,
        ground=scenarios.Ground(elements=Elements(length=1.0, width=1.0), law=Ye2006()),
        initiation=Standing(),
        simulation=scenarios.Simulation(duration=1.0),
    )


def _answer(
    chosen: Scenario, about: dict[str, Any], found: tuple[StabilityAngle, ...], parts: tuple[Loss, ...]
) -> dict[str, Any]:
    from rollover.assessment import results
    from rollover.dynamics.support import closed_form
    from rollover.spec.vehicle import Vehicle

    assert isinstance(chosen.vehicle, Vehicle)
    rows: list[dict[str, Any]] = []
    for a in found:
        closed = {
            where: closed_form(chosen.vehicle, a.heading, outer=outer)
            for where, outer in (("outer_edge", True), ("centre_line", False))
        }
        rows.append(
            {
                "heading_deg": round(math.degrees(a.heading), 6),
                "lift_off_deg": _deg(a.lift_off),
                "first_off": list(a.first_off),
                "phase_one_deg": _deg(a.phase_one),
                "stop_deg": _deg(a.stop),
                "overturn_deg": _deg(a.overturn),
                "balance_deg": _deg(a.balance),
                "closed_form": {
                    where: {"free_pivot_deg": _deg(c.free_pivot), "rigid_deg": _deg(c.rigid)}
                    for where, c in closed.items()
                },
            }
        )
    weakest = min(rows, key=lambda row: row["balance_deg"])
    return {
        "format": FORMAT,
        **about,
        "title": chosen.title,
        "vehicle": chosen.vehicle.name,
        "versions": results.versions(),
        "least": {"heading_deg": weakest["heading_deg"], "balance_deg": weakest["balance_deg"]},
        "code_6": CODE_6,
        "effects_left_out": sorted(chosen.effects),
        "headings": rows,
        "losses": [
            {
                "part": p.part,
                "mass": p.mass,
                "without_deg": _deg(p.without),
                "with_deg": _deg(p.beside),
                "share": p.share,
            }
            for p in parts
        ],
    }


def _deg(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
