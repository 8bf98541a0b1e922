"""What people read while a command works and when it is done: progress, tables, sentences."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from rollover.faults import excerpt, sentence
from rollover.stamps import in_digits

if TYPE_CHECKING:
    from collections.abc import Callable

    from rollover.baseline import Answer
    from rollover.calibrate import Calibration
    from rollover.criteria import Criterion
    from rollover.diagnosis import Diagnosis
    from rollover.loads import PeakLoad
    from rollover.misfit import Misfit
    from rollover.run import Run

QUIET = 2.0  # s of wall time: a run that is shorter shows no progress
EVERY = 5.0  # s between lines of progress where there is no terminal

# SI unit -> unit that an engineer reads, and how many of the one make one of the other
_READABLE = {"N": ("kN", 1e-3), "J": ("kJ", 1e-3), "m": ("mm", 1e3), "N s": ("N s", 1.0), "m/s2": ("g", 1.0 / 9.80665)}


class Plain(Console):
    """A console on which words from data colour and move nothing, and of a long value the beginning stands."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"emoji": False, **options})

    def render_str(self, text: str, **options: Any) -> Text:
        """Text of a line, of a sentence or of a table's cell."""
        return super().render_str("\n".join(map(sentence, text.split("\n"))), **options)


def _out() -> Console:
    return Plain(highlight=False, markup=False, soft_wrap=True, width=None if sys.stdout.isatty() else 160)


def say(what: str) -> None:
    """One line on standard error."""
    print(sentence(what), file=sys.stderr, flush=True)


def tell(lines: str) -> None:
    """Lines on standard output."""
    print("\n".join(sentence(line) for line in lines.split("\n")))


@contextmanager
def progress(what: str, start: float, end: float) -> Iterator[Callable[[float, float], None]]:
    """Give a callback that shows simulated time and speed: a bar on a terminal, otherwise a line now and then."""
    if sys.stderr.isatty():
        from rich.progress import BarColumn, Progress, TextColumn

        name = TextColumn("{task.description}", markup=False)
        columns = (name, BarColumn(), TextColumn("{task.fields[state]}", markup=False))
        with Progress(*columns, console=Plain(stderr=True), transient=True) as bar:
            task = bar.add_task(excerpt(what), total=end - start, visible=False, state="")

            def show(simulated: float, wall: float) -> None:
                state = _state(simulated, wall, start, end)
                bar.update(task, completed=simulated - start, visible=wall > QUIET, state=state)

            yield show
        return
    last = [-EVERY]

    def line(simulated: float, wall: float) -> None:
        if wall > QUIET and wall - last[0] >= EVERY:
            last[0] = wall
            say(f"{what}: {_state(simulated, wall, start, end)}")

    yield line


@contextmanager
def counting(what: str) -> Iterator[Callable[..., None]]:
    """Give a callback (done, of, note) that shows how many are done: a bar on a terminal, otherwise a line at times."""
    if sys.stderr.isatty():
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        words = (TextColumn(f"{{task.{field}}}", markup=False) for field in ("description", "fields[note]"))
        columns = (next(words), BarColumn(), MofNCompleteColumn(), next(words))
        with Progress(*columns, console=Plain(stderr=True)) as bar:
            task = bar.add_task(what, total=None, note="")
            yield lambda done, of, note="": bar.update(task, completed=done, total=of, note=note)
        return
    began = last = clock.monotonic()

    def line(done: int, of: int, note: str = "") -> None:
        nonlocal last
        now = clock.monotonic()
        if now - began > QUIET and now - last >= EVERY:
            last = now
            say(f"{done} of {of} {what}{note and ', '}{note}")

    yield line


def _state(simulated: float, wall: float, start: float, end: float) -> str:
    speed = (simulated - start) / wall if wall > 0.0 else 0.0
    return f"{simulated:.2f} of {end:g} s, {speed:.2g} x real time"


