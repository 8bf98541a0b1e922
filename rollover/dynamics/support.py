"""Closed forms of static stability: the slope on which a rigid vehicle turns over the edges of its support.

Tyres do not give way. They bear at their outer edges or in their middle: real ones lie between, nearer to the middle
the rounder and softer they are. The support is that of all wheels (rigid, or the front axle at its stop), or on a free
pivot the triangle of the rear wheels and the pivot, which carries the chassis without the axle's own weight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rollover.spec.inertia import combined
from rollover.spec.vehicle import Vehicle, alone, carried, laden

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ClosedForm:
    """Slopes (rad) for one heading: where the balance on the free pivot ends, and that with the axle at its stop.

    `free_pivot` is None without a front axle; `rigid` does not know the swing up to the stop.
    """

    free_pivot: float | None
    rigid: float


def closed_form(vehicle: Vehicle, heading: float, *, outer: bool = True) -> ClosedForm:
    """Slopes for a heading (rad), with tyres that bear at their outer edges or in their middle.

    Across the slope tan b = s (1 - a/L)/(h - h_p a/L) on the pivot and [s_r (1 - a/L) + s_f a/L]/h at the stop, with a
    and h of the mass that each carries: of the vehicle without its front axle, and of the whole. Without a trailer.
    """
    vehicle = alone(vehicle)
    feet = {w.name: _foot(w.centre, w.tyre.width if outer else 0.0) for w in vehicle.wheels}
    rigid = turning_slope(list(feet.values()), np.array(laden(vehicle).centre_of_mass), heading)
    if vehicle.front_axle is None:
        return ClosedForm(free_pivot=None, rigid=rigid)
    chassis = combined([laden(vehicle)], less=[carried(vehicle, "front_axle")])
    pivot = np.array(vehicle.front_axle.pivot)
    points = [feet[w.name] for w in vehicle.wheels if w.carrier == "chassis"] + [pivot]
    # over the rear wheels the axle comes along: that is the rigid vehicle's edge
    free = turning_slope(points, np.array(chassis.centre_of_mass), heading, through=pivot)
    return ClosedForm(free_pivot=min(free, rigid), rigid=rigid)


def _foot(centre: tuple[float, float, float], width: float) -> Array:
    """Where a wheel stands, vehicle axes."""
    return np.array([centre[0], centre[1] + math.copysign(0.5 * width, centre[1]), 0.0])


def turning_slope(points: Sequence[Array], centre: Array, heading: float, through: Array | None = None) -> float:
    """tan b = (r x e) . z/(r x e) . d, the least over the edges e of the support: the slope (rad) to turn over one.

    `points` (3,) support the body, `centre` is its centre of mass, vehicle axes; r points to it from the edge. The
    body turns when the weight sin b d - cos b z, d downhill, has no moment about the edge any more. pi/2 if never. Of
    all edges, or of those `through` one of the points.
    """
    d = np.array([-math.cos(heading), math.sin(heading), 0.0])
    least = 0.5 * math.pi
    ring = _ring(points)
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        if through is not None and a is not through and b is not through:
            continue
        turn = np.cross(centre - a, b - a)  # upward for a centre inside, the ring being clockwise
        if turn[2] <= 0.0:
            return 0.0
        if turn @ d > 1e-12 * turn[2]:
            least = min(least, math.atan(float(turn[2] / (turn @ d))))
    return least


def _ring(points: Sequence[Array]) -> list[Array]:
    """Convex hull of the points seen from above, clockwise (Andrew's monotone chain)."""
    ordered = sorted(points, key=lambda p: (p[0], p[1]))

    def chain(along: list[Array]) -> list[Array]:
        found: list[Array] = []
        for p in along:
            while len(found) > 1 and np.cross(found[-1] - found[-2], p - found[-1])[2] >= 0.0:
                found.pop()
            found.append(p)
        return found[:-1]

    return chain(ordered) + chain(ordered[::-1])
