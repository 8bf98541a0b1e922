"""The page of a comparison: how well each recording is followed, channel by channel and phase by phase."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rollover.comparison.misfit import ChannelMisfit, Misfit
from rollover.comparison.rating import Iso18571, NotRateable, Rating, SpragueGeers, verdict, worst_verdict
from rollover.scenario import Scenario
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Section, State, Table, as_sentence
from viz.content.differences import differences_section
from viz.content.entities import series
from viz.figures import plots
from viz.figures.plots import Curve
from viz.pages.page import render
from viz.recordings.comparison import sentences

STATES: Mapping[str, State] = {"good": "pass", "fair": "warn", "poor": "fail"}
COLUMNS = ["channel", "verdict", "CFC", "ISO/TS 18571", "RMS / noise", "peak, %"]
GROUPS: Mapping[str, Sequence[str]] = {  # what stands folded, a narrow table each: nothing is cut off on paper
    "ISO/TS 18571: Z corridor, E_P phase, E_M magnitude, E_S slope": ["rating", "grade", "Z", "E_P", "E_M", "E_S"],
    "Sprague and Geers, residual, peak": ["M, %", "P, %", "RMS / range, %", "RMS / noise", "peak, %", "peak later, ms"],
}


def page(
    found: Sequence[Misfit],
    *,
    title: str,
    scenario: Scenario | None = None,
    command: str,
    scenario_hash: str = "",
    versions: Mapping[str, str] | None = None,
) -> str:
    """HTML of one comparison for each recording."""
    blocks: list[Block] = [
        *(differences_section(scenario) if scenario is not None else []),
        *(Section(title=each.recording, blocks=_recording(each)) for each in found),
        Note(
            text="Each recording is compared at its own stamps with a run under its own conditions, both through the "
            "same filter class. Nothing was shifted in time but an uncertain clock, where that is stated. "
            "ISO/TS 18571 and peaks are over the event, from first contact to rest."
        ),
    ]
    return render(
        title=title,
        subtitle="Measured against simulated",
        headline=headline(found),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=scenario_hash, versions=versions),
    )


def headline(found: Sequence[Misfit]) -> Headline:
    """The span of the ratings and of the residuals."""
    ratings = [c.rating for m in found for c in m.channels]
    isos = sorted(
        (r.iso18571 for r in ratings if isinstance(r, Rating) and isinstance(r.iso18571, Iso18571)),
        key=lambda iso: iso.overall,
    )
    noisy = sorted(r.over_noise for r in ratings if isinstance(r, Rating) and r.over_noise is not None)
    recordings = f"{len(found)} recording{'s'[: len(found) != 1]}, {len(ratings)} channel{'s'[: len(ratings) != 1]}"
    detail = f"Residuals are {_span(*(f'{v:.3g}' for v in (noisy[0], noisy[-1])))} times the noise." if noisy else ""
    state: State = "warn"
    if worst := [verdict(r) for r in ratings if isinstance(r, Rating)]:
        judged = worst_verdict(worst)
        state = STATES[judged.grade]
        detail = f"{detail} Agreement at worst {judged.in_words}.".strip()
    if not isos:
        return Headline(
            sentence=f"{recordings}: none could be rated.",
            detail=detail,
            state="fail" if state == "fail" else "warn",
        )
    span = _span(*(f"{iso.overall:.2f} ({iso.grade})" for iso in (isos[0], isos[-1])))
    return Headline(sentence=f"{recordings}: ISO/TS 18571 {span}.", detail=detail, state=state)


def _span(low: str, high: str) -> str:
    """From the least to the largest, or the one that both are."""
    return low if low == high else f"{low} to {high}"


def _recording(found: Misfit) -> list[Block]:
    table = Table(
        columns=COLUMNS,
        rows=[_row(c.channel, c.cfc, c.rating) for c in found.channels],
        numeric=(3, 4, 5),
        caption="Verdict: the worst of the rating, the peak (fair beyond 10 %, poor beyond 21 %, as the standard "
        "scores a magnitude error) and the residual (fair beyond twice the noise and 5 % of the signal's RMS together, "
        "poor with 21 %).",
    )
    blocks: list[Block] = [Note(text=found.title), *(_figure(c, found) for c in found.channels), table]
    why = [
        Note(text=f"{c.channel}: not rated by ISO/TS 18571: {reason}")
        for c in found.channels
        if (reason := _reason(c.rating))
    ]
    blocks += why + [Note(text=f"{as_sentence(line)}.") for line in sentences(found)]
    rows: list[list[str | Cell]] = [
        [
            c.channel,
            cell.phase,
            f"{cell.start:z.4f}",
            f"{cell.end:z.4f}",
            str(cell.samples),
            f"{100.0 * cell.share:.1f}",
            _number(cell.rating.over_noise) if isinstance(cell.rating, Rating) else "",
            _number(cell.rating.iso18571.overall)
            if isinstance(cell.rating, Rating) and isinstance(cell.rating.iso18571, Iso18571)
            else "",
        ]
        for c in found.channels
        for cell in c.cells
    ]
    columns = ["channel", "phase", "from, s", "to, s", "samples", "share, %", "RMS / noise", "ISO/TS 18571"]
    phases = Table(
        columns=columns,
        rows=rows,
        numeric=range(2, len(columns)),
        caption="Share: of the recording's squared residual over noise.",
    )
    groups = [Details(summary=title, blocks=[_group(heads, found)]) for title, heads in GROUPS.items()]
    return [*blocks, *groups, Details(summary="By phase", blocks=[phases])]


def _group(heads: Sequence[str], found: Misfit) -> Table:
    """Some of the numbers of all channels that were rated."""
    rows = [[c.channel, *(_numbers(c.rating)[name] for name in heads)] for c in found.channels]
    return Table(columns=["channel", *heads], rows=rows, numeric=range(1, len(heads) + 1))


def _row(channel: str, cfc: int | None, rating: Rating | NotRateable) -> list[str | Cell]:
    used = "none" if cfc is None else str(cfc)
    if isinstance(rating, NotRateable):
        return [channel, Cell(rating.reason, "muted"), used, "", "", ""]
    judged, numbers = verdict(rating), _numbers(rating)
    iso = Cell("not rated", "muted") if not numbers["rating"] else f"{numbers['rating']} {numbers['grade']}"
    return [
        channel,
        Cell(judged.in_words, STATES[judged.grade]),
        used,
        iso,
        numbers["RMS / noise"],
        numbers["peak, %"],
    ]


def _numbers(rating: Rating | NotRateable) -> dict[str, str]:
    """Every number of a rating by its heading; empty where there is none."""
    found = dict.fromkeys([name for heads in GROUPS.values() for name in heads], "")
    if isinstance(rating, NotRateable):
        return found
    iso, sg, peak = rating.iso18571, rating.sprague_geers, rating.peak
    if isinstance(iso, Iso18571):
        parts = {"rating": iso.overall, "Z": iso.corridor, "E_P": iso.phase, "E_M": iso.magnitude, "E_S": iso.slope}
        found |= {name: f"{value:.3f}" for name, value in parts.items()} | {"grade": iso.grade}
    if isinstance(sg, SpragueGeers):
        found |= {"M, %": f"{100.0 * sg.magnitude:.3g}", "P, %": f"{100.0 * sg.phase:.3g}"}
    found |= {"RMS / range, %": _number(rating.nrmse, 100.0), "RMS / noise": _number(rating.over_noise)}
    relative = "" if peak.relative_error is None else f"{100.0 * peak.relative_error:+.3g}"
    return found | {"peak, %": relative, "peak later, ms": f"{1e3 * peak.time_error:+.3g}"}


def _reason(rating: Rating | NotRateable) -> str:
    if isinstance(rating, NotRateable):
        return rating.reason
    return rating.iso18571.reason if isinstance(rating.iso18571, NotRateable) else ""


def _figure(c: ChannelMisfit, found: Misfit) -> Figure:
    s = series(c.channel)
    measured = Curve(name="measured", x=c.time, y=c.measured * s.factor)
    simulated = Curve(name="simulated", x=c.time, y=c.simulated * s.factor)
    label = f"{s.name}, {s.unit}" if s.unit else c.channel
    how = "unfiltered" if c.cfc is None else f"both CFC {c.cfc}"
    svg = plots.overlay(measured, simulated, label=label, phases=found.phases)
    return Figure(svg=svg, caption=f"{c.channel}, {how}, {c.rate:.5g} Hz; below, measured less simulated.")


def _number(value: float | None, factor: float = 1.0) -> str:
    return "" if value is None else f"{value * factor:.3g}"