def readable(value: float | None, unit: str) -> str:
    """A number in the unit that an engineer reads it in, without the unit."""
    if value is None or value != value:
        return "-"
    return f"{value * _READABLE.get(unit, (unit, 1.0))[1]:.4g}"


def report(
    run: Run,
    peaks: Sequence[PeakLoad],
    rows: Sequence[Criterion],
    answer: Mapping[str, Any],
    folder: str,
    *,
    compiled: bool = False,
) -> None:
    """The answer of a run on standard output; what took part of its time to compile tells no speed."""
    from rollover.criteria import in_words
    from rollover.estimates import in_words as estimated
    from rollover.ledger import closure
    from rollover.loads import unconverged
    from rollover.shipped import origin

    out = _out()
    out.print(excerpt(run.scenario.title), style="bold")
    if (made_from := origin(run.scenario)) and made_from.differences:
        out.print(f"{made_from.in_words}.", style="yellow")
    if run.status == "done":
        speed = (run.stop_time - float(run.recording.time[0])) / run.wall_time if run.wall_time > 0.0 else 0.0
        pace = "most of it compiling, once" if compiled else f"{speed:.2g} x real time"
        out.print(f"{run.stop_time:g} s simulated in {run.wall_time:.2g} s ({pace})")
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
    if unsure := unconverged(peaks):
        out.print(f"{unsure[0].upper()}{unsure[1:]}.", style="bold yellow")
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


def _stand(out: Console, run: Run) -> None:
    from rollover.findings import findings

    found = findings(run.tests)
    assert found is not None
    table = Table(box=None, pad_edge=False)
    for k, heading in enumerate(found.headings):
        table.add_column(heading, justify="left" if k < found.words else "right")
    for row in found.rows:
        table.add_row(*row)
    out.print(table)
    out.print(f"{found.sentence}.", style="bold")
    out.print()


def _criteria(rows: Sequence[Criterion]) -> Table:
    table = Table(box=None, pad_edge=False)
    styles = {"met": "green", "not met": "bold red", "no verdict": "yellow", "compared": ""}
    for heading in ("standard", "requirement", "asked", "simulated", "margin", "half step", "verdict"):
        table.add_column(heading, justify="right" if heading in ("simulated", "margin", "half step") else "left")
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
    for heading in ("raw", "at s", f"CFC {peaks[0].cfc}", "at s", "impulse N s", "moves at half step", *spread):
        table.add_column(heading, justify="right")
    for peak in peaks:
        if peak.raw == 0.0:
            continue  # a wheel that never touched
        change = "-" if peak.half_step_change is None else f"{100.0 * peak.half_step_change:.2g} %"
        table.add_row(
            peak.channel + (" *" if peak.domain_flags else ""),
            _READABLE.get(peak.unit, (peak.unit, 1.0))[0],
            readable(peak.raw, peak.unit),
            f"{peak.raw_time:.3f}",
            readable(peak.filtered, peak.unit),
            "-" if peak.filtered_time is None else f"{peak.filtered_time:.3f}",
            "-" if peak.impulse is None else f"{peak.impulse:.4g}",
            change,
            *([readable(peak.mean, peak.unit), f"{100.0 * (peak.scatter or 0.0):.2g} %"] if ensemble else []),
        )
    return table


def regression(answers: Sequence[Answer], folder: str) -> None:
    """What changed, and one line for each scenario, on standard output."""
    out = _out()
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
            unit = _READABLE.get(d.unit, (d.unit, 1.0))[0]
            change = "-" if d.change is None else f"{100.0 * d.change:+.3g} %"
            allowed = "-" if d.tolerance is None else f"{100.0 * d.tolerance:.2g} %"
            was, now = (readable(v, d.unit) for v in (d.was, d.now))
            loads.add_row(a.scenario, d.load, d.filter, unit, was, now, change, allowed)
        out.print()
        out.print(loads)
    for a in answers:
        for note in a.notes:
            out.print(f"{a.scenario}: {note}", style="yellow", soft_wrap=True)  # a command is copied as it stands
    bad = sum(not a.ok for a in answers)
    updated = sum(a.verdict == "updated" for a in answers)
    verdict = f"{updated} baselines written" if updated else f"{bad} of {len(answers)} scenarios are not as they were"
    if not bad and not updated:
        verdict = f"all {len(answers)} scenarios are as they were"
    out.print(f"{verdict[0].upper()}{verdict[1:]}. Everything: {folder}", style="bold")


