"""The page of one run: which load was highest and when, how sure that is, and everything it rests on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rollover.assessment.bands import Band
from rollover.assessment.clearance import Approach, approaches
from rollover.assessment.criteria import Criterion
from rollover.assessment.criteria import in_words as standards_in_words
from rollover.assessment.ledger import closure
from rollover.assessment.loads import CONVERGED, PeakLoad, leading, load_channels, magnitude
from rollover.assessment.stand_results import findings
from rollover.dynamics.result import Run
from rollover.spec.estimates import in_words as estimated
from rollover.spec.stand import TiltTable
from rollover.system.numbers import brief, percent
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Pairs, Section, State, Table
from viz.content.differences import differences_section
from viz.content.entities import series
from viz.content.verdict import filtered, in_words, joules, known, raw, rests_on_ground, standing, title_of
from viz.figures import plots
from viz.figures.clearance_view import clearance_figure
from viz.figures.plots import Curve, Level
from viz.figures.stand_view import stand_section
from viz.figures.way_view import way_section
from viz.pages.page import render

ONE_PER_TABLE = 60  # events that are listed


def page(
    run: Run,
    peaks: Sequence[PeakLoad],
    answer: Mapping[str, Any],
    *,
    rows: Sequence[Criterion] = (),
    near: Sequence[Approach] | None = None,
    bands: Sequence[Band] = (),
    command: str = "rollover run scenario.yaml",
) -> str:
    """HTML of a run's report. `answer` is its run.json, `rows` what it was held against.

    `near` are its `approaches`, where they have been worked out; `bands` those of neighbouring starts.
    """
    if near is None:
        near = approaches(run)
    blocks: list[Block] = [
        *_warnings(run, answer),
        *differences_section(run.scenario),
        *way_section(run),
        *stand_section(run, rows),
        *_peaks(run, peaks),
        *_domain(run, peaks),
        *_standards(run, rows),
    ]
    blocks += [*_histories(run, peaks, bands), *_structure(run, rows, near), *_ledger(run), *_course(run, answer)]
    return render(
        title=run.scenario.title,
        subtitle="Rollover load study: one run",
        headline=headline(run, peaks, rows, near),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=answer["scenario_hash"], versions=answer["versions"]),
    )


def headline(
    run: Run, peaks: Sequence[PeakLoad], rows: Sequence[Criterion] = (), near: Sequence[Approach] | None = None
) -> Headline:
    """The highest load of the structure, or of the ground without one; domain, convergence and criteria behind it."""
    if run.status == "failed":
        detail = (
            f"{run.sentence}. What follows holds until then; a peak of it would pass for the peak, so there is none."
        )
        return Headline(sentence=f"The run failed at {run.stop_time:.3f} s", detail=detail, state="fail")
    peak, found = leading(peaks), findings(run.tests)
    if peak is None:
        return Headline(sentence=found.sentence if found else "No load was recorded", state="warn")
    sentence = load = f"{title_of(peak)}: at most {raw(peak)} (raw), {filtered(peak) or 'none'} (CFC {peak.cfc})"
    if isinstance(run.scenario.initiation, TiltTable) and found is not None:
        sentence = found.sentence  # what turns there is the weight: no load answers the question
    parts = [standing(peak.domain_flags) if rests_on_ground(run) else "the ground law took no part"]
    if judged := _judged(run, rows, near):
        sentence, parts = judged, [load, *parts]
    # what the whole run rests on concerns its answer, also where the peak itself came from a tyre
    unsure = bool(peak.domain_flags) or "uncalibrated" in run.domain_flags
    change = peak.half_step_change
    if change is None:
        parts.append("convergence was not examined")
    else:
        word = "converged" if change <= CONVERGED else "not converged"
        parts.append(f"{word}: half the step changes it by {percent(change)}")
        unsure = unsure or change > CONVERGED
    if peak.scatter is not None:
        parts.append(f"{peak.starts} neighbouring starts scatter by {percent(peak.scatter)}")
    missed = [row for row in rows if row.verdict == "not met"]
    if missed:
        parts.append("not met: " + ", ".join(row.requirement.name for row in missed))
    if short := [row for row in rows if row.verdict == "no verdict"]:
        parts.append("not loaded far enough: no verdict on " + ", ".join(row.requirement.name for row in short))
        unsure = True
    text = "; ".join(parts)
    state: State = "fail" if missed else "warn" if unsure else "pass"
    return Headline(sentence=f"{sentence}.", detail=f"{text[0].upper()}{text[1:]}.", state=state)


def _judged(run: Run, rows: Sequence[Criterion], near: Sequence[Approach] | None) -> str:
    """What a test on a stand is made for: whether its requirements are met, with the least clearance; else nothing."""
    asked = [row for row in rows if row.verdict != "compared"]
    if not run.tests or not asked or all(row.verdict == "no verdict" for row in asked):
        return ""
    met = sum(row.verdict == "met" for row in asked)
    count = f"all {len(asked)}" if met == len(asked) else f"{met} of {len(asked)}"
    found = min(approaches(run) if near is None else near, key=lambda a: a.least, default=None)
    if found is None:
        return f"{count.capitalize()} requirements are met"
    which = "the structure" if found.what == "structure" else "the ground"
    return f"{count.capitalize()} requirements are met; least clearance {1e3 * found.least:.0f} mm, to {which}"


def _warnings(run: Run, answer: Mapping[str, Any]) -> list[Block]:
    half = answer.get("half_step")
    blocks: list[Block] = [Note(text=f"{title(run.sentence)}.")] if run.status == "done" and run.sentence else []
    if half and half["status"] != "done":
        blocks.append(Note(text=f"At half the step the run failed: {half['sentence']}", warning=True))
    if estimates := run.scenario.estimates:
        blocks.append(Note(text=f"{estimated(estimates)}.", warning=True))
    return blocks


def _peaks(run: Run, peaks: Sequence[PeakLoad]) -> list[Block]:
    shown = [p for p in peaks if p.raw != 0.0]
    if not shown:
        return []
    within = "inside" if rests_on_ground(run) else "ground not touched"
    ensemble = any(p.scatter is not None for p in shown)
    columns = [
        "load",
        "unit",
        "raw",
        "at, s",
        f"CFC {shown[0].cfc}",
        "at, s",
        "impulse, N\N{NO-BREAK SPACE}s",
        "change at half step",
    ]
    columns += [f"mean of {shown[0].starts}", "scatter"] if ensemble else []
    rows: list[list[str | Cell]] = []
    for p in shown:
        s = series(p.channel)
        change: str | Cell = "" if p.half_step_change is None else percent(p.half_step_change)
        if p.half_step_change is not None and p.half_step_change > CONVERGED:
            change = Cell(f"{change} !", "warn")
        row: list[str | Cell] = [title_of(p), s.unit, number(p.raw, s.factor), f"{p.raw_time:.3f}"]
        row += [number(p.filtered, s.factor), f"{p.filtered_time:.3f}"]
        row += ["" if p.impulse is None else number(p.impulse), change]
        if ensemble:
            row += ["" if p.mean is None else number(p.mean, s.factor)]
            row += ["" if p.scatter is None else percent(p.scatter)]
        row.append(Cell(", ".join(p.domain_flags) or within, "warn" if p.domain_flags else ""))
        rows.append(row)
    caption = (
        "Largest magnitudes. Collisions at restitution 0 show in no force history: their momentum stands under "
        "impulse. Half step: what halving the time step changes in the filtered peak."
    )
    table = Table(columns=[*columns, "calibrated domain"], rows=rows, numeric=range(2, len(columns)), caption=caption)
    return [Section(title="Peak loads", blocks=[table])]


def _standards(run: Run, rows: Sequence[Criterion]) -> list[Block]:
    if not rows:
        return []
    states: Mapping[str, Any] = {"met": "pass", "not met": "fail", "no verdict": "warn", "compared": "muted"}
    halved = any(row.at_half_step is not None for row in rows)
    cells: list[list[str | Cell]] = []
    for row in rows:
        r = row.requirement
        half = [row.half_step_in_words] if halved else []
        sure = f"{r.formula}; {r.source}; {r.confidence}"
        verdict = Cell(row.verdict, states[row.verdict])
        cells.append([f"{r.standard}: {r.name}", *row.in_words, *half, verdict, r.clause, sure])
    columns = ["requirement", "asked", "simulated", "margin or ratio", *(["change at half step"] if halved else [])]
    numeric = range(1, len(columns))
    columns += ["verdict", "clause", "formula, source, confidence"]
    table = Table(columns=columns, rows=cells, numeric=numeric)
    blocks: list[Block] = [table]
    if any(row.verdict == "compared" for row in rows):
        text = (
            "A standard's test energies and forces belong to its test, not to an overturn: beside this run they are a "
            "measure (compared, simulated over asked), not a verdict."
        )
        blocks.append(Note(text=text))
    blocks += [Note(text=sentence, warning="no verdict" in sentence) for sentence in standards_in_words(rows)]
    notes = [Note(text=f"{title(row.requirement.name)}: {row.note}.") for row in rows if row.note]
    return [Section(title="Against standards", blocks=[*blocks, Details(summary="Notes", blocks=notes)])]


def _domain(run: Run, peaks: Sequence[PeakLoad]) -> list[Block]:
    flags = sorted({*run.domain_flags, *(f for p in peaks for f in p.domain_flags)})
    if not flags:
        inside = "Every touch of the ground lay within what the ground law was calibrated on."
        note = Note(text=inside if rests_on_ground(run) else "No element of the ground was touched.")
        return [Section(title="Calibrated domain", blocks=[note])]
    rows: list[list[str | Cell]] = []
    for flag in flags:
        loads = [title_of(p) for p in peaks if flag in p.domain_flags and p.raw != 0.0]
        rows.append([flag, in_words(flag, run.scenario.ground.law.domain), ", ".join(loads) or "no peak load"])
    text = "Loads that were taken there are an extrapolation of the ground law, not a measured range."
    if "uncalibrated" in flags:
        text = "The ground law is not calibrated: no measurement says how far its loads can be trusted."
    table = Table(columns=["flag", "meaning", "concerns"], rows=rows)
    return [Section(title="Calibrated domain", blocks=[Note(text=text, warning=True), table])]


def _histories(run: Run, peaks: Sequence[PeakLoad], bands: Sequence[Band] = ()) -> list[Block]:
    cfc, time = run.scenario.loads.cfc, run.recording.time
    figures: list[Block] = []
    shared: dict[tuple[str, str], list[Curve]] = {}  # by what is drawn and its unit: one axis, one quantity
    for channel, parts, _ in load_channels(run.recording):
        s = series(channel)
        if run.tests and not np.any(magnitude(run.recording, parts, None)):
            continue  # on a test stand the ground need not touch a ROPS, nor a device push
        smooth = Curve(name=f"CFC {cfc}", x=time, y=s.factor * magnitude(run.recording, parts, cfc))
        if channel.startswith(("wheel/", "rops/mount/")):
            if np.any(smooth.y > 0.0):
                group = shared.setdefault((_quantity(channel), s.unit), [])
                role = plots.CYCLE[len(group) % len(plots.CYCLE)]
                group.append(Curve(name=f"{s.name}, CFC {cfc}", x=time, y=smooth.y, role=role))
            continue
        both, scatter = [_raw(run, parts, s.factor), smooth], ""
        for b in (b for b in bands if b.channel == channel):
            mean, deviation = s.factor * b.mean, s.factor * b.deviation
            both.append(Curve(name=f"mean of {b.starts}", x=b.time, y=mean, role="third", spread=deviation))
            scatter = f" Band: standard deviation over {b.starts} neighbouring starts."
        svg = plots.history(both, label=f"{s.name}, {s.unit}", phases=run.phases)
        text = next((f"; peak {raw(p)} raw" for p in peaks if p.channel == channel), "")
        figures.append(
            Figure(svg=svg, caption=f"{title(s.name)} over time, raw and CFC {cfc}{text}. Shading: phases.{scatter}")
        )
    for (name, unit), group in sorted(shared.items()):
        svg = plots.history(group, label=f"{name}, {unit}", phases=run.phases)
        figures.append(Figure(svg=svg, caption=f"{title(name)} over time, CFC {cfc}."))
    if "striker/velocity_z" in run.recording.channels:
        force, depth = series("ground/force_normal"), series("ground/sinkage")
        curve = Curve(
            name="raw",
            x=depth.factor * run.recording["ground/sinkage"],
            y=force.factor * run.recording["ground/force_normal"],
        )
        svg = plots.xy([curve], across=f"sinkage, {depth.unit}", label=f"ground force, {force.unit}")
        figures.insert(0, Figure(svg=svg, caption="Force of the ground over sinkage, raw: loading and unloading."))
    return [Section(title="Histories", blocks=figures)]


def _quantity(channel: str) -> str:
    """What is drawn of all wheels or mounts in one figure: mount forces, wheel spin."""
    part = channel.rpartition("/")[2]
    whose = "wheel" if channel.startswith("wheel/") else "mount"
    return f"{whose} {({'force': 'forces', 'force_normal': 'loads', 'moment': 'moments'}).get(part, part)}"


def _raw(run: Run, parts: tuple[str, ...], factor: float) -> Curve:
    values = factor * magnitude(run.recording, parts, None)
    return Curve(name="raw", x=run.recording.time, y=values, role="second", thin=True)


def _structure(run: Run, rows: Sequence[Criterion], near: Sequence[Approach]) -> list[Block]:
    """Force and energy of the structure over its deflection, with the energies that are asked for; the zone."""
    blocks: list[Block] = []
    if "rops/deflection" in run.recording.channels and np.any(run.recording["rops/force"] > 0.0):
        deflection = 1e3 * np.abs(run.recording["rops/deflection"])
        force = Curve(name="raw", x=deflection, y=1e-3 * run.recording["rops/force"])
        energy = Curve(name="absorbed", x=deflection, y=1e-3 * run.recording["rops/energy"])
        levels = [
            Level(name=f"{r.standard}: {r.name}", value=1e-3 * r.value)
            for r in (row.requirement for row in rows)
            if r.quantity == "energy"
        ]
        across = "deflection of the upper corner, mm"
        most = f"at most {deflection.max():.0f} mm, {deflection[-1]:.0f} mm at the end"
        svg = plots.xy([force], across=across, label="ROPS force, kN")
        blocks.append(Figure(svg=svg, caption=f"Force of the ground on the structure over its deflection ({most})."))
        svg = plots.xy([energy], across=across, label="energy, kJ", levels=levels)
        asked = "; dashed: asked for in the standards' static tests" if levels else ""
        absorbed = joules(float(run.recording["rops/energy"].max()))
        blocks.append(Figure(svg=svg, caption=f"Energy absorbed over deflection, at most {absorbed}{asked}."))
    if run.status == "done" and (zone := clearance_figure(run, near)) is not None:
        blocks.append(zone)
    return [Section(title="Structure", blocks=blocks)] if blocks else []


def _ledger(run: Run) -> list[Block]:
    if not run.ledger:
        return []
    values = {name: 1e-3 * value for name, value in run.ledger.items() if known(value)}
    residual = run.ledger.get("residual", float("nan"))
    closed = closure(run)
    of_all = percent(abs(residual) / run.released) if math.isfinite(closed.end) else ""
    share = f", {of_all} of the {joules(run.released)} released" if of_all else ""
    svg = plots.bars(values, label="energy at the end, kJ", roles={"residual": "limit"})
    caption = f"The energy ledger at the end of the run: {joules(residual)} unaccounted for{share}."
    blocks: list[Block] = [Figure(svg=svg, caption=caption)]
    if closed.is_wide:
        blocks.insert(0, Note(text=f"{title(closed.warning)}.", warning=True))
    elif closed.sentence:
        blocks.append(Note(text=f"{closed.sentence}."))
    return [Section(title="Energy", blocks=blocks)]


def _course(run: Run, answer: Mapping[str, Any]) -> list[Block]:
    """Events and phases, and what was run."""
    events: list[list[str | Cell]] = [
        [f"{e.time:.3f}", e.kind, e.subject, e.detail] for e in run.events[:ONE_PER_TABLE]
    ]
    more = len(run.events) - len(events)
    caption = f"{more} more stand in events.json." if more > 0 else ""
    table = Table(columns=["at, s", "event", "of", "detail"], rows=events, numeric=(0,), caption=caption)
    scenario = run.scenario
    pairs = Pairs(
        rows=[
            ("Vehicle", scenario.vehicle.name),
            ("Begins with", scenario.initiation.kind),
            ("Ground law", scenario.ground.law.__class__.kind),  # type: ignore[attr-defined]
            ("Step", f"{1e3 * scenario.simulation.step:g} ms, integrator {scenario.integrator}"),
            ("Simulated", f"{run.stop_time:g} s in {brief(run.wall_time)} s"),
            ("Phases", ", ".join(f"{name} from {start:.3f} s" for start, name in run.phases)),
            ("Effects switched on", ", ".join(scenario.effects) or "none"),
            ("Files beside this page", ", ".join(answer["files"])),
        ]
    )
    return [Section(title="Course", blocks=[pairs, Details(summary=f"{len(run.events)} events", blocks=[table])])]


def number(value: float, factor: float = 1.0) -> str:
    """A number of a table, four figures."""
    return f"{value * factor:.4g}" if known(value) else ""


def series_unit(unit: str) -> tuple[str, float]:
    """Unit for people and its factor; distances of a structure are read in mm."""
    return {"N": ("kN", 1e-3), "J": ("kJ", 1e-3), "m": ("mm", 1e3)}.get(unit, (unit, 1.0))


def title(name: str) -> str:
    """A name as a sentence begins."""
    return name[:1].upper() + name[1:]
