"""The page of a diagnosis: the verdict, where it shows, what was found and how sure, and what to measure next."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rollover.diagnosis import Diagnosis
from rollover.diagnosis.overlay import Overlay, Track
from rollover.diagnosis.result import Location, Score, chance
from rollover.effects import effects
from rollover.recording.checks import Finding
from rollover.scenario import Scenario
from viz.content.blocks import Block, Cell, Details, Figure, Footer, Headline, Note, Section, Table, as_sentence
from viz.content.diagnosis_words import STATES, answer, label_of, named, predicted_as, ranked
from viz.content.differences import differences_section
from viz.content.entities import series
from viz.figures import plots
from viz.figures.plots import Curve
from viz.pages.page import render
from viz.pages.posterior import open_values

LEAST_SHARE = 0.01  # of a force that some quantity predicts, that is worth a table
PICTURES = 3  # recordings shown in full view; the others are folded away
Row = list[str | Cell]
Each = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]  # what a function makes of things, as `map`


def page(
    found: Diagnosis,
    overlays: Sequence[Overlay],
    *,
    title: str,
    scenario: Scenario | None = None,
    prechecks: Sequence[tuple[str, Finding]] = (),
    command: str,
    scenario_hash: str = "",
    versions: Mapping[str, str] | None = None,
    each: Each = map,
) -> str:
    """HTML of a diagnosis; `overlays` are its recordings over time, `prechecks` (recording, finding); `each` draws."""
    blocks = [
        *(differences_section(scenario) if scenario is not None else []),
        *_found(found),
        *_where(found, overlays, each),
        *_followed(found, overlays, each),
        *_next(found),
        *_considered(found),
        *_detectable(found),
        _sensors(prechecks, len(overlays)),
        _basis(found, overlays),
    ]
    return render(
        title=title,
        subtitle="Diagnosis",
        headline=Headline(sentence=answer(found), detail=found.sentence, state=STATES[found.verdict]),
        blocks=blocks,
        footer=Footer(command=command, scenario_hash=scenario_hash, versions=versions),
    )


def _found(found: Diagnosis) -> list[Block]:
    """Effects with their parameters and intervals."""
    if not found.effects:
        return []
    rows: list[Row] = []
    for e in found.effects:
        for name, i in e.parameters.items():
            bound: str | Cell = Cell("at the end of its range", "warn") if i.at_bound else ""
            rows.append([named(e.id, e.channel), e.kind, name, _g(i.value), _g(i.low), _g(i.high), i.unit, bound])
        if not e.parameters:
            rows.append([named(e.id, e.channel), e.kind, "", "", "", "", "", ""])
    table = Table(
        columns=["effect", "kind", "parameter", "value", "from", "to", "unit", ""],
        rows=rows,
        numeric=(3, 4, 5),
        caption="95 % intervals, SI. The scenario with these values stands in scenario-diagnosed.yaml.",
    )
    notes: list[Block] = [Note(text=f"{e.statement} ({chance(e.p_value)})") for e in found.effects]
    sections: list[Block] = [Section(title="What was found", blocks=[*notes, table])]
    if (d := found.posterior) is not None:
        prior = "Prior: uniform over the range of the search, of the logarithm where that is looked for."
        beside = Note(text="What a small error of the model would do is in the intervals above, not in the samples.")
        warnings = [Note(text=f"{as_sentence(w)}.", warning=True) for w in d.convergence.warnings]
        blocks = [*open_values(d.names, d.units, d.values, d.fitted, d.convergence, prior), *warnings, beside]
        sections.append(Section(title="What stays open", blocks=blocks))
    return sections


def _where(found: Diagnosis, overlays: Sequence[Overlay], each: Each) -> list[Block]:
    """Pictures of the recordings with the largest share, and the table of shares."""
    predicted = _predicted(overlays)
    by_share = ranked(found, [one for one in overlays if one is not predicted])
    front = by_share[: PICTURES if found.where else 1]
    shown = [(one, t) for one, tracks in front for t in tracks[:2]]
    folded = [(one, t) for k, (one, tracks) in enumerate(by_share) for t in tracks[2 * (k < len(front)) :]]
    simulated = "before" if found.effects else "simulated"
    figures = _figures([*shown, *folded], simulated, each)
    blocks: list[Block] = [*figures[: len(shown)]]
    rest: list[Block] = [*figures[len(shown) :]]
    if rest:
        blocks.append(Details(summary="All other channels and recordings", blocks=rest))
    if found.where:
        blocks.append(_locations(found.where, "Share: of all misfit beyond the noise, before anything was changed."))
    if found.where and any(share >= LEAST_SHARE for _, share in found.dependencies):
        table = Table(
            columns=["the residual force as a function of", "predicts, %"],
            rows=[[label_of(name), f"{100.0 * max(share, 0.0):.0f}"] for name, share in found.dependencies],
            numeric=(1,),
            caption="Share of the unexplained force that a curve over this one quantity predicts in conditions left "
            "out of its making.",
        )
        blocks.append(table)
    if found.remaining_significant:
        text = f"Structure remains in the misfit ({chance(found.remaining_p_value)})."
        blocks.append(Note(text=text, warning=True))
        if found.remaining_where and found.effects:
            blocks.append(_locations(found.remaining_where, "Share of the misfit that remains."))
    title = "Where they differ" if found.where else "Measured and simulated"
    return [Section(title=title, blocks=blocks)] if blocks else []


def _predicted(overlays: Sequence[Overlay]) -> Overlay | None:
    """The recording that no fit has seen and that is predicted: of several, the one that the scenario misses most."""
    kept = [one for one in overlays if one.held_out and any(t.rms_after is not None for t in one.tracks)]
    return max(kept, key=lambda one: max(t.rms_before for t in one.tracks), default=None)


def _figures(drawn: Sequence[tuple[Overlay, Track]], simulated: str, each: Each) -> list[Figure]:
    return list(each(_figure, [(replace(one, tracks=(t,)), simulated) for one, t in drawn]))


def _figure(drawn: tuple[Overlay, str]) -> Figure:
    """A recording's one track, with what the scenario as it is goes by."""
    one, simulated = drawn
    (track,) = one.tracks
    s = series(track.channel)

    def curve(name: str, values: plots.Array) -> Curve:
        return Curve(name=name, x=track.time, y=values * s.factor)

    svg = plots.before_after(
        curve("measured", track.measured),
        curve(simulated, track.before),
        None if track.after is None else curve("after", track.after),
        label=f"{s.name}, {s.unit}",
        noise=track.noise * s.factor,
        phases=one.phases,
        unsure=None if track.scatter is None else track.unsure,
    )
    fall = f"residual {_g(track.rms_before, 3)}"
    if track.rms_after is not None:
        fall += f" before, {_g(track.rms_after, 3)} after"
    judged = ", held out" if one.held_out else ""
    over = "over the noise" if track.scatter is None else "over the noise, grey: ensemble scatter"
    caption = f"{one.recording}{judged}: {track.channel}; below, measured less simulated {over}: {fall} (RMS)."
    return Figure(svg=svg, caption=caption)


