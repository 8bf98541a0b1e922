"""The page of two runs: both histories with their difference, which loads moved, what was changed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rollover.comparison.run_pair import Pair
from rollover.system.numbers import percent
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Section, State, Table
from viz.content.entities import series
from viz.content.pair_words import answer, both, detail, named, relative, value
from viz.figures import plots
from viz.figures.plots import Curve
from viz.pages.page import render
from viz.pages.report import title

OPEN = 12  # changed values that are not folded away
SHOWN = ("rops/force", "device/force", "ground/force_normal", "rops/deflection", "ground/sinkage", "chassis/roll")


def page(found: Pair, *, command: str, versions: Mapping[str, str]) -> str:
    """HTML of a baseline and a candidate."""
    blocks = [*_histories(found), *_loads(found), *_verdicts(found), *_changes(found)]
    return render(
        title=str(found.candidate.answer["title"]),
        subtitle="Two runs: baseline and candidate",
        headline=Headline(sentence=answer(found), detail=detail(found), state=_state(found)),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=_hashes(found), hash_of="Scenarios", versions=versions),
    )


def _hashes(found: Pair) -> str:
    return " and ".join(str(r.answer["scenario_hash"]) for r in (found.baseline, found.candidate))


def _state(found: Pair) -> State:
    if any(v.was == "met" and v.now == "not met" for v in found.verdicts):
        return "fail"
    failed = any(r.answer["status"] != "done" for r in (found.baseline, found.candidate))
    return "fail" if failed else "warn" if any(x.verdict.startswith("changed") for x in found.loads) else "pass"


def _loads(found: Pair) -> list[Block]:
    states: Mapping[str, State] = {"changed": "warn", "as it was": "pass", "within the step's error": "muted"}
    rows: list[list[str | Cell]] = [
        [
            named(x.channel),
            f"CFC {x.cfc}",
            value(x, x.was),
            "" if x.was_time is None else f"{x.was_time:.3f}",
            value(x, x.now),
            "" if x.now_time is None else f"{x.now_time:.3f}",
            relative(x),
            "" if x.step is None else percent(x.step),
            Cell(x.verdict, states.get(x.verdict, "")),
        ]
        for x in found.loads
    ]
    if not rows:
        return []
    columns = ["load", "filter", "baseline", "at, s", "candidate", "at, s", "change", "change at half step", ""]
    caption = "Change at half step: what halving the time step changes in the filtered peak, the larger of both runs."
    return [Section(title="Loads", blocks=[Table(columns=columns, rows=rows, numeric=range(2, 8), caption=caption)])]


def _verdicts(found: Pair) -> list[Block]:
    if not found.verdicts:
        return []
    rows: list[list[str | Cell]] = [
        [v.name, v.was, Cell(v.now, "fail" if v.now == "not met" else "")] for v in found.verdicts
    ]
    return [Section(title="Verdicts", blocks=[Table(columns=["requirement", "baseline", "candidate"], rows=rows)])]


def _changes(found: Pair) -> list[Block]:
    if not found.changes:
        return [Section(title="What was changed", blocks=[Note(text="Nothing: both scenarios say the same.")])]
    rows = [[c.path, *both(c)] for c in found.changes]
    columns = ["value", "baseline", "candidate"]
    blocks: list[Block] = [Table(columns=columns, rows=rows[:OPEN])]
    if rows[OPEN:]:
        summary = f"{len(rows) - OPEN} more values"
        blocks.append(Details(summary=summary, blocks=[Table(columns=columns, rows=rows[OPEN:])]))
    return [Section(title="What was changed", blocks=blocks)]


def _histories(found: Pair) -> list[Block]:
    figures: list[Block] = []
    for channel in (c for c in SHOWN if c in found.channels):
        s = series(channel)
        curves = []
        for name, result in (("baseline", found.baseline), ("candidate", found.candidate)):
            recording = result.recording
            curves.append(Curve(name=name, x=recording.time, y=s.factor * recording[channel]))
        if not any(np.any(np.nan_to_num(c.y)) for c in curves):
            continue
        svg = plots.overlay(
            curves[0], curves[1], label=f"{s.name}, {s.unit}", phases=found.baseline.phases, turned=True
        )
        text = f"{title(s.name)}, raw; below, candidate less baseline. Shading: the baseline's phases."
        figures.append(Figure(svg=svg, caption=text))
    return [Section(title="Histories", blocks=figures)] if figures else []
