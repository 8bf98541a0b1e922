"""The scene in space, into a recording stream: soil, bodies, ground forces, what happened where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rollover.dynamics.result import Event, Run
from rollover.spec.vehicle import Striker
from viz.content.entities import FILTERED, FOLLOWED, LIMIT, force_colour, force_path
from viz.content.verdict import Peak, newtons, raw
from viz.recordings.edges import EDGE, GRID, edges
from viz.recordings.scene import extent, parts, path_of_centre
from viz.recordings.solids import Balls, Block, Hull, Part, Rod, Wire, body_path
from viz.recordings.stream import Stream, colour, stamps
from viz.recordings.terrain import Terrain, corner, cut_open, frames, nice, terrain, thinned

WARNINGS = ("axle-stop", "plastic-hinge")
_TOUCHED = "world/ground/touched"
_MOST_MARKS = 200  # of events
_LABEL_TIME, _LABEL_SHARE = 0.3, 0.1  # s that an event's label stands, and the most of the run


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What a run's scene is drawn with.

    Mesh of the ground, m of sinkage from which the soil is brightest, N for 1 m of arrow, a length by which arrows
    and marks are sized, m, and lines where the ground breaks, (k, 3) each.
    """

    ground: Terrain
    soil: float
    force: float
    size: float
    edges: Sequence[NDArray[np.float64]] = ()

    @property
    def scales(self) -> tuple[str, ...]:
        """What the reader must know to read lengths and colours."""
        return (
            f"arrows 1 m = {1e-3 * self.force:g} kN",
            f"soil yellow from {1e3 * self.soil:g} mm",
            f"grid {self.ground.grid_step:g} m",
        )


LABELLED = ("rops", "rops_upper", "chassis", "trailer", "striker", "device", "weight")


def picture(run: Run) -> Picture:
    """Choose the scales of a run's scene from what happened in it."""
    (x, y, _), radius = extent(run)
    deepest = float(run.track.sinkage.max(initial=0.0))
    left = run.track.sinkage.max(axis=0, initial=0.0)
    # one deep hole must not make all other ruts look alike
    soil = nice(float(np.quantile(left[left > 0.0], 0.8))) if deepest > 0.0 else 0.01
    elements, touched = run.scenario.ground.elements, run.track.element
    reach = 1.2 * radius
    outer = (x - reach, x + reach, y - reach, y + reach)
    if isinstance(run.scenario.vehicle, Striker):
        elements, touched = cut_open(elements, touched)
        outer = (*outer[:2], corner(elements)[1], outer[3])
    highest = {body: float(np.linalg.norm(c.force, axis=1).max(initial=0.0)) for body, c in run.contact.items()}
    # the arrow at a striker stands inside the nose
    longest = 0.3 * radius if isinstance(run.scenario.vehicle, Striker) else 1.3 * extent(run, at=0)[1]
    # the load that is asked for sets the scale, unless others would reach out of the picture
    rops = max(highest.get("rops", 0.0), highest.get("rops_upper", 0.0))
    per_metre = max(rops, 0.7 * max(highest.values(), default=0.0)) / longest
    ground = terrain(
        run.scenario.ground.surface,
        elements,
        touched,
        outer=outer,
        grid_step=nice(radius / 8.0),
        thickness=max(1.2 * deepest, 0.05 * radius),
    )
    return Picture(
        ground=ground,
        soil=soil,
        force=nice(per_metre) if per_metre > 0.0 else 1e3,
        size=float(np.clip(radius, 0.3, 3.0)),
        edges=edges(run.scenario.ground.surface, ground.outer, elements.spacing),
    )