def _locations(locations: Sequence[Location], caption: str) -> Table:
    rows: list[Row] = [
        [
            p.recording,
            p.channel,
            p.phase,
            f"{p.start:z.4f}",
            f"{p.end:z.4f}",
            f"{100.0 * p.share:.1f}",
            "" if p.depends_on is None else label_of(p.depends_on),
        ]
        for p in locations
    ]
    columns = ["recording", "channel", "phase", "from, s", "to, s", "share, %", "depends on"]
    return Table(columns=columns, rows=rows, numeric=(3, 4, 5), caption=caption)


def _followed(found: Diagnosis, overlays: Sequence[Overlay], each: Each) -> list[Block]:
    """Before and after: training and held-out apart, then each recording, then what no fit had seen as a picture."""
    rows: list[Row] = []
    for title, which, names in (
        ("fitted", "training", found.training),
        ("held out", "held_out", found.held_out),
    ):
        for when, scores in (("before", found.before), ("after", found.after)):
            if which in scores:
                rows.append([title, ", ".join(names), when, *_score(scores[which])])
    if not rows:
        return []
    how = "Held out: the misfit is predicted from a fit to the others; rating and peak are of the fit to all."
    if set(found.training) == set(found.held_out) and len(found.training) < 2:
        how = "With one recording nothing could be held out, and all numbers are of the fit."
    elif len({t.condition or t.recording for t in overlays}) < 2:
        how += " All recordings share one condition: nothing is said of others."
    heads = ["", "recordings", "", "misfit / noise", "ISO/TS 18571", "peak force error, %"]
    blocks: list[Block] = [Table(columns=heads, rows=rows, numeric=(3, 4, 5), caption=how)]
    per = [[name, predicted_as(found, name), _g(a, 3), _g(b, 3)] for name, a, b in found.per_recording]
    columns = ["recording", "predicted as", "before", "after"]
    caption = "Misfit over the noise of each recording; 1 is the noise itself."
    blocks.append(Table(columns=columns, rows=per, numeric=(2, 3), caption=caption))
    predicted = _predicted(overlays)
    if predicted is not None:
        tracks = sorted(predicted.tracks, key=lambda t: -t.rms_before)
        blocks.extend(_figures([(predicted, t) for t in tracks], "before", each))
    return [Section(title="How well the recordings are followed", blocks=blocks)]


def _score(s: Score) -> list[str]:
    return [
        _g(s.nrmse, 3),
        "" if s.iso18571 is None else f"{s.iso18571:.3f}",
        "" if s.peak_force_error is None else f"{100.0 * s.peak_force_error:.3g}",
    ]


