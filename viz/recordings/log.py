"""A run as a recording for the viewer (.rrd), written in columns; and the viewer, opened on this machine only."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from rollover.assessment.bands import Band
from rollover.assessment.ledger import closure
from rollover.dynamics.result import Run
from rollover.spec.document import content_hash, dump
from viz.content.entities import FILTERED, LIMIT, PHASE, SCATTER, series
from viz.content.verdict import Peak, filtered, known, ranked, raw, title_of, verdict
from viz.recordings import band
from viz.recordings.blueprint import Beside, blueprint
from viz.recordings.draw import WARNINGS, moving, peak_place, picture, sentence, standing
from viz.recordings.saved import saving
from viz.recordings.stream import Stream, colour
from viz.recordings.viewer import open_viewer

__all__ = ["open_viewer", "run_id", "write_rrd"]

# channels whose peaks are marked in their plots and told among the events; on all of them it would be noise
_MARKED = (
    "rops/force",
    "device/force",
    "device/deflection",
    "ground/force_normal",
    "rops/deflection",
    "ground/sinkage",
)


def write_rrd(
    run: Run,
    path: Path,
    *,
    peaks: Sequence[Peak] = (),
    bands: Sequence[Band] = (),
    beside: Callable[[Stream], None] | None = None,
    shown: Beside | None = None,
) -> None:
    """Write a run as a recording for the viewer, whole or not at all; a failed run is shown as far as it came.

    `peaks` are the peak loads of the report; without them, raw peaks are read off the channels. `bands` are those of
    neighbouring starts. `beside` writes what stands beside the simulated values, `shown` says how the layout shows it.
    """
    name = run_id(run)
    # one application for each scenario: recordings of one application share a layout, and another vehicle's eye and
    # plots would be used for this one
    rec = rr.RecordingStream(f"rollover {name}", recording_id=name)
    with_ = picture(run)
    with saving(rec, path, blueprint(run, ", ".join(with_.scales), shown)):
        out, found = Stream(rec), ranked(run, peaks)
        standing(out, run, with_)
        _looks(out, run, found)
        for one in bands:
            s, name = series(one.channel), f"mean of {one.starts} starts, CFC {one.cfc}"
            band.look(out, s.scatter, name=name, width=1.5, unit=s.unit, is_band=True, shade=SCATTER)
        _documents(out, run, verdict(run, found, with_.scales))
        out.settle()
        moving(out, run, with_)
        for channel, values in run.recording.channels.items():
            s = series(channel)
            out.columns(s.simulated, run.recording.time, rr.Scalars.columns(scalars=values * s.factor))
        for one in bands:
            s = series(one.channel)
            band.rows(out, s.scatter, one.time, one.mean * s.factor, one.deviation * s.factor)
        _peaks(out, run, found)
        if found and found[0] in _marked(run, found):
            peak_place(out, run, found[0], with_.size)
        _phases(out, run)
        _events(out, run, found)
        if beside is not None:
            beside(out)


def run_id(run: Run) -> str:
    """Identity of a recording: title and content hash of the scenario, in the characters that an id may have."""
    slug = re.sub(r"[^A-Za-z0-9]+", "-", run.scenario.title).strip("-").lower()[:60]
    return "-".join(filter(None, (slug, content_hash(run.scenario)[:12])))


def _looks(out: Stream, run: Run, peaks: Sequence[Peak]) -> None:
    """Names, colours and widths; MinMax, for any other aggregation draws a short peak lower than it was."""
    for channel in run.recording.channels:
        s = series(channel)
        look = rr.SeriesLines(
            names=[s.legend],
            colors=colour(s.colour),
            widths=[2.0 if channel in _MARKED else 1.5],
            aggregation_policy=rr.components.AggregationPolicy.MinMax,
        )
        out.static(s.simulated, look)
    for peak in _marked(run, peaks):
        s = series(peak.channel)
        out.static(s.peak, _diamond(f"peak {raw(peak)}", LIMIT))
        if known(peak.filtered):
            out.static(s.filtered_peak, _diamond(f"CFC {peak.cfc}: {filtered(peak)}", FILTERED))
    names = list(PHASE)
    out.static("phase", rr.StateConfiguration(values=names, labels=names, colors=colour(*PHASE.values())))


def _diamond(name: str, shade: int) -> Any:
    diamond = rr.components.MarkerShape.Diamond
    return rr.SeriesPoints(names=[name], colors=colour(shade), markers=[diamond], marker_sizes=[5.0])


def _marked(run: Run, peaks: Sequence[Peak]) -> list[Peak]:
    return [p for p in peaks if p.channel in _MARKED and p.channel in run.recording.channels and p.raw]


def _peaks(out: Stream, run: Run, peaks: Sequence[Peak]) -> None:
    """Diamonds in the plots; their names in the legend say how high and when."""
    for peak in _marked(run, peaks):
        s = series(peak.channel)
        out.columns(s.peak, np.array([peak.raw_time]), rr.Scalars.columns(scalars=[peak.raw * s.factor]))
        if known(peak.filtered):
            value, time = peak.filtered, peak.filtered_time
            out.columns(s.filtered_peak, np.array([time]), rr.Scalars.columns(scalars=np.array([value]) * s.factor))


def _documents(out: Stream, run: Run, words: str) -> None:
    markdown = rr.MediaType.MARKDOWN
    out.static("report/verdict", rr.TextDocument(words, media_type=markdown))
    scenario = f"# {run.scenario.title}\n\n```yaml\n{dump(run.scenario)}\n```\n"
    out.static("report/scenario", rr.TextDocument(scenario, media_type=markdown))
    out.rec.send_recording_name(run.scenario.title)
    facts: Mapping[str, Any] = {
        "title": run.scenario.title,
        "status": run.status,
        "sentence": run.sentence,
        "scenario_hash": content_hash(run.scenario),
        "integrator": run.scenario.integrator,
        "domain_flags": ", ".join(run.domain_flags),
        "stop_time_s": run.stop_time,
        "wall_time_s": run.wall_time,
        "energy_residual_J": float(run.ledger.get("residual", np.nan)),
        "energy_residual_largest_share": closure(run).largest,
        **{
            f"version_{name.replace('-', '_')}": _version(name) for name in ("rollover", "exudyn", "numpy", "rerun-sdk")
        },
    }
    out.rec.send_property("run", rr.AnyValues(**facts))


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "not installed"


def _phases(out: Stream, run: Run) -> None:
    phases = list(run.phases) + ([(run.stop_time, "failed")] if run.status == "failed" else [])
    if phases:
        names = rr.StateChange.columns(state=[name for _, name in phases])
        out.columns("phase", np.array([start for start, _ in phases]), names)


def _events(out: Stream, run: Run, peaks: Sequence[Peak]) -> None:
    entries = [(e.time, "WARN" if e.kind in WARNINGS else "INFO", sentence(e)) for e in run.events]
    entries += [(p.raw_time, "PEAK", f"{title_of(p)}: {raw(p)}") for p in _marked(run, peaks)]
    # the way the run ended belongs there too, and the log is never empty
    entries.append((run.stop_time, "ERROR" if run.status == "failed" else "INFO", run.sentence or "end of the run"))
    text = rr.TextLog.columns(text=[e[2] for e in entries], level=[e[1] for e in entries])
    out.columns("events", np.array([e[0] for e in entries]), text)
