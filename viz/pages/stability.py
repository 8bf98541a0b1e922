"""The page of static stability: the angle against heading, what happens on the way, closed forms, what parts cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from viz.content.blocks import Block, Cell, Figure, Footer, Headline, Note, Section, Table
from viz.figures import plots
from viz.figures.plots import Curve, Role
from viz.pages.page import render

COLUMNS = ("heading, deg", "lift-off, deg", "first off", "free pivot ends, deg", "on the stop, deg", "overturns, deg")
CLOSED = ("pivot, outer edge", "pivot, centre line", "stop, outer edge", "stop, centre line", "against stiff tyres")
WHAT = (
    "Heading in the slope: 0 uphill, 90 with the left side downhill, 180 downhill. Angles are slopes, in degrees. "
    "Lift-off: the first wheel carries nothing. Free pivot ends: the chassis turns about the line from its lower rear "
    "wheel to the pivot, until the axle meets its stop; if it stands there it goes on to the overturn, beyond which "
    "nothing is stable. Wheels grip, as on a tilt table with stops."
)
STIFF = (
    "Closed forms take tyres as rigid, bearing at their outer edges or in their middle; with a front axle the pivot "
    "carries the chassis without the axle. The last column is the computed end of the first balance against the closed "
    "form at the outer edges: what tyre deflection and round treads take. Published differences of 2.4-4.0 % "
    "(0.9-2.6 % with tyre deflection) are between measured angles and the formula of ISO 16231-2, another comparison."
)
LOSSES = (
    "End of the first balance across the slope, on the weaker side. The ROPS is taken off the vehicle's mass; a driver "
    "stands for a mass 0.25 m above the seat reference point. Published for small vehicles of 300-600 kg: a driver "
    "takes up to 20 %, a ROPS 5.4-8 %."
)


def page(answer: Mapping[str, Any], *, command: str) -> str:
    """HTML of the report that `rollover stability` writes."""
    rows, limit = answer["headings"], answer["code_6"]
    least = answer["least"]
    below = least["balance_deg"] < limit["limit_deg"]
    word = "below" if below else "not below"
    of_this = "" if limit["applies"] else ", not of this one"
    head = Headline(
        sentence=f"It stands on slopes of up to {least['balance_deg']:.1f} degrees, whichever way it faces; "
        f"the weakest heading is {least['heading_deg']:g} degrees.",
        detail=f"This is {word} the {limit['limit_deg']:g} degrees asked of narrow tractors{of_this} "
        f"({limit['confidence']}).",
        state="warn" if below and limit["applies"] else "",
    )
    blocks: list[Block] = [
        Section(
            title="Stability against heading",
            blocks=[Figure(svg=_polar(rows, limit["limit_deg"]), caption="Slope in degrees; ahead is uphill.")],
        ),
        Section(title="What happens", blocks=[Table(columns=COLUMNS, rows=_events(rows), numeric=(0, 1, 3, 4, 5))]),
        Section(
            title="Closed forms beside, degrees",
            blocks=[
                Table(columns=("heading, deg", *CLOSED), rows=_closed(rows), numeric=range(6)),
                Note(text=STIFF),
            ],
        ),
    ]
    if answer["losses"]:
        table = Table(
            columns=("part", "mass, kg", "without, deg", "with, deg", "loss"),
            rows=[
                [
                    each["part"],
                    f"{each['mass']:.1f}",
                    _deg(each["without_deg"]),
                    _deg(each["with_deg"]),
                    f"{100.0 * each['share']:.1f} %",
                ]
                for each in answer["losses"]
            ],
            numeric=range(1, 5),
        )
        blocks.append(Section(title="What parts cost", blocks=[table, Note(text=LOSSES)]))
    if answer["effects_left_out"]:
        blocks.insert(0, Note(text=f"Effects were left out: {', '.join(answer['effects_left_out'])}.", warning=True))
    blocks.append(Section(title="In words", blocks=[Note(text=WHAT)]))
    return render(
        title=answer["vehicle"],
        subtitle="Static stability",
        headline=head,
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=answer["scenario_hash"], versions=answer["versions"]),
    )


def _polar(rows: list[dict[str, Any]], limit: float) -> str:
    """Curves closed to a ring."""
    ring = [*rows, rows[0]]
    heading = np.radians([row["heading_deg"] for row in ring])

    def curve(name: str, values: list[float | None], role: Role) -> Curve:
        return Curve(name=name, x=heading, y=np.array([np.nan if v is None else v for v in values]), role=role)

    curves = [curve("overturns", [r["overturn_deg"] for r in ring], "first")]
    if any(r["phase_one_deg"] is not None for r in rows):
        curves.append(curve("first balance ends", [r["balance_deg"] for r in ring], "second"))
    for where, role in (("outer_edge", "third"), ("centre_line", "muted")):
        stiff = [_stiff(r, where) for r in ring]
        curves.append(curve(f"stiff tyres, {where.replace('_', ' ')}", list(stiff), role))  # type: ignore[arg-type]
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    curves.append(Curve(name=f"{limit:g} deg, narrow tractors", x=turn, y=np.full(181, limit), role="limit"))
    return plots.polar(curves, label="slope, deg")


def _stiff(row: Mapping[str, Any], where: str) -> float:
    closed = row["closed_form"][where]
    free = closed["free_pivot_deg"]
    return float(closed["rigid_deg"] if free is None else free)


def _events(rows: list[dict[str, Any]]) -> list[list[str | Cell]]:
    return [
        [
            f"{row['heading_deg']:g}",
            _deg(row["lift_off_deg"]),
            ", ".join(row["first_off"]).replace("_", " "),
            _deg(row["phase_one_deg"]),
            _deg(row["stop_deg"]),
            _deg(row["overturn_deg"]),
        ]
        for row in rows
    ]


def _closed(rows: list[dict[str, Any]]) -> list[list[str | Cell]]:
    found: list[list[str | Cell]] = []
    for row in rows:
        outer, middle = row["closed_form"]["outer_edge"], row["closed_form"]["centre_line"]
        change = 100.0 * (row["balance_deg"] / _stiff(row, "outer_edge") - 1.0)
        angles = (outer["free_pivot_deg"], middle["free_pivot_deg"], outer["rigid_deg"], middle["rigid_deg"])
        found.append([f"{row['heading_deg']:g}", *map(_deg, angles), f"{change:+.1f} %"])
    return found


def _deg(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
