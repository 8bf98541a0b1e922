"""Two runs in one recording for the viewer: both scenes on one time line, one over the other, loads and difference."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from rollover.assessment.results import PICTURE
from rollover.comparison.run_pair import Pair, Result, difference
from viz.content.entities import MEASURED, PHASE, SIMULATED, Series, series
from viz.content.pair_words import markdown
from viz.recordings.blueprint import BACKGROUND, LOADS, MOTION, TOP, framed, matching
from viz.recordings.saved import saving
from viz.recordings.stream import Stream, colour

BASELINE, CANDIDATE = MEASURED, SIMULATED  # colours: orange was, blue is
DIFFERENCE = 0xF2F2F2FF
SIDES = ("baseline", "candidate")
_PAINTED = {"Boxes3D": rr.Boxes3D, "Cylinders3D": rr.Cylinders3D, "Ellipsoids3D": rr.Ellipsoids3D}
_PAINTED |= {"LineStrips3D": rr.LineStrips3D}
_LEFT_OUT = ("/world/ground", "/world/events", "/world/peak", "/world/followed", "/world/forces")
Eye = tuple[tuple[float, ...], tuple[float, ...]]


def write_pair(found: Pair, path: Path) -> None:
    """Write two runs as one recording, whole or not at all; their folders' own recordings give the scenes.

    Raises ``FileNotFoundError`` if one of them has no recording.
    """
    results = dict(zip(SIDES, (found.baseline, found.candidate), strict=True))
    for result in results.values():
        if not (result.folder / PICTURE).is_file():
            raise FileNotFoundError(f"{result.folder}: no {PICTURE} there; run it again with `rollover run`")
    names = [str(r.answer["scenario_hash"])[:12] for r in results.values()]
    rec = rr.RecordingStream("rollover pair", recording_id="-".join(["pair", *names]))
    scenes = {side: _scene(side, result) for side, result in results.items()}
    with saving(rec, path, _blueprint(found, scenes)):
        out = Stream(rec)
        rec.send_recording_name(f"{found.baseline.answer['title']}: baseline and candidate")
        out.static("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        out.static("answer", rr.TextDocument(markdown(found), media_type=rr.MediaType.MARKDOWN))
        rec.send_chunks([c for chunks in scenes.values() for c in chunks if c.is_static])
        for channel in found.channels:
            _looks(out, series(channel))
        for side in SIDES:
            looks = rr.StateConfiguration(values=list(PHASE), labels=list(PHASE), colors=colour(*PHASE.values()))
            out.static(f"{side}/phase", looks)
        out.settle()
        rec.send_chunks([c for chunks in scenes.values() for c in chunks if not c.is_static])
        for side, result in results.items():
            _values(out, side, result, found.channels)
        for channel in found.channels:
            time, less = difference(found, channel)
            s = series(channel)
            out.columns(f"difference/{s.path}", time, rr.Scalars.columns(scalars=less * s.factor))


def _scene(side: str, result: Result) -> list[Any]:
    """All chunks of a run's scene, moved below the name of its side."""
    stream = RrdReader(result.folder / PICTURE).stream().filter(content="/world/**")
    return list(stream.map(lambda c: c.with_entity_path(f"/{side}{c.entity_path}")).to_chunks())


def _looks(out: Stream, s: Series) -> None:
    for side, shade, width in (("baseline", BASELINE, 2.5), ("candidate", CANDIDATE, 1.5)):
        out.static(f"{s.path}/{side}", _line(f"{s.legend}, {side}", shade, width))
    out.static(f"difference/{s.path}", _line(f"{s.legend}, candidate less baseline", DIFFERENCE, 1.0))


def _line(name: str, shade: int, width: float) -> Any:
    policy = rr.components.AggregationPolicy.MinMax  # any other draws a short peak lower than it was
    return rr.SeriesLines(names=[name], colors=colour(shade), widths=[width], aggregation_policy=policy)


def _values(out: Stream, side: str, result: Result, channels: Sequence[str]) -> None:
    for channel in channels:
        s = series(channel)
        values = rr.Scalars.columns(scalars=result.recording[channel] * s.factor)
        out.columns(f"{s.path}/{side}", result.recording.time, values)
    names = rr.StateChange.columns(state=[name if name in PHASE else "impact" for _, name in result.phases])
    out.columns(f"{side}/phase", np.array([start for start, _ in result.phases]), names)


