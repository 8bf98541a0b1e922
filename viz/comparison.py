"""Measured over simulated in the viewer, on the run's own layout: the same plots, the residual, both contacts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rollover.misfit import ChannelMisfit, Misfit
from rollover.run import Run
from viz.entities import MEASURED, PHASE, series
from viz.log import write_rrd
from viz.stream import Stream, colour


def write_comparison(run: Run, found: Misfit, path: Path) -> None:
    """Write a run with a recording over it, whole or not at all; the recording keeps its own stamps."""
    views = [] if not found.channels else [_residuals(found)]
    write_rrd(run, path, beside=lambda out: _beside(out, found), views=views)


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
    for c in found.channels:
        s = series(c.channel)
        measured = rr.SeriesLines(
            names=[f"{s.legend}, measured"], colors=colour(MEASURED), widths=[1.5], aggregation_policy=min_max
        )
        residual = rr.SeriesLines(names=[s.name], colors=colour(s.colour), widths=[1.0], aggregation_policy=min_max)
        out.static(s.measured, measured)
        out.static(s.residual, residual)
        _columns(out, s.measured, c, c.measured * s.factor)
        _columns(out, s.residual, c, c.residual / (c.noise or 0.01 * float(np.ptp(c.measured)) or 1.0))
    marks = [(at, phase if phase in PHASE else "impact") for at, phase in found.phases]
    out.static(
        "phase_measured", rr.StateConfiguration(values=list(PHASE), labels=list(PHASE), colors=colour(*PHASE.values()))
    )
    out.columns(
        "phase_measured", np.array([at for at, _ in marks]), rr.StateChange.columns(state=[name for _, name in marks])
    )
    words = f"# {found.title}\n\n" + "\n".join(f"- {line}" for line in sentences(found))
    out.static("report/comparison", rr.TextDocument(words, media_type=rr.MediaType.MARKDOWN))


def _columns(out: Stream, path: str, c: ChannelMisfit, values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    """Values with a gap where the recording has one: a line is not drawn over it."""
    step = np.diff(c.time)
    breaks = np.flatnonzero(step > 2.5 * float(np.median(step))) + 1
    time = np.insert(c.time, breaks, c.time[breaks] - 1e-6)
    out.columns(path, time, rr.Scalars.columns(scalars=np.insert(values, breaks, np.nan)))


def sentences(found: Misfit) -> list[str]:
    """What is to be known about a comparison besides its numbers."""
    lines = []
    if found.contact_measured is not None and found.contact_simulated is not None:
        lines.append(
            f"first contact: measured {found.contact_measured:.4f} s, simulated {found.contact_simulated:.4f} s"
        )
    if found.clock is not None:
        c = found.clock
        lines.append(
            f"the recording's clock agrees best when taken {1e3 * c.offset:+.3g} +- {1e3 * c.sigma:.2g} ms late; "
            f"setting it, which was not done, would remove {100.0 * c.gain:.0f} % of the squared residual"
        )
        if c.at_limit:
            lines.append("that is the end of the window that was searched: the clocks may be further apart")
    if found.energy_measured is not None and found.energy_simulated is not None:
        lines.append(
            f"work that the ground took: measured {found.energy_measured:.4g} J, "
            f"simulated {found.energy_simulated:.4g} J"
        )
    lines += [f"{channel}: left out, {why}" for channel, why in found.skipped.items()]
    return [*lines, *found.notes]
