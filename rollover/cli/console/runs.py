"""What a run and a regression answer, on standard output: tables and sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from rollover.cli.console import terminal
from rollover.system.errors import excerpt
from rollover.system.numbers import brief, percent

if TYPE_CHECKING:
    from rollover.assessment.criteria import Criterion
    from rollover.assessment.loads import PeakLoad
    from rollover.dynamics.result import Run
    from rollover.studies.baseline import Answer


def report(
    run: Run,
    peaks: Sequence[PeakLoad],
    rows: Sequence[Criterion],
    answer: Mapping[str, Any],
    folder: str,
    *,
    headline: str,
    compiled: bool = False,
) -> None:
    """The answer of a run, its `headline` first; what took part of its time to compile tells no speed."""
    from rollover.assessment.criteria import in_words
    from rollover.assessment.ledger import closure
    from rollover.assessment.shipped import origin
    from rollover.spec.estimates import in_words as estimated

    out = terminal.out()
    out.print(excerpt(run.scenario.title), style="bold")
    if run.status == "done":
        _answer(out, headline, rows)
    if (made_from := origin(run.scenario)) and made_from.differences:
        out.print(f"{made_from.in_words}.", style="yellow")
    if run.status == "done":
        speed = (run.stop_time - float(run.recording.time[0])) / run.wall_time if run.wall_time > 0.0 else 0.0
        pace = "most of it compiling, once" if compiled else f"{brief(speed)} x real time"
        out.print(f"{run.stop_time:g} s simulated in {brief(run.wall_time)} s ({pace})")
    else:
        out.print(f"FAILED: {run.sentence}", style="bold red")
    if run.status == "done" and run.sentence:
        out.print(f"{run.sentence[0].upper()}{run.sentence[1:]}.", style="yellow")
    if run.tests:
        _stand(out, run)
    if peaks:
        out.print(_table(peaks))
    if rows:
        out.print()
        out.print(_criteria(rows))
        for sentence in in_words(rows):
            out.print(sentence)
    _convergence(out, peaks)
    closed = closure(run)
    if closed.is_wide:
        out.print(f"{closed.warning[0].upper()}{closed.warning[1:]}.", style="bold yellow")
    elif closed.sentence:
        out.print(f"{closed.sentence}.")
    if run.domain_flags:
        marked = " Loads marked * were taken there: an extrapolation, not a measured range." if peaks else ""
        flags = ", ".join(run.domain_flags)
        heading = "Outside the ground law's calibrated domain"
        if "uncalibrated" in run.domain_flags:
            heading = "The ground law is not calibrated: no measurement stands behind its loads. Flags"
        out.print(f"{heading}: {flags}.{marked}", style="yellow")
    if said := estimated(run.scenario.estimates):
        out.print(f"{said}.", style="yellow")
    half = answer["half_step"]
    if half is not None and half["status"] != "done":
        out.print(f"At half the step the run failed: {half['sentence']}", style="yellow")
    out.print(f"Results: {folder}")


def _answer(out: Console, headline: str, rows: Sequence[Criterion]) -> None:
    out.print(headline, style="bold")
    if missed := [row.requirement.name for row in rows if row.verdict == "not met"]:
        out.print(f"Not met: {', '.join(missed)}.", style="bold red")


def _convergence(out: Console, peaks: Sequence[PeakLoad]) -> None:
    from rollover.assessment.loads import converged, unconverged

    if unsure := unconverged(peaks):
        out.print(f"{unsure[0].upper()}{unsure[1:]}.", style="bold yellow")
    elif settled := converged(peaks):
        out.print(f"{settled[0].upper()}{settled[1:]}.")


def _stand(out: Console, run: Run) -> None:
    from rollover.assessment.stand_results import findings

    found = findings(run.tests)
    assert found is not None
    out.print(terminal.table(found.headings, found.rows, words=found.words))
    out.print(f"{found.sentence}.", style="bold")
    out.print()


def _criteria(rows: Sequence[Criterion]) -> Table:
    table = Table(box=None, pad_edge=False)
    styles = {"met": "green", "not met": "bold red", "no verdict": "yellow", "compared": ""}
    for heading in ("standard", "requirement", "asked", "simulated", "margin", "change at half step", "verdict"):
        table.add_column(
            heading, justify="right" if heading in ("simulated", "margin", "change at half step") else "left"
        )
    for row in rows:
        r, (asked, simulated, margin) = row.requirement, row.in_words
        words = (r.standard, r.name, asked, simulated, margin, row.half_step_in_words or "-", row.verdict)
        table.add_row(*words, style=styles[row.verdict])
    return table


def _table(peaks: Sequence[PeakLoad]) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("peak load")
    table.add_column("unit")
    ensemble = any(peak.scatter is not None for peak in peaks)
    spread = (f"mean of {peaks[0].starts}", "scatter") if ensemble else ()
    for heading in ("raw", "at s", f"CFC {peaks[0].cfc}", "at s", "impulse N s", "change at half step", *spread):
        table.add_column(heading, justify="right")
    for peak in peaks:
        if peak.raw == 0.0:
            continue  # a wheel that never touched
        change = "-" if peak.half_step_change is None else percent(peak.half_step_change)
        table.add_row(
            peak.channel + (" *" if peak.domain_flags else ""),
            terminal.READABLE.get(peak.unit, (peak.unit, 1.0))[0],
            terminal.readable(peak.raw, peak.unit),
            f"{peak.raw_time:.3f}",
            terminal.readable(peak.filtered, peak.unit),
            "-" if peak.filtered_time is None else f"{peak.filtered_time:.3f}",
            "-" if peak.impulse is None else f"{peak.impulse:.4g}",
            change,
            *([terminal.readable(peak.mean, peak.unit), percent(peak.scatter or 0.0)] if ensemble else []),
        )
    return table


def regression(answers: Sequence[Answer], folder: str) -> None:
    """What changed, and one line for each scenario, on standard output."""
    from rollover.studies.regression import unchanged, without_baseline

    out = terminal.out()
    bad = sum(not a.ok for a in answers)
    updated = sum(a.verdict == "updated" for a in answers)
    written = "1 baseline written" if updated == 1 else f"{updated} baselines written"
    verdict = written if updated else f"{bad} of {len(answers)} scenarios are not as they were"
    if not bad and not updated:
        verdict = unchanged(answers)
    elif aside := without_baseline(answers):
        verdict = f"{verdict}; {aside}"
    out.print(f"{verdict[0].upper()}{verdict[1:]}.", style="bold", soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    for heading in ("scenario", "", "runs", "wall s"):
        table.add_column(heading, justify="right" if heading in ("runs", "wall s") else "left")
    table.add_column("", overflow="fold")
    for a in answers:
        style = "" if a.ok else "bold red"
        table.add_row(a.scenario, a.verdict, str(a.starts or "-"), f"{a.wall_time:.1f}", a.sentence, style=style)
    out.print(table)
    changed = [(a, d) for a in answers for d in a.differences if not d.same]
    if changed:
        loads = Table(box=None, pad_edge=False)
        for heading in ("scenario", "load", "filter", "unit"):
            loads.add_column(heading)
        for heading in ("was", "is", "change", "allowed"):
            loads.add_column(heading, justify="right")
        for a, d in changed:
            unit = terminal.READABLE.get(d.unit, (d.unit, 1.0))[0]
            change = "-" if d.change is None else f"{100.0 * d.change:+.3g} %"
            allowed = "-" if d.tolerance is None else percent(d.tolerance)
            was, now = (terminal.readable(v, d.unit) for v in (d.was, d.now))
            loads.add_row(a.scenario, d.load, d.filter, unit, was, now, change, allowed)
        out.print()
        out.print(loads)
    for a in answers:
        for note in a.notes:
            out.print(f"{a.scenario}: {note}", style="yellow", soft_wrap=True)  # a command is copied as it stands
    out.print(f"Everything: {folder}")
