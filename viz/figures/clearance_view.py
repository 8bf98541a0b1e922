"""The clearance zone, the structure and the ground from the front and the side, at the instant that mattered most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ground.surface import height
from rollover.assessment.clearance import Approach
from rollover.dynamics.result import Run
from rollover.spec.frames import from_quaternions
from rollover.spec.shapes import Box, Points, Shape, Tube
from rollover.spec.vehicle import Vehicle
from viz.content.blocks import Figure
from viz.figures import plots
from viz.figures.plots import Outline, View

Array = NDArray[np.float64]
FRONT, SIDE = (1, 2), (0, 2)  # the vehicle axes that a view shows, across and up


def clearance_figure(run: Run, found: Sequence[Approach]) -> Figure | None:
    """Both views in vehicle axes when structure or ground came nearest; None for a vehicle without a zone."""
    vehicle = run.scenario.vehicle
    if not found or not isinstance(vehicle, Vehicle) or vehicle.rops is None or vehicle.rops.clearance_zone is None:
        return None
    nearest = min(found, key=lambda a: a.least)
    k = int(np.argmin(np.abs(run.recording.time - nearest.time)))
    chassis, rops = run.pose["chassis"], run.pose["rops"]
    R, S = (from_quaternions(m.quaternion[k : k + 1])[0] for m in (chassis, rops))
    turn, shift = R.T @ S, R.T @ (rops.origin[k] - chassis.origin[k])
    ring = vehicle.rops.clearance_zone.corners()
    normal, distance = _ground(run, R, chassis.origin[k])
    views = []
    for title, axes, across in (("from behind", FRONT, "to the right, m"), ("from the right", SIDE, "forward, m")):
        flip = np.array([-1.0, 1.0]) if axes == FRONT else np.ones(2)
        shapes = [
            Outline(name="vehicle", points=flip * _edges(shape)[:, axes], role="muted")
            for shape in vehicle.outline
            if isinstance(shape, Box)
        ]
        for member in vehicle.rops.parts["rops"][1]:
            line = _edges(member)
            moved = line @ turn.T + shift
            shapes += [
                Outline(
                    name="structure, at rest", points=flip * line[:, axes], role="muted", closed=False, dashed=True
                ),
                Outline(name="structure", points=flip * moved[:, axes], role="first", closed=False),
            ]
        zone = ring[:6] if axes == FRONT else _box_of(ring)
        shapes.append(Outline(name="clearance zone", points=flip * zone[:, axes], role="third", filled=True))
        if (cut := _line(normal[list(axes)], distance, ring.mean(axis=0), axes, normal)) is not None:
            shapes.append(Outline(name="ground", points=flip * cut, role="second", closed=False))
        views.append(View(title=title, across=across, up="up, m", shapes=shapes))
    texts = []
    for a in found:
        of = f"the structure ({a.nearest})" if a.what == "structure" else "the undisturbed ground"
        inside = f", inside from {a.first_intrusion:.3f} s on" if a.first_intrusion is not None else ""
        texts.append(f"{of} came within {1e3 * a.least:.0f} mm at {a.time:.3f} s{inside}")
    caption = (
        f"Clearance zone at {nearest.time:.3f} s, in vehicle axes: {'; '.join(texts)}. Negative is inside. "
        "The ground is the undisturbed surface, cut through the middle of the zone."
    )
    return Figure(svg=plots.outlines(views), caption=caption)


def _edges(shape: Shape) -> Array:
    """Points (k, 3) whose outline in a view is that of a shape: a tube's axis, a box's diagonal rectangle."""
    if isinstance(shape, Tube):
        return np.array([shape.start, shape.end])
    if isinstance(shape, Box):
        return _box_of(np.array([shape.low, shape.high]))
    if isinstance(shape, Points):
        return _box_of(np.array(shape.at))
    return np.array([shape.centre])


def _box_of(points: Array) -> Array:
    """Four corners that make the bounding rectangle both across x and across y."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([[low[0], low[1], low[2]], [high[0], high[1], low[2]], high, [low[0], low[1], high[2]]])


def _ground(run: Run, R: Array, origin: Array) -> tuple[Array, float]:
    """The surface below the vehicle as a plane n . p_V = d in vehicle axes."""
    surface, step = run.scenario.ground.surface, 0.1
    x, y = origin[0] + step * np.array([0.0, 1.0, 0.0]), origin[1] + step * np.array([0.0, 0.0, 1.0])
    z = height(surface, x, y)
    n = np.array([z[0] - z[1], z[0] - z[2], step])
    n /= np.linalg.norm(n)
    at = np.array([origin[0], origin[1], z[0]])
    return R.T @ n, float(n @ (at - origin))


def _line(n: Array, d: float, middle: Array, axes: tuple[int, int], normal: Array) -> Array | None:
    """Segment (2, 2) of the ground in a view, cut through the middle of the zone; None where it lies in the view."""
    size = float(np.linalg.norm(n))
    if size < 0.2:
        return None
    third = 3 - sum(axes)
    rest = d - normal[third] * middle[third]
    p = middle[list(axes)]
    foot = p + (rest - n @ p) * n / size**2
    along = np.array([-n[1], n[0]]) / size
    return np.array([foot - 1.6 * along, foot + 1.6 * along])
