"""How a vehicle went: its outline and structure at a few instants, side by side as they stood, from behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ground.surface import height
from rollover.dynamics.result import Run
from rollover.spec.frames import from_quaternions
from rollover.spec.shapes import Box, Tube
from rollover.spec.vehicle import Vehicle
from viz.content.blocks import Block, Figure, Section
from viz.figures import plots
from viz.figures.plots import Outline, View

Array = NDArray[np.float64]
INSTANTS = 6
STILL = 0.3  # m, of way of the centre of mass below which there is none to show


def way_section(run: Run) -> list[Block]:
    """The strip of a run in which a vehicle moves; nothing for a striker, a test stand and a failed run."""
    vehicle = run.scenario.vehicle
    if run.tests or not isinstance(vehicle, Vehicle) or "chassis" not in run.motion or run.status != "done":
        return []
    origin = run.motion["chassis"].origin
    across = int(np.argmax(np.ptp(origin[:, :2], axis=0)))
    if float(np.linalg.norm(np.ptp(origin, axis=0))) < STILL:
        return []
    at = _instants(origin)
    shapes: list[Outline] = []
    for n, k in enumerate(at):
        for body, lines in _bodies(run, vehicle).items():
            R = from_quaternions(run.motion[body].quaternion[k : k + 1])[0]
            role: plots.Role = "muted" if body == "chassis" else plots.CYCLE[n % 4]
            for points in lines:
                flat = (points @ R.T + run.motion[body].origin[k])[:, [across, 2]]
                is_hull = len(points) > 2
                shapes.append(Outline(name="", points=_hull(flat) if is_hull else flat, closed=is_hull, role=role))
    seen = np.vstack([shape.points for shape in shapes])
    x = np.linspace(seen[:, 0].min() - 0.5, seen[:, 0].max() + 0.5, 200)
    middle = float(np.mean(origin[at, 1 - across]))
    rest = np.full(x.size, middle)
    z = height(run.scenario.ground.surface, *((x, rest) if across == 0 else (rest, x)))
    shapes.append(Outline(name="", points=np.column_stack([x, z]), role="second", closed=False))
    svg = plots.outlines([View(title="", across=f"world {'xy'[across]}, m", up="world z, m", shapes=shapes)])
    stamps = ", ".join(f"{run.frame_time[k]:.2f}" for k in at)
    caption = f"At {stamps} s: hull of the vehicle's outline (grey), its ROPS (a colour each), the undisturbed ground."
    return [Section(title="How it went", blocks=[Figure(svg=svg, caption=caption)])]


def _instants(origin: Array) -> list[int]:
    """Frames a like way apart, the first and the last among them."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(origin, axis=0), axis=1))])
    return sorted({min(int(np.searchsorted(way, w)), way.size - 1) for w in np.linspace(0.0, way[-1], INSTANTS)})


def _bodies(run: Run, vehicle: Vehicle) -> dict[str, list[Array]]:
    """Points (k, 3) of each body in its own axes: corners of all boxes, whose hull is drawn, and axes of tubes."""
    boxes = [_corners(shape) for shape in vehicle.outline if isinstance(shape, Box)]
    found = {"chassis": [np.vstack(boxes)] if boxes else []}
    if vehicle.rops is not None and "rops" in run.motion:
        members = [m for m in vehicle.rops.parts["rops"][1] if isinstance(m, Tube)]
        found["rops"] = [np.array([m.start, m.end]) for m in members]
    return found


def _corners(box: Box) -> Array:
    ends = np.array([box.low, box.high])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def _hull(points: Array) -> Array:
    """Convex hull (k, 2) of points in a plane."""
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).vertices])
