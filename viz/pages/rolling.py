"""The page of continuous or interrupted rolling: the verdict, sections of each position, inputs, every step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viz.content.blocks import Block, Figure, Footer, Headline, Note, Section, Table
from viz.figures import plots
from viz.figures.plots import Outline, Role, View
from viz.pages.page import render

TITLES = {
    "1": "1: lies on its tyres",
    "2": "2: about the tyres' line",
    "3": "3: the ROPS strikes",
    "4": "4: about wheel and ROPS",
    "5": "5: the bonnet strikes",
}
BASIS = (
    "recalled: the program's formula from memory, derived anew here from planar mechanics; derived: mechanics in the "
    "place of formulae that are not remembered."
)


def page(answer: Mapping[str, Any], *, command: str) -> str:
    """HTML of the report that `rollover rolling` writes."""
    goes_on = answer["verdict"] == "continuous"
    head = Headline(
        sentence=f"{answer['verdict'].capitalize()} rolling: {answer['sentence']}.",
        detail=f"Version {answer['version']} of the calculation, on a slope of {answer['slope_deg']:.1f} degrees.",
        state="warn" if goes_on else "",
    )
    inputs = [[i["symbol"], i["what"], f"{i['value']:.4g}", i["unit"], i["from"]] for i in answer["inputs"]]
    steps = [[s["symbol"], s["what"], f"{s['value']:.4g}", s["unit"], s["basis"]] for s in answer["steps"]]
    warnings: list[Block] = [Note(text=said, warning=True) for said in answer["outside"]]
    if left_out := answer["effects_left_out"]:
        warnings.append(Note(text=f"Effects were left out: {', '.join(left_out)}.", warning=True))
    blocks: list[Block] = [
        *warnings,
        Section(
            title="Positions",
            blocks=[
                Figure(
                    svg=_sections(answer),
                    caption="Seen along the axis of turning; the slope lies level, downhill right.",
                )
            ],
        ),
        Section(
            title="Inputs",
            blocks=[Table(columns=("symbol", "what", "value", "unit", "from"), rows=inputs, numeric=(2,))],
        ),
        Section(
            title="Steps",
            blocks=[Table(columns=("symbol", "what", "value", "unit", "basis"), rows=steps, numeric=(2,))],
        ),
        Section(title="In words", blocks=[Note(text=f"{answer['source']}."), Note(text=BASIS)]),
    ]
    return render(
        title=answer["vehicle"],
        subtitle="Continuous or interrupted rolling",
        headline=head,
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=answer["scenario_hash"], versions=answer["versions"]),
    )


def _sections(answer: Mapping[str, Any]) -> str:
    """A panel for each position: ground, the outline through tyres, bonnet and ROPS, the centre of gravity."""
    views = []
    for number, points in answer["positions"].items():
        section = {name: np.array([p[0], p[2]]) for name, p in points.items()}
        hull = np.array([section[name] for name in ("rear", "front", "bonnet", "rops", "G")])
        low, high = float(hull[:, 0].min()) - 0.3, float(hull[:, 0].max()) + 0.3
        shapes = [
            Outline(name="slope", points=np.array([[low, 0.0], [high, 0.0]]), role="muted", closed=False),
            Outline(name="tyres, bonnet, ROPS, centre", points=hull, role="first", filled=True),
        ]
        marks: dict[str, Role] = {"rops": "second", "bonnet": "third", "G": "ink"}
        for name, role in marks.items():
            turn = np.linspace(0.0, 2.0 * np.pi, 25)
            spot = section[name] + 0.05 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            label = {"rops": "ROPS", "bonnet": "bonnet", "G": "centre of gravity"}[name]
            shapes.append(Outline(name=label, points=spot, role=role, filled=True))
        views.append(View(title=TITLES[number], across="down the slope, m", up="off the slope, m", shapes=shapes))
    return plots.outlines(views)