def standing(out: Stream, run: Run, with_: Picture) -> None:
    """Write everything in the scene that keeps its shape."""
    out.static("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    ground = with_.ground
    if len(ground.fixed_triangles):
        mesh = rr.Mesh3D(
            vertex_positions=ground.fixed,
            triangle_indices=ground.fixed_triangles,
            vertex_colors=ground.fixed_colours,
        )
        out.static("world/ground/untouched", mesh)
    if len(ground.grid):
        lines = rr.LineStrips3D(ground.grid, colors=colour(GRID), radii=[rr.Radius.ui_points(0.8)])
        out.static("world/ground/grid", lines)
    if with_.edges:
        lines = rr.LineStrips3D(with_.edges, colors=colour(EDGE), radii=[rr.Radius.ui_points(1.5)])
        out.static("world/ground/edges", lines)
    for patch in ground.patches:
        out.static(f"{_TOUCHED}/{patch.name}", rr.Mesh3D.from_fields(triangle_indices=patch.triangles))
    for part in parts(run):
        out.static(part.path, _drawn(part))
    for body in run.contact:
        look = rr.Arrows3D.from_fields(colors=colour(force_colour(body)), radii=[0.02 * with_.size])
        out.static(force_path(with_.force, body), look)


def moving(out: Stream, run: Run, with_: Picture) -> None:
    """Write everything in the scene that changes; to be settled before."""
    _ground(out, run, with_)
    for body, motion in run.motion.items():
        pose = rr.Transform3D.columns(translation=motion.origin, quaternion=motion.quaternion)
        out.columns(body_path(body), run.frame_time, pose)
    centre = path_of_centre(run)
    if len(centre):
        out.columns(FOLLOWED, run.frame_time, rr.Transform3D.columns(translation=centre))
    _forces(out, run, with_.force)
    _marks(out, run, with_.size)


def _drawn(part: Part) -> Any:
    fill = rr.components.FillMode
    if isinstance(part, Block):
        return rr.Boxes3D(
            centers=[part.centre],
            sizes=[part.size],
            colors=colour(part.colour),
            fill_mode=fill.TransparentFillMajorWireframe if part.see_through else fill.Solid,
        )
    if isinstance(part, Rod):
        a, b = np.array(part.start), np.array(part.end)
        length = float(np.linalg.norm(b - a))
        return rr.Cylinders3D(
            lengths=[length],
            radii=[part.radius],
            centers=[0.5 * (a + b)],
            quaternions=[upright_to((b - a) / length)],
            colors=colour(part.colour),
            fill_mode=fill.Solid,
        )
    if isinstance(part, Balls):
        return rr.Ellipsoids3D(centers=part.centres, radii=part.radii, colors=colour(part.colour), fill_mode=fill.Solid)
    if isinstance(part, Hull):
        return rr.Mesh3D(
            vertex_positions=part.vertices,
            vertex_normals=part.normals,
            vertex_colors=part.colours,
            triangle_indices=part.triangles,
        )
    assert isinstance(part, Wire)
    return rr.LineStrips3D(part.strips, colors=colour(part.colour), radii=[part.radius])


def upright_to(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion x, y, z, w that turns z into a unit direction."""
    if direction[2] < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    q = np.array([-direction[1], direction[0], 0.0, 1.0 + direction[2]])
    return np.asarray(q / np.linalg.norm(q))


def _ground(out: Stream, run: Run, with_: Picture) -> None:
    track, patches = run.track, with_.ground.patches
    start = min([*run.frame_time[:1], *run.recording.time[:1], *track.time[:1]])
    for patch, kept in zip(patches, thinned([frames(track, p) for p in patches], patches), strict=True):
        rows, time = track.sinkage[kept], track.time[kept]
        if not time.size or time[0] > start:  # before the first touch the ground is there, and flat
            rows = np.concatenate([np.zeros((1, track.element.size)), rows])
            time = np.concatenate([[start], time])
        mesh = rr.Mesh3D.columns(
            vertex_positions=np.concatenate([patch.positions(row) for row in rows]),
            vertex_colors=np.concatenate([patch.colours(row, with_.soil) for row in rows]),
        )
        out.columns(f"{_TOUCHED}/{patch.name}", time, mesh.partition(np.full(len(rows), len(patch.base))))


def _forces(out: Stream, run: Run, scale: float) -> None:
    for body, contact in run.contact.items():
        size = np.linalg.norm(contact.force, axis=1)
        there = size > 0.0
        name = {"device": "test stand"}.get(body, body.replace("_", " ").replace("rops", "ROPS"))
        arrows = rr.Arrows3D.columns(
            origins=contact.point[there],
            vectors=contact.force[there] / scale,
            labels=[f"{name} {newtons(f)}" for f in size[there]],
            # wheels carry their load all the time: labels on them would hide the others
            show_labels=np.full(int(there.sum()), body in LABELLED),
        )
        # a time without force has a row without arrow, or the last one would stand for ever
        out.columns(force_path(scale, body), run.frame_time, arrows.partition(there.astype(np.int64)))


def peak_place(out: Stream, run: Run, peak: Peak, size: float) -> None:
    """Mark in the scene where the load acted at its peak, from then on."""
    names = ("striker",) if isinstance(run.scenario.vehicle, Striker) else ("rops", "rops_upper")
    sizes = {name: np.linalg.norm(run.contact[name].force, axis=1) for name in names if name in run.contact}
    loaded = np.flatnonzero(sum(sizes.values(), start=np.zeros(len(run.frame_time))) > 0.0)
    if not loaded.size:
        return
    nearest = loaded[int(np.argmin(np.abs(run.frame_time[loaded] - peak.raw_time)))]
    contact = run.contact[max(sizes, key=lambda name: float(sizes[name][nearest]))]
    # the mark stays; its label would stand in the way of those of the forces that act there later
    time = np.array([peak.raw_time, peak.raw_time + _stands(run)])
    time = time[: 2 if time[1] < run.stop_time else 1]
    point = rr.Points3D.columns(
        positions=contact.point[[nearest] * len(time)],
        radii=np.full(len(time), 0.025 * size),
        colors=colour(*[LIMIT] * len(time)),
        labels=[f"peak {raw(peak)}"] * len(time),
        show_labels=[True, False][: len(time)],
    )
    out.columns("world/peak", time, point)


def _stands(run: Run) -> float:
    """How long a label stands, s."""
    return min(_LABEL_TIME, _LABEL_SHARE * float(np.ptp(run.recording.time)))


def sentence(event: Event) -> str:
    """An event in words."""
    subject = event.subject.replace("_", " ").replace("rops", "ROPS")
    detail = f": {event.detail}" if event.detail else ""
    return f"{event.kind.replace('-', ' ')}, {subject}{detail}"


def _marks(out: Stream, run: Run, size: float) -> None:
    """Points where something happened, from then on; their labels for a moment only."""
    events = sorted(run.events, key=lambda e: e.time)[:_MOST_MARKS]
    groups = [list(g) for _, g in groupby(events, key=lambda e: stamps(np.array([e.time])).astype(np.int64).item())]
    if not groups:
        return
    time = np.array([g[0].time for g in groups])
    counts = np.cumsum([len(g) for g in groups])
    radius = 0.012 * size
    places = np.array([e.place for e in events])
    shades = colour(*(LIMIT if e.kind in WARNINGS else FILTERED for e in events))
    marks = rr.Points3D.columns(
        positions=np.concatenate([places[:n] for n in counts]),
        colors=np.concatenate([shades[:n] for n in counts]),
        radii=np.full(int(counts.sum()), radius),
    )
    out.columns("world/events/marks", time, marks.partition(counts))
    stands = _stands(run)
    rows: list[tuple[float, Sequence[Event]]] = [(g[0].time, g) for g in groups]
    # an empty row when a label's time is over; not after the end, which would make the time line longer than the run
    ends = zip(time.tolist(), [*time[1:].tolist(), run.stop_time], strict=True)
    rows += [(t + stands, ()) for t, following in ends if t + stands < following]
    rows.sort(key=lambda row: row[0])
    labelled = [e for _, group in rows for e in group]
    labels = rr.Points3D.columns(
        # a little below: an arrow's label stands above, the peak's in between, and soil does not hide labels
        positions=np.array([e.place for e in labelled]) - np.array([0.0, 0.0, 0.2 * size]),
        radii=np.full(len(labelled), 0.1 * radius),
        colors=np.full(len(labelled), FILTERED, dtype=np.uint32),
        labels=[sentence(e) for e in labelled],
        show_labels=np.full(len(labelled), True),
    )
    out.columns("world/events/label", np.array([t for t, _ in rows]), labels.partition([len(g) for _, g in rows]))
