"""Measured over simulated in the viewer, on the run's own layout: the same plots, the residual, both contacts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from rollover.comparison.misfit import ChannelMisfit, Misfit
from rollover.comparison.rating import Iso18571, Rating, verdict, worst_verdict
from rollover.dynamics.result import Run
from viz.content.entities import CYCLE, PHASE, series
from viz.recordings import band
from viz.recordings.blueprint import Beside
from viz.recordings.log import write_rrd
from viz.recordings.stream import Stream, colour

Array = NDArray[np.float64]


def write_comparison(run: Run, found: Misfit, path: Path) -> None:
    """Write a run with a recording over it, whole or not at all; the recording keeps its own stamps."""
    views = [] if not found.channels else [_residuals(found)]
    phase = "phase_measured" if found.phases else ""
    shown = Beside(answer="/report/comparison", title="Measured against simulated", views=views, phase=phase)
    write_rrd(run, path, beside=lambda out: _beside(out, found), shown=shown)


def _residuals(found: Misfit) -> rrb.TimeSeriesView:
    known = all(c.noise for c in found.channels)
    return rrb.TimeSeriesView(
        origin="/residual",
        contents=["+ /residual/**"],
        name="Measured less simulated, over the noise" if known else "Measured less simulated, over noise or 1 %",
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend("RightTop"),
    )


def _beside(out: Stream, found: Misfit) -> None:
    min_max = rr.components.AggregationPolicy.MinMax
    for k, c in enumerate(found.channels):
        s, own = series(c.channel), CYCLE[k % len(CYCLE)]  # two channels in one plot are told apart
        residual = rr.SeriesLines(names=[s.name], colors=colour(own), widths=[1.0], aggregation_policy=min_max)
        out.static(s.simulated, rr.SeriesLines.from_fields(names=[f"{s.legend}, simulated"]))
        out.static(s.residual, residual)
        _measured(out, c)
        time, values = band.broken(c.time, c.residual / (c.noise or 0.01 * float(np.ptp(c.measured)) or 1.0))
        out.columns(s.residual, time, rr.Scalars.columns(scalars=values))
    marks = [(at, phase if phase in PHASE else "impact") for at, phase in found.phases]
    out.static(
        "phase_measured", rr.StateConfiguration(values=list(PHASE), labels=list(PHASE), colors=colour(*PHASE.values()))
    )
    out.columns(
        "phase_measured", np.array([at for at, _ in marks]), rr.StateChange.columns(state=[name for _, name in marks])
    )
    out.static("report/comparison", rr.TextDocument(markdown(found), media_type=rr.MediaType.MARKDOWN))


def _measured(out: Stream, c: ChannelMisfit) -> None:
    """The measured curve, with a band of 1 sigma of its noise to each side where that is known."""
    s = series(c.channel)
    band.look(out, s.measured, name=f"{s.legend}, measured", width=1.5, unit=s.unit, is_band=bool(c.noise))
    sigma = np.full(c.time.size, c.noise * s.factor) if c.noise else None
    band.rows(out, s.measured, c.time, c.measured * s.factor, sigma)


def markdown(found: Misfit) -> str:
    """The worst rating as the answer, a line for each channel, and what else is to be known."""
    rated = [(iso, c) for c in found.channels if (iso := _iso(c)) is not None]
    worst = min(rated, key=lambda pair: pair[0].overall, default=None)
    head = "none of the channels could be rated"
    if worst is not None:
        iso, c = worst
        head = f"ISO/TS 18571 {iso.overall:.2f} ({iso.grade}) at worst, {series(c.channel).name}"
    lines = [f"# {head[0].upper()}{head[1:]}", "", found.title, ""]
    if judged := [verdict(c.rating) for c in found.channels if isinstance(c.rating, Rating)]:
        lines += [f"Agreement at worst {worst_verdict(judged).in_words}.", ""]
    lines += ["| channel | CFC | ISO/TS 18571 | RMS / noise | peak | peak later |", "|---|---|---|---|---|---|"]
    for c in found.channels:
        lines.append(f"| {series(c.channel).name} | {c.cfc or 'none'} | {' | '.join(_cells(c))} |")
    return "\n".join([*lines, "", *(f"- {line}" for line in sentences(found))])


def _iso(c: ChannelMisfit) -> Iso18571 | None:
    iso = c.rating.iso18571 if isinstance(c.rating, Rating) else None
    return iso if isinstance(iso, Iso18571) else None


def _cells(c: ChannelMisfit) -> list[str]:
    if not isinstance(c.rating, Rating):
        return [c.rating.reason, "", "", ""]
    iso, peak = _iso(c), c.rating.peak
    return [
        "not rated" if iso is None else f"{iso.overall:.3f} {iso.grade}",
        "" if c.rating.over_noise is None else f"{c.rating.over_noise:.3g}",
        "" if peak.relative_error is None else f"{100.0 * peak.relative_error:+.3g} %",
        f"{1e3 * peak.time_error:+.3g} ms",
    ]


def sentences(found: Misfit) -> list[str]:
    """What is to be known about a comparison besides its numbers."""
    lines = [] if found.zero is None else [f"{found.zero.sentence}; it was set to it"]
    if found.contact_measured is not None and found.contact_simulated is not None:
        lines.append(
            f"first contact: measured {_instant(found.contact_measured)}, simulated {_instant(found.contact_simulated)}"
        )
    if found.clock is not None:
        lines.append(found.clock.sentence)
        if found.clock.at_limit:
            lines.append("that is the end of the window that was searched: the clocks may be further apart")
    if found.energy_measured is not None and found.energy_simulated is not None:
        lines.append(
            f"work that the ground took: measured {found.energy_measured:.4g} J, "
            f"simulated {found.energy_simulated:.4g} J"
        )
    lines += [f"{channel}: left out, {why}" for channel, why in found.skipped.items()]
    return [*lines, *found.notes]


def _instant(time: float) -> str:
    return f"{round(time, 4) + 0.0:.4f} s"  # + 0.0: a tiny negative time is not -0.0000
