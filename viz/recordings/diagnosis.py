"""A diagnosis in the viewer: measured, before, after and what is left, all recordings on one time line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rollover.diagnosis import Diagnosis
from rollover.diagnosis.overlay import Overlay, Track
from viz.content.diagnosis_words import answer, markdown, ranked
from viz.content.entities import LIMIT, MEASURED, SIMULATED, escaped, series
from viz.recordings import band
from viz.recordings.blueprint import framed
from viz.recordings.saved import saving
from viz.recordings.stream import Stream, colour

PHASES = {
    "approach": 0x4A5B70FF,
    "free-fall": 0x4A5B70FF,
    "first-contact": 0xC24A44FF,
    "loading": 0x3D6391FF,
    "peak": 0xC2A23CFF,
    "unloading": 0x7A5FA3FF,
    "rest": 0x3F8A4BFF,
    "support": 0x4A5B70FF,
    "tipping": 0x3D6391FF,
    "impact": 0xC24A44FF,
    "sliding": 0xC2A23CFF,
}
STACKED = 4  # channels that stand one above the other; more stand in two columns
# the viewer draws what was measured last, thin, so that the curve that follows it is seen below
_SOURCES = (("measured", MEASURED, 1.0), ("before", LIMIT, 1.5), ("after", SIMULATED, 4.0))


def write_diagnosis(found: Diagnosis, overlays: Sequence[Overlay], path: Path, title: str) -> None:
    """Write a diagnosis as a recording for the viewer, whole or not at all."""
    rec = rr.RecordingStream("rollover diagnosis", recording_id=_id(found, overlays))
    with saving(rec, path, _blueprint(found, overlays)):
        out = Stream(rec)
        out.static("answer", rr.TextDocument(markdown(found), media_type=rr.MediaType.MARKDOWN))
        rec.send_recording_name(f"{title}: {answer(found)}")
        for one in overlays:
            _looks(out, one)
        out.settle()
        for one in overlays:
            _recording(out, one)


def _id(found: Diagnosis, overlays: Sequence[Overlay]) -> str:
    return "-".join(["diagnosis", found.verdict, *(t.recording for t in overlays)])


def _path(one: Overlay, track: Track, what: str) -> str:
    """Entity of a channel's curves or residuals: each recording has its own branch."""
    last = series(track.channel).path.rpartition("/")[2]
    return f"{escaped(one.recording)}/{what}/{last}"


def _looks(out: Stream, one: Overlay) -> None:
    for track in one.tracks:
        s = series(track.channel)
        for source, shade, width in _SOURCES:
            if source == "after" and track.after is None:
                continue
            path = f"{_path(one, track, 'values')}/{source}"
            if source == "measured":
                band.look(out, path, name=source, width=width, unit=s.unit, is_band=True)
                continue
            out.static(path, _line(source, shade, width))
            out.static(f"{_path(one, track, 'residual')}/{source}", _line(f"{s.name}, {source}", shade, 1.0))
    names = list(PHASES)
    looks = rr.StateConfiguration(values=names, labels=names, colors=colour(*PHASES.values()))
    out.static(f"{escaped(one.recording)}/phase", looks)


def _line(name: str, shade: int, width: float) -> Any:
    return rr.SeriesLines(names=[name], colors=colour(shade), widths=[width], aggregation_policy=band.POLICY)


def _recording(out: Stream, one: Overlay) -> None:
    for track in one.tracks:
        factor = series(track.channel).factor
        for source, values in (("measured", track.measured), ("before", track.before), ("after", track.after)):
            if values is None:
                continue
            sigma = factor * track.noise * track.unsure if source == "measured" else None
            band.rows(out, f"{_path(one, track, 'values')}/{source}", track.time, values * factor, sigma)
            if source != "measured":
                left = (track.measured - values) / (track.noise * track.unsure)
                band.rows(out, f"{_path(one, track, 'residual')}/{source}", track.time, left, None)
    marks = [(at, name) for at, name in one.phases if name in PHASES]
    states = rr.StateChange.columns(state=[name for _, name in marks])
    out.columns(f"{escaped(one.recording)}/phase", np.array([at for at, _ in marks]), states)


def _blueprint(found: Diagnosis, overlays: Sequence[Overlay]) -> rrb.Blueprint:
    """First the answer beside the place where it shows most; then a tab for each recording."""
    words = rrb.TextDocumentView(origin="/answer", contents=["+ /answer"], name="Answer")
    by_share = ranked(found, overlays)
    front: Any = words
    if by_share and by_share[0][1]:
        one, tracks = by_share[0]
        views = [_values(one, tracks[0]), _residual(one, tracks[:1]), _phase(one)]
        front = rrb.Horizontal(
            words, rrb.Vertical(*views, row_shares=[4, 3, 1]), column_shares=[2, 3], name="The answer"
        )
    tabs = [front]
    for one, tracks in by_share:
        columns = 1 + (len(tracks) > STACKED)
        plots = [_values(one, t) for t in tracks]
        rows = [
            rrb.Horizontal(*plots[k : k + columns]) if columns > 1 else plots[k] for k in range(0, len(plots), columns)
        ]
        name = f"{one.recording}, held out" if one.held_out else one.recording
        views = [*rows, _residual(one, tracks), _phase(one)]
        tabs.append(rrb.Vertical(*views, row_shares=[*[3] * len(rows), 3, 1], name=name))
    return framed(rrb.Tabs(*tabs, active_tab=0))


def _values(one: Overlay, track: Track) -> rrb.TimeSeriesView:
    s = series(track.channel)
    return _plot(f"{one.recording}: {s.name}, {s.unit}", [_path(one, track, "values")])


def _residual(one: Overlay, tracks: Sequence[Track]) -> rrb.TimeSeriesView:
    paths = [_path(one, t, "residual") for t in tracks]
    over = "over the noise" if all(t.scatter is None for t in tracks) else "over noise and scatter of runs"
    return _plot(f"{one.recording}: measured less simulated, {over}", paths)


def _plot(name: str, paths: Sequence[str]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"+ /{p}/**" for p in paths],
        name=name,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend("RightTop"),
    )


def _phase(one: Overlay) -> rrb.StateTimelineView:
    root = f"/{escaped(one.recording)}/phase"
    return rrb.StateTimelineView(origin=root, contents=[f"+ {root}"], name="Phase")