def _next(found: Diagnosis) -> list[Block]:
    """What cannot be told apart, and which test would do it."""
    blocks: list[Block] = []
    for e in found.effects:
        own = named(e.id, e.channel)
        if e.indistinguishable_from:
            others = ", ".join(e.indistinguishable_from)
            text = f"{own} predicts the held-out recordings no better than {others}: it may be any of these."
            blocks.append(Note(text=text, warning=True))
            if e.discriminating_test:
                blocks.append(Note(text=f"Measure next: {e.discriminating_test}."))
            if e.next_test is not None:
                blocks.append(Note(text=f"Judging by these recordings, {e.next_test.message()}."))
        else:
            confirm = f" To confirm it: {e.discriminating_test}." if e.discriminating_test else ""
            blocks.append(Note(text=f"{own}: no other candidate predicts the held-out recordings as well.{confirm}"))
    return [Section(title="What cannot be distinguished, and what to measure next", blocks=blocks)] if blocks else []


def _considered(found: Diagnosis) -> list[Block]:
    rows: list[Row] = [
        [
            named(c.id, c.channel),
            _g(c.held_out_gain, 3),
            Cell(c.reason, "pass") if c.reason == "chosen" else c.reason,
        ]
        for c in found.candidates
    ]
    if not rows:
        return []
    fitted = [r for r, c in zip(rows, found.candidates, strict=True) if c.held_out_gain != 0.0 or c.reason == "chosen"]
    rest = [r for r in rows if r not in fitted]
    columns = ["candidate", "held-out gain", "reason"]
    caption = "Gain: logarithm of the held-out misfit before over after, this candidate alone; 0.69 halves it."
    blocks: list[Block] = [Table(columns=columns, rows=fitted, numeric=(1,), caption=caption)] if fitted else []
    if rest:
        table = Table(columns=columns, rows=rest, numeric=(1,))
        blocks.append(Details(summary=f"Without a gain: {len(rest)} more", blocks=[table]))
    return [Section(title="What was considered", blocks=blocks)]


def _detectable(found: Diagnosis) -> list[Block]:
    """Where nothing was found: what these recordings would have shown."""
    if found.effects or not found.smallest_detectable:
        return []
    kinds = effects()
    rows: list[Row] = []
    for key, value in found.smallest_detectable.items():
        id, _, channel = key.partition(":")
        first = next(iter(getattr(kinds.get(id), "search", {})), "")
        rows.append([named(id, channel or None), first, _g(value)])
    table = Table(
        columns=["effect", "parameter", "smallest detectable"],
        rows=rows,
        numeric=(2,),
        caption="Strengths whose effect would be five standard errors of the noise, SI: distance from none, "
        "or from what the scenario has; of a limit, the largest tried that is detectable.",
    )
    return [Section(title="What these recordings would have detected", blocks=[table])]


def _sensors(prechecks: Sequence[tuple[str, Finding]], count: int) -> Section:
    if not prechecks:
        asked = "zero offsets, free fall, rest, double integrals, clipping, gaps, spikes"
        text = f"Nothing was found in {count} recordings: {asked}."
        return Section(title="Sensors, before any model", blocks=[Note(text=text)])
    rows: list[Row] = [
        [name, f.channel, Cell(f.check, "warn"), f"{f.start:z.4f}", f"{f.end:z.4f}", f.sentence]
        for name, f in prechecks
    ]
    columns = ["recording", "channel", "check", "from, s", "to, s", "what it means"]
    note = Note(text="A sensor fault looks like missing physics: resolve these before the ground is blamed.")
    return Section(title="Sensors, before any model", blocks=[note, Table(columns=columns, rows=rows, numeric=(3, 4))])


def _basis(found: Diagnosis, overlays: Sequence[Overlay]) -> Section:
    """Noise, time shifts, size of the work, and what else is to be known."""
    noise: list[Row] = []
    for channel, sigma in found.noise.items():
        s = series(channel)
        noise.append([channel, _g(sigma * s.factor, 3), s.unit])
    shifts: list[Row] = [[t.recording, f"{1e3 * t.shift:+.3f}"] for t in overlays]
    blocks: list[Block] = [
        Note(text=f"Noise alone leaves such a misfit with {chance(found.p_value)}."),
        Table(columns=["channel", "noise, 1 sigma", "unit"], rows=noise, numeric=(1,)),
        Table(
            columns=["recording", "late, ms"],
            rows=shifts,
            numeric=(1,),
            caption="Time shift of each recording, fitted under its prior; the figures show both simulations at it.",
        ),
        Note(text=f"{found.simulations} simulations in {found.seconds:.1f} s."),
    ]
    blocks += [Note(text=_sentence(note), warning=True) for note in found.notes]
    return Section(title="Basis of the diagnosis", blocks=blocks)


def _sentence(text: str) -> str:
    return text if text.endswith(".") else f"{text}."


def _g(value: float, digits: int = 4) -> str:
    return f"{value:.{digits}g}"