def comparison(found: Sequence[Misfit], folder: str) -> None:
    """How well each recording is followed, a line for each channel."""
    from rollover.rating import Iso18571, NotRateable, verdict

    styles = {"good": "", "fair": "yellow", "poor": "bold red"}
    out = _out()
    for each in found:
        out.print(each.recording, style="bold")
        table = Table(box=None, pad_edge=False)
        for heading in (
            "channel",
            "CFC",
            "ISO 18571",
            "",
            "rms/range %",
            "rms/noise",
            "peak %",
            "peak later ms",
            "verdict",
        ):
            table.add_column(heading, justify="left" if heading in ("channel", "", "verdict") else "right")
        for c in each.channels:
            first = (c.channel, str(c.cfc or "-"))
            if isinstance(c.rating, NotRateable):
                table.add_row(*first, "-", c.rating.reason)
                continue
            iso, peak = c.rating.iso18571, c.rating.peak
            judged = verdict(c.rating)
            table.add_row(
                *first,
                f"{iso.overall:.3f}" if isinstance(iso, Iso18571) else "-",
                iso.grade if isinstance(iso, Iso18571) else "not rated",
                "-" if c.rating.nrmse is None else f"{100.0 * c.rating.nrmse:.3g}",
                "-" if c.rating.over_noise is None else f"{c.rating.over_noise:.3g}",
                "-" if peak.relative_error is None else f"{100.0 * peak.relative_error:+.3g}",
                f"{1e3 * peak.time_error:+.3g}",
                judged.in_words,
                style=styles[judged.grade] or ("" if isinstance(iso, Iso18571) else "yellow"),
            )
        out.print(table)
        if each.zero is not None:
            out.print(f"{each.zero.sentence[0].upper()}{each.zero.sentence[1:]}: set to it.", style="yellow")
        if each.clock is not None:
            late, sigma, gain = 1e3 * each.clock.offset, 1e3 * each.clock.sigma, 100.0 * each.clock.gain
            out.print(f"Clock {late:+.3g} +- {sigma:.2g} ms late; setting it (not done) would remove {gain:.0f} %.")
        for channel, why in each.skipped.items():
            out.print(f"{channel}: left out, {why}", style="yellow")
        for note in each.notes:
            out.print(note, style="yellow")
    out.print(f"Results: {folder}")


def calibration(found: Calibration, folder: str) -> None:
    """Fitted values with their intervals, and what they gain."""
    out = _out()
    table = Table(box=None, pad_edge=False)
    for heading in ("parameter", "unit", "was", "is", "95 % from", "to", "", ""):
        table.add_column(heading, justify="right" if heading in ("was", "is", "95 % from", "to") else "left")
    for e in found.estimates:
        verdict = "determined" if e.determined else f"not determined: {e.why}"
        values = (f"{v:.5g}" for v in (e.start, e.value, e.low, e.high))
        table.add_row(e.path, e.unit, *values, e.method, verdict, style="" if e.determined else "yellow")
    out.print(table)
    for which, scores in (("fitted", found.training), ("held out", found.held_out)):
        if scores is None:
            continue
        before, after = scores.before, scores.after
        rated = ""
        if before.iso18571 is not None and after.iso18571 is not None:
            rated = f", ISO 18571 {before.iso18571:.3f} -> {after.iso18571:.3f}"
        names = ", ".join(scores.recordings)
        out.print(f"{which}: residual over noise {before.over_noise:.3g} -> {after.over_noise:.3g}{rated} ({names})")
    for name, zero in found.zeros.items():
        out.print(f"{name}: {zero.sentence}", style="yellow")
        if name in found.clocks:
            late = in_digits(found.clocks[name], found.clock_errors[name])
            out.print(f"{name}: fitted {late} s, 1 sigma {1e3 * found.clock_errors[name]:.2g} ms", style="yellow")
    for warning in found.warnings:
        out.print(warning, style="yellow")
    out.print(f"Results: {folder}")


