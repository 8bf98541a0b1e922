"""The page of a plan: what a test would show, which effects it would tell apart, what to measure beside it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rollover.diagnosis.planning.plan import Detectable, Plan
from rollover.effects import spoken
from rollover.spec.channels import describe
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Section, Table
from viz.figures.heat_map import heat_map
from viz.pages.page import render

MEANT = (
    "A row is the effect that is there, a column the one that is fitted in its place, with clocks, gains and uncertain "
    "values free within what is known of them; 100 is never mistaken, 50 a toss-up. An effect is taken {times:g} times "
    "as strong as just detectable."
)
RESTS = (
    "Computed from simulated recordings of each effect and rivals refitted to them; without noise drawn, from the "
    "noncentrality of what stays. A model that misses in another way than its tolerance says keeps no promise."
)


def page(
    found: Plan, *, title: str, command: str, scenario_hash: str = "", versions: Mapping[str, str] | None = None
) -> str:
    """HTML of a plan."""
    blocks: list[Block] = [Section(title="What is detectable", blocks=[_strengths(found)])]
    acting = [e.effect for e in found.effects if e.judged is not None]
    chances = [found.of(a, b) for a in acting for b in acting]
    if any(p is not None for p in chances):
        places = {name: str(k) for k, name in enumerate((e.effect for e in found.effects), 1)}
        numbers = np.array([places[name] for name in acting], dtype=np.object_)
        rows, columns = np.repeat(numbers, len(acting)), np.tile(numbers, len(acting))
        values = np.array([np.nan if p is None else 100.0 * p for p in chances])
        svg = heat_map(
            columns, rows, values, across="rival", up="true effect", label="chosen rightly, %", span=(50.0, 100.0)
        )
        picture = Figure(svg=svg, caption="Numbers are those of the table above; a cross: not held against each other.")
        blocks.append(
            Section(
                title="Which effects are told apart",
                blocks=[picture, Note(text=MEANT.format(times=found.times)), *_confused(found)],
            )
        )
    if found.next_tests:
        blocks.append(Section(title="What to measure next", blocks=_next(found)))
    noise: list[list[str | Cell]] = [
        [channel, spoken(sigma), describe(channel).unit] for channel, sigma in found.noise.items()
    ]
    count = len(found.conditions)
    basis = (
        f"{count} recording{'' if count == 1 else 's'} at {found.rate:g} Hz; beside the noise a model may miss "
        f"{found.tolerance:.1%} of each channel's range, and each gain is off by {found.gain:.1%} (1 sigma). Each of "
        f"all effects is tested at a size of {found.size:.2%}, so that noise alone shows any of them with "
        f"{found.false_alarm:.0%}; detectable is what is then seen with {found.power:.0%}, a noncentrality of "
        f"{found.noncentrality:.1f}."
    )
    table = Table(columns=["channel", "noise, 1 sigma", "unit"], rows=noise, numeric=(1,))
    blocks.append(Section(title="Basis of the plan", blocks=[Note(text=basis), Note(text=RESTS), table]))
    return render(
        title=title,
        subtitle="Plan of a test",
        headline=headline(found),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=scenario_hash, versions=versions),
    )


def headline(found: Plan) -> Headline:
    """How many effects would show, how many pairs would be told apart, and which test would tell the others."""
    seen = [e for e in found.effects if e.least is not None]
    confused = {frozenset((p.effect, p.rival)) for p in found.confused()}
    pairs = {frozenset((p.effect, p.rival)) for p in found.pairs}
    apart = len(pairs) - len(confused)
    plural = "" if len(pairs) == 1 else "s"
    told = (
        f", {apart} of {len(pairs)} pair{plural} told apart with {found.distinguishable:.0%} or more" if pairs else ""
    )
    best = [a.best.message() for a in found.next_tests if a.best is not None]
    return Headline(
        sentence=f"{len(seen)} of {len(found.effects)} effects would show in these drops{told}.",
        detail=f"Next: {best[0]}." if best else "",
        state="warn" if confused or len(seen) < len(found.effects) else "pass",
    )


def _strengths(found: Plan) -> Table:
    rows = [_strength(k, e) for k, e in enumerate(found.effects, 1)]
    columns = ["", "effect", "parameter", "detectable from", "unit", "usual strength", "seen then with"]
    return Table(columns=columns, rows=rows, numeric=(0, 3, 5, 6))


def _strength(k: int, e: Detectable) -> list[str | Cell]:
    least = Cell(e.least_in_words, "warn") if e.least is None else e.least_in_words
    usual, power = "" if e.usual is None else spoken(e.usual), "" if e.power is None else f"{e.power:.0%}"
    return [str(k), e.effect, e.parameter, least, e.unit, usual, power]


def _confused(found: Plan) -> list[Block]:
    rows: list[list[str | Cell]] = [
        [p.effect, p.rival, f"{p.noncentrality:.3g}", f"{p.probability:.0%}"] for p in found.confused()
    ]
    if not rows:
        return []
    table = Table(columns=["true", "rival", "noncentrality", "chosen rightly"], rows=rows, numeric=(2, 3))
    return [Details(summary=f"{len(rows)} choices that are not sure", blocks=[table])]


def _next(found: Plan) -> list[Block]:
    blocks: list[Block] = []
    for a in found.next_tests:
        blocks.append(Note(text=a.message(), warning=not a.is_enough))
        if a.known:
            blocks.append(Note(text=f"In general: {a.known}."))
        rows: list[list[str | Cell]] = [
            [f"{t.path} {t.value:g}", ", ".join(t.channels), f"{t.rate:g}", f"{t.probability:.0%}"] for t in a.tried
        ]
        if rows:
            columns = ["test", "channels", "rate, Hz", "told apart"]
            table = Table(columns=columns, rows=rows, numeric=(2, 3))
            blocks.append(Details(summary=f"{len(rows)} tests that were looked at", blocks=[table]))
    return blocks
