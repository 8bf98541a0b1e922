"""What a test stand found, on a report page: its table, and the curves that the tests are judged by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rollover.assessment.criteria import Criterion
from rollover.assessment.stand_results import findings
from rollover.dynamics.result import Run
from viz.content.blocks import Block, Figure, Note, Section, Table
from viz.figures import plots
from viz.figures.plots import Curve, Level


def stand_section(run: Run, rows: Sequence[Criterion] = ()) -> list[Block]:
    """The section of the test stand; nothing for a run without one."""
    found = findings(run.tests)
    if found is None:
        return []
    numeric = range(found.words, len(found.headings))
    table = Table(columns=found.headings, rows=found.rows, numeric=numeric)
    figures = {"static-load": _loads, "pendulum-blow": _blow, "harmonic": _settling, "blow": _driving}
    draw = figures.get(run.tests[0]["kind"])
    blocks: list[Block] = [Note(text=f"{found.sentence}."), table, *([] if draw is None else draw(run, rows))]
    return [Section(title="Test stand", blocks=blocks)]


def _loads(run: Run, rows: Sequence[Criterion]) -> list[Block]:
    """Force and energy over the deflection of each load that is pushed to an energy, up to where it is let go."""
    pushed = [e for e in run.tests if e["required_energy"] is not None]
    forces: list[Curve] = []
    energies: list[Curve] = []
    for k, entry in enumerate(pushed):
        role = plots.CYCLE[k % len(plots.CYCLE)]
        during = _during(run, entry)
        x = 1e3 * run.recording["device/deflection"][during]
        for curves, channel in ((forces, "device/force"), (energies, "device/energy")):
            curves.append(Curve(name=entry["name"], x=x, y=1e-3 * run.recording[channel][during], role=role))
    if not pushed:
        return []
    levels = [
        Level(name=f"{r.standard}: {r.name}", value=1e-3 * r.value)
        for r in (row.requirement for row in rows if row.verdict != "compared")
        if r.quantity == "energy"
    ]
    across = "deflection of the loaded point, mm"
    text = "Force of the beam over the deflection of the loaded point since the load began, load by load."
    asked = "; dashed: what the standard asks of this vehicle's mass" if levels else ""
    return [
        Figure(svg=plots.xy(forces, across=across, label="force, kN"), caption=text),
        Figure(
            svg=plots.xy(energies, across=across, label="energy, kJ", levels=levels),
            caption=f"Energy put in over the deflection{asked}.",
        ),
    ]


def _during(run: Run, entry: Mapping[str, Any]) -> Any:
    end = entry.get("reached_at", np.inf)
    return (run.recording.time >= entry["begun_at"]) & (run.recording.time <= end)


def _blow(run: Run, rows: Sequence[Criterion]) -> list[Block]:
    entry, time = run.tests[0], run.recording.time
    if "struck_at" not in entry:
        return []
    from_then = time >= entry["struck_at"]
    x = 1e3 * run.recording["device/deflection"][from_then]
    force = Curve(name="raw", x=x, y=1e-3 * run.recording["device/force"][from_then])
    way = Curve(name="ROPS against the chassis", x=time, y=1e3 * run.recording["rops/deflection"])
    text = "Force of the block over the displacement of the struck point, the tractor's own motion included."
    return [
        Figure(svg=plots.xy([force], across="displacement of the struck point, mm", label="force, kN"), caption=text),
        Figure(
            svg=plots.history([way], label="deflection, mm", phases=run.phases),
            caption="Deflection of the ROPS's upper corner against the chassis: at most, and what is left.",
        ),
    ]


def _settling(run: Run, rows: Sequence[Criterion]) -> list[Block]:
    settled = run.tests[0]["settlement"]
    way = Curve(name="settlement", x=run.recording.time, y=1e3 * run.recording["device/deflection"])
    blocks: list[Block] = [
        Figure(svg=plots.history([way], label="settlement, mm", phases=run.phases), caption="Way down over time.")
    ]
    if len(settled) > 1:
        turns = np.array([float(s["turns"]) for s in settled])
        depth = Curve(name="settlement", x=turns, y=1e3 * np.array([s["settlement"] for s in settled]))
        text = "Mean settlement of a turn over the count of turns."
        blocks.append(Figure(svg=plots.xy([depth], across="turns", label="settlement, mm"), caption=text))
    return blocks


def _driving(run: Run, rows: Sequence[Criterion]) -> list[Block]:
    sets = [(k + 1.0, 1e3 * e["set"]) for k, e in enumerate(run.tests) if "set" in e]
    way = Curve(name="pile", x=run.recording.time, y=1e3 * run.recording["device/deflection"])
    blocks: list[Block] = [
        Figure(
            svg=plots.history([way], label="penetration, mm", phases=run.phases),
            caption="Penetration of the pile over time.",
        )
    ]
    if len(sets) > 1:
        x, y = np.array(sets).T
        curve = Curve(name="set", x=x, y=y)
        text = "Set of each blow: the permanent penetration gained until the next blow."
        blocks.append(Figure(svg=plots.xy([curve], across="blow", label="set, mm"), caption=text))
    return blocks
