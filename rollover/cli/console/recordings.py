"""What comparisons, calibrations, diagnoses, stability and rolling answer, on standard output: tables and sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.table import Table

from rollover.cli.console import terminal
from rollover.recording.time_stamps import in_digits
from rollover.system.errors import excerpt

if TYPE_CHECKING:
    from rollover.calibration.calibrate import Calibration
    from rollover.comparison.misfit import Misfit
    from rollover.diagnosis import Diagnosis


def comparison(found: Sequence[Misfit], folder: str) -> None:
    """How well each recording is followed, a line for each channel."""
    from rollover.comparison.rating import Iso18571, NotRateable, verdict
    from viz.pages.comparison import headline

    styles = {"good": "", "fair": "yellow", "poor": "bold red"}
    out = terminal.out()
    head = headline(found)
    out.print(head.sentence, style="bold")
    out.print(head.detail)
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
            said = each.clock.sentence
            out.print(f"{said[0].upper()}{said[1:]}.")
        for channel, why in each.skipped.items():
            out.print(f"{channel}: left out, {why}", style="yellow")
        for note in each.notes:
            out.print(note, style="yellow")
    out.print(f"Results: {folder}")


def calibration(found: Calibration, folder: str) -> None:
    """Fitted values with their intervals, and what they gain."""
    from viz.pages.calibration import headline

    out = terminal.out()
    out.print(headline(found).sentence, style="bold")
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
    if (drawn := found.posterior) is not None:
        worst, least = float(drawn.r_hat.max()), float(drawn.effective.min())
        out.print(
            f"posterior: {len(drawn.draws)} samples by {drawn.sampler}, R-hat up to {worst:.3f}, autocorrelation time "
            f"up to {float(drawn.autocorrelation.max()):.2g} steps, {least:.0f} independent samples at least"
        )
    for warning in found.warnings:
        out.print(warning, style="yellow")
    out.print(f"Results: {folder}")


def diagnosis(found: Diagnosis, folder: str) -> None:
    """The verdict in a sentence, what was found with intervals, and what it gains."""
    out = terminal.out()
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
    for name, i in found.baseline.items():
        bound = " (at the end of its range)" if i.at_bound else ""
        out.print(f"{name}: {i.value:.5g} ({i.low:.5g} to {i.high:.5g}) {i.unit}{bound}")
    for which, names in (("training", found.training), ("held_out", found.held_out)):
        if which not in found.before or which not in found.after:
            continue
        a, b = found.before[which], found.after[which]
        rated = ""
        if a.iso18571 is not None and b.iso18571 is not None:
            rated = f", ISO 18571 {a.iso18571:.3f} -> {b.iso18571:.3f}"
        title = "fitted" if which == "training" else "held out"
        out.print(f"{title}: misfit over noise {a.nrmse:.3g} -> {b.nrmse:.3g}{rated} ({', '.join(names)})")
    shares = sum(e.explains is not None for e in found.effects)
    for e in found.effects:
        if e.explains is not None:
            out.print(f"{e.id}: {e.answer}, {e.explains.message(alone=shares == 1)}")
        if e.indistinguishable_from:
            out.print(f"{e.id} or {', '.join(e.indistinguishable_from)}? Measure next: {e.discriminating_test}")
        if e.next_test is not None:
            out.print(f"Judging by these recordings, {e.next_test.message()}.")
    for note in found.notes:
        out.print(note, style="yellow")
    out.print(f"Results: {folder}")


def stability(answer: Mapping[str, Any], folder: str) -> None:
    """Static stability angles, a line for each heading, with the closed forms for stiff tyres beside."""
    out = terminal.out()
    out.print(excerpt(answer["vehicle"]), style="bold")
    least, limit = answer["least"], answer["code_6"]
    verdict = "below" if least["balance_deg"] < limit["limit_deg"] else "not below"
    angle, heading = f"{least['balance_deg']:.2f} deg", f"heading {least['heading_deg']:g}"
    of_this = "" if limit["applies"] else ", not of this one"
    asked = f"{limit['limit_deg']:g} deg asked of narrow tractors{of_this} ({limit['confidence']})"
    out.print(f"Least static stability angle {angle}, at {heading}: {verdict} the {asked}.", style="bold")
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
    _left_out(answer)
    out.print(f"Results: {folder}")


def _left_out(answer: Mapping[str, Any]) -> None:
    if answer["effects_left_out"]:
        terminal.out().print(f"Effects were left out: {', '.join(answer['effects_left_out'])}.", style="yellow")


def rolling(answer: Mapping[str, Any], folder: str) -> None:
    """Verdict of the planar calculation of rolling, beside every number on the way."""
    out = terminal.out()
    out.print(excerpt(answer["vehicle"]), style="bold")
    out.print(
        f"{answer['verdict'].capitalize()} rolling (version {answer['version']}): {answer['sentence']}.", style="bold"
    )
    table = Table(box=None, pad_edge=False)
    table.add_column("step")
    table.add_column("what")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_column("basis")
    for s in answer["steps"]:
        table.add_row(s["symbol"], s["what"], f"{s['value']:.4g}", s["unit"], s["basis"])
    out.print(table)
    for said in answer["outside"]:
        out.print(said, style="yellow")
    _left_out(answer)
    out.print(f"{answer['source']}.")
    out.print(f"Results: {folder}")