def _blueprint(found: Pair, scenes: dict[str, list[Any]]) -> rrb.Blueprint:
    """First the answer beside both scenes; then one scene over the other; then every plot with its difference."""
    eye = _eye(found.baseline.folder / PICTURE)
    words = rrb.TextDocumentView(origin="/answer", contents=["+ /answer"], name="What changed")
    beside = rrb.Horizontal(*(_view(side, scenes[side], eye) for side in SIDES))
    phases = [
        rrb.StateTimelineView(origin=f"/{side}/phase", contents=[f"+ /{side}/phase"], name=f"Phase, {side}")
        for side in SIDES
    ]
    # a plot of nothing but zeros says nothing
    loaded = [c for c in found.channels if any(np.any(np.nan_to_num(r.recording[c])) for r in _both(found))]
    plots = [(title, s) for title, s in matching(loaded, (*TOP, *LOADS, *MOTION))]
    tabs: list[Any] = []

    def asked() -> list[rrb.TimeSeriesView]:  # a view stands in one place only
        return [_plot(*plots[0]), _plot(*plots[0], less=True)] if plots else []

    left = rrb.Vertical(beside, *phases, row_shares=[7, 1, 1])
    right = rrb.Vertical(words, *asked(), row_shares=[3, *[2] * len(asked())])
    tabs.append(rrb.Horizontal(left, right, column_shares=[3, 2], name="Side by side"))
    over = rrb.Horizontal(_over(scenes, eye), rrb.Vertical(*asked()), column_shares=[3, 2], name="One over the other")
    tabs.append(over if plots else _over(scenes, eye))
    rows = [rrb.Vertical(_plot(*p), _plot(*p, less=True), name=p[0]) for p in plots[1:]]
    if rows:
        tabs.append(rrb.Tabs(*rows, name="Every plot"))
    return framed(rrb.Tabs(*tabs, active_tab=0))


def _both(found: Pair) -> tuple[Result, Result]:
    return found.baseline, found.candidate


def _eye(path: Path) -> Eye | None:
    """Place and target of the eye in a run's recording, of the view that shows the whole scene."""
    reader = RrdReader(path)
    for store in reader.blueprints():
        origins: dict[str, str] = {}
        eyes: dict[str, Eye] = {}
        for chunk in reader.stream(store=store).to_chunks():
            view, batch = str(chunk.entity_path).split("/")[1:3], chunk.to_record_batch()
            if "ViewBlueprint:space_origin" in batch.schema.names:
                origins[view[-1]] = batch["ViewBlueprint:space_origin"].to_pylist()[-1][0]
            if {"EyeControls3D:position", "EyeControls3D:look_target"} <= set(batch.schema.names):
                at, to = (batch[f"EyeControls3D:{p}"].to_pylist()[-1][0] for p in ("position", "look_target"))
                eyes[view[-1]] = (tuple(at), tuple(to))
        for view_id, eye in eyes.items():
            if origins.get(view_id) == "/world":
                return eye
    return None


def _view(side: str, chunks: Sequence[Any], eye: Eye | None) -> rrb.Spatial3DView:
    scale = next((m[1] for c in chunks if (m := re.search(r"forces_1m_is_([\d.]+)kN", str(c.entity_path)))), None)
    name = side.capitalize() + (f": arrows 1 m = {scale} kN" if scale else "")
    return _spatial(name, f"/{side}/world", [f"+ /{side}/world/**"], eye, {})


def _over(scenes: dict[str, list[Any]], eye: Eye | None) -> rrb.Spatial3DView:
    """The candidate as it is, and the baseline's bodies in its colour."""
    baseline, candidate = SIDES
    contents = [f"+ /{candidate}/world/**", f"- /{candidate}/world/events/**", f"+ /{baseline}/world/**"]
    paths = {str(c.entity_path).removeprefix(f"/{baseline}") for c in scenes[baseline]}
    hidden = {next(p for p in _LEFT_OUT if path.startswith(p)) for path in paths if path.startswith(_LEFT_OUT)}
    contents += [f"- /{baseline}{path}/**" for path in sorted(hidden - {"/world/forces"})]
    contents += sorted(f"- /{baseline}{p}" for p in paths if p.startswith("/world/forces"))
    painted: dict[str, Any] = {}
    for chunk in scenes[baseline]:
        path = str(chunk.entity_path).removeprefix(f"/{baseline}")
        if path.startswith(_LEFT_OUT):
            continue
        kinds = {name.partition(":")[0] for name in chunk.to_record_batch().schema.names if ":" in name}
        shade = colour(BASELINE)
        for kind in kinds & _PAINTED.keys():
            painted[str(chunk.entity_path)] = _PAINTED[kind].from_fields(colors=shade)
        if "Mesh3D" in kinds:
            painted[str(chunk.entity_path)] = rr.Mesh3D.from_fields(albedo_factor=BASELINE)
    return _spatial("One over the other: the baseline is orange", "/", contents, eye, painted)


def _spatial(
    name: str, origin: str, contents: list[str], eye: Eye | None, overrides: dict[str, Any]
) -> rrb.Spatial3DView:
    look: dict[str, Any] = {}
    if eye is not None:
        look = {"eye_controls": rrb.EyeControls3D(position=eye[0], look_target=eye[1], eye_up=(0.0, 0.0, 1.0))}
    return rrb.Spatial3DView(
        origin=origin,
        contents=contents,
        name=name,
        background=np.array([BACKGROUND], dtype=np.uint32),
        line_grid=False,
        overrides=overrides,
        **look,
    )


def _plot(title: str, channels: Sequence[str], *, less: bool = False) -> rrb.TimeSeriesView:
    paths = [series(c).path for c in channels]
    contents = [f"+ /difference/{p}" for p in paths] if less else [f"+ /{p}/**" for p in paths]
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=f"{title}: candidate less baseline" if less else title,
        axis_x=rrb.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        plot_legend=rrb.PlotLegend("LeftTop"),
    )
