"""The page of a frame alone: verdict, load over deflection, the frame as it stands afterwards, hinges, members."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rollover.assessment import criterion
from rollover.assessment.stand_results import findings
from viz.content.blocks import Block, Cell, Figure, Footer, Headline, Note, Section, State, Table
from viz.figures import plots
from viz.figures.plots import Curve, Role
from viz.pages.page import render

ROLES: tuple[Role, ...] = ("first", "second", "third", "muted", "ink")
HINGES = ("load", "at, mm", "force, kN", "where", "m from its start", "moment, kN m")
MEMBERS = (
    "member",
    "section",
    "steel",
    "class",
    "A, cm2",
    "W_pl, cm3",
    "N_pl, kN",
    "M_pl depth, kN m",
    "M_pl width, kN m",
)


CONNECTIONS = (
    "connection",
    "what",
    "holds",
    "N, kN",
    "M depth, kN m",
    "M width, kN m",
    "of the tube, %",
    "use by load",
)


def page(answer: Mapping[str, Any], *, command: str) -> str:
    """HTML of the report that `rollover rops` writes."""
    done = [e for e in answer["tests"] if "curve" in e]
    found = findings(answer["tests"])
    bad = answer["verdict"] == "not met"
    head = Headline(
        sentence=headline(answer),
        detail=f"{answer['elements']} elements, {answer['segments']} to a member; feet: {answer['base']}.",
        state="fail" if bad else "warn" if answer["warnings"] else "pass" if answer["verdict"] == "met" else "",
    )
    blocks: list[Block] = [Section(title="Load over deflection", blocks=[_curves(done), *_results(found)])]
    blocks.append(Section(title="Against the standard", blocks=[_criteria(answer)]))
    rows = [_hinge(e["name"], h) for e in done for h in e["hinges"]]
    rows += [
        [e["name"], f"{1e3 * m['deflection']:.0f}", f"{1e-3 * m['force']:.1f}", f"mount {m['name']} yields", "-", "-"]
        for e in done
        for m in e["mounts"]
    ]
    if rows:
        blocks.append(
            Section(title="Where it yields, in order", blocks=[Table(columns=HINGES, rows=rows, numeric=(1, 2, 4, 5))])
        )
    blocks.append(Section(title="Members", blocks=[_members(answer)]))
    if "connections" in answer:
        blocks.append(Section(title="Connections", blocks=[_connections(answer)]))
    notes: list[Block] = [Note(text=said, warning=True) for said in answer["warnings"]]
    blocks.append(Section(title="In words", blocks=[*notes, Note(text=answer["method"])]))
    return render(
        title=answer["vehicle"],
        subtitle="ROPS alone under a static test",
        headline=head,
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=answer["scenario_hash"], versions=answer["versions"]),
    )


def headline(answer: Mapping[str, Any]) -> str:
    """How many requirements are met, and how near the frame came to the clearance zone."""
    verdicts = [row["verdict"] for row in answer["criteria"]]
    met, of = verdicts.count("met"), len(verdicts)
    said = f"All {of} requirements are met" if met == of else f"{met} of {of} requirements are met"
    away = [e["zone_distance"] for e in answer["tests"] if e.get("zone_distance") is not None]
    if not verdicts:
        said = "The static sequence has no verdict"
    if not away:
        return f"{said}."
    least = 1e3 * min(away)
    near = (
        f"least clearance {least:.0f} mm" if least > 0.0 else f"a member enters the clearance zone by {-least:.0f} mm"
    )
    return f"{said}; {near}."


def _curves(done: list[Mapping[str, Any]]) -> Figure:
    curves = []
    for k, e in enumerate(done):
        x, y = np.array(e["curve"]).T
        curves.append(
            Curve(name=f"{e['name']}, from {e['come_from']}", x=1e3 * x, y=1e-3 * y, role=ROLES[k % len(ROLES)])
        )
    points = [("", 1e3 * h["deflection"], 1e-3 * h["force"]) for e in done for h in e["hinges"]]
    svg = plots.xy(curves, across="deflection, mm", label="force, kN", points=points)
    return Figure(svg=svg, caption="Each load from where the one before left the frame; dots are plastic hinges.")


def _results(found: Any) -> list[Block]:
    if found is None:
        return []
    numeric = range(found.words, len(found.headings) - 1)
    table = Table(columns=found.headings, rows=[list(row) for row in found.rows], numeric=numeric)
    return [table, Note(text=f"{found.sentence}.")]


def _criteria(answer: Mapping[str, Any]) -> Table:
    rows: list[list[str | Cell]] = []
    for row in map(criterion.read, answer["criteria"]):
        asked, reached, _ = row.in_words
        state: State = "pass" if row.verdict == "met" else "fail" if row.verdict == "not met" else "warn"
        name = f"{row.requirement.standard}: {row.requirement.name}"
        rows.append([name, asked, reached, Cell(text=row.verdict, state=state), row.note])
    return Table(columns=("requirement", "asked", "reached", "verdict", "how"), rows=rows, numeric=(1, 2))


def _hinge(load: str, h: Mapping[str, Any]) -> list[str | Cell]:
    return [
        load,
        f"{1e3 * h['deflection']:.0f}",
        f"{1e-3 * h['force']:.1f}",
        h["member"],
        f"{h['place']:.2f} of {h['of']:.2f}",
        f"{1e-3 * h['moment']:.2f}",
    ]


def _connections(answer: Mapping[str, Any]) -> Table:
    rows: list[list[str | Cell]] = []
    for k, c in enumerate(answer["connections"]):
        uses = [(e["name"], e["connections"][k]["use"]) for e in answer["tests"] if "connections" in e]
        worst = max((use for _, use in uses), default=0.0)
        rows.append(
            [
                c["name"],
                c["kind"],
                f"{c['end']} of {c['member']}",
                f"{1e-3 * c['force']:.0f}",
                f"{1e-3 * c['moment_depth']:.2f}",
                f"{1e-3 * c['moment_width']:.2f}",
                Cell(text=f"{100.0 * c['of_member']:.0f}", state="" if c["of_member"] >= 1.0 else "warn"),
                Cell(text=", ".join(f"{n} {use:.2f}" for n, use in uses), state="fail" if worst > 1.0 else "pass"),
            ]
        )
    return Table(columns=CONNECTIONS, rows=rows, numeric=range(3, 7))


def _members(answer: Mapping[str, Any]) -> Table:
    rows: list[list[str | Cell]] = []
    for m in answer["members"]:
        worst = max(m["class"]["h"], m["class"]["b"])
        rows.append(
            [
                m["name"],
                f"{m['section']}{', ' + m['corners'] if m['corners'] else ''}",
                m["steel"],
                Cell(text=str(worst), state="" if worst == 1 else "warn"),
                f"{1e4 * m['area']:.2f}",
                f"{1e6 * m['plastic_h']:.1f}",
                f"{1e-3 * m['plastic_force']:.0f}",
                f"{1e-3 * m['plastic_moment_depth']:.2f}",
                f"{1e-3 * m['plastic_moment_width']:.2f}",
            ]
        )
    return Table(columns=MEMBERS, rows=rows, numeric=range(3, 9))