def diagnosis(found: Diagnosis, folder: str) -> None:
    """The verdict in a sentence, what was found with intervals, and what it gains."""
    out = _out()
    out.print(f"{found.verdict}: {found.sentence}", style="bold")
    if found.effects:
        table = Table(box=None, pad_edge=False)
        for heading in ("effect", "channel", "parameter", "value", "95 % from", "to", "unit"):
            table.add_column(heading, justify="right" if heading in ("value", "95 % from", "to") else "left")
        for e in found.effects:
            for name, i in e.parameters.items():
                values = (f"{v:.5g}" for v in (i.value, i.low, i.high))
                bound = " (at the end of its range)" if i.at_bound else ""
                table.add_row(e.id, e.channel or "", name, *values, f"{i.unit}{bound}")
        out.print(table)
    for which, names in (("training", found.training), ("held_out", found.held_out)):
        if which not in found.before or which not in found.after:
            continue
        a, b = found.before[which], found.after[which]
        rated = ""
        if a.iso18571 is not None and b.iso18571 is not None:
            rated = f", ISO 18571 {a.iso18571:.3f} -> {b.iso18571:.3f}"
        title = "fitted" if which == "training" else "held out"
        out.print(f"{title}: misfit over noise {a.nrmse:.3g} -> {b.nrmse:.3g}{rated} ({', '.join(names)})")
    for e in found.effects:
        if e.indistinguishable_from:
            out.print(f"{e.id} or {', '.join(e.indistinguishable_from)}: measure next: {e.discriminating_test}")
    for note in found.notes:
        out.print(note, style="yellow")
    out.print(f"Results: {folder}")


def stability(answer: Mapping[str, Any], folder: str) -> None:
    """Static stability angles, a line for each heading, with the closed forms for stiff tyres beside."""
    out = _out()
    out.print(excerpt(answer["vehicle"]), style="bold")
    table = Table(box=None, pad_edge=False)
    for heading in ("heading", "lift-off", "pivot ends", "on stop", "overturns", "stiff: pivot", "stiff: stop"):
        table.add_column(heading, justify="right")
    table.add_column("first off")
    for row in answer["headings"]:
        stiff = row["closed_form"]["outer_edge"]
        angles = [row[f"{key}_deg"] for key in ("lift_off", "phase_one", "stop", "overturn")]
        angles += [stiff["free_pivot_deg"], stiff["rigid_deg"]]
        off = ", ".join(row["first_off"])
        table.add_row(f"{row['heading_deg']:g}", *("-" if a is None else f"{a:.2f}" for a in angles), off)
    out.print(table)
    meant = "Slopes in degrees; heading 0 uphill, 90 left side downhill. Stiff: closed form at the tyres' outer edges."
    out.print(meant)
    for part in answer["losses"]:
        share, was, now = 100.0 * part["share"], part["without_deg"], part["with_deg"]
        out.print(f"{part['part']}: takes {share:.1f} % across the slope, {was:.2f} -> {now:.2f} deg")
    if answer["effects_left_out"]:
        out.print(f"Effects were left out: {', '.join(answer['effects_left_out'])}.", style="yellow")
    least, limit = answer["least"], answer["code_6"]
    verdict = "below" if least["balance_deg"] < limit["limit_deg"] else "not below"
    out.print(
        f"Least {least['balance_deg']:.2f} deg at heading {least['heading_deg']:g}: {verdict} the "
        f"{limit['limit_deg']:g} deg asked of narrow tractors ({limit['confidence']}).",
        style="bold",
    )
    out.print(f"Results: {folder}")
