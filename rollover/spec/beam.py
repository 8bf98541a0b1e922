"""A member of a frame that is given by its section and steel: what it weighs, carries and shows to the ground."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground.quantity import Label, Quantity, parameters
from rollover.spec.inertia import MassProperties
from rollover.spec.sections import Section
from rollover.spec.shapes import Point, Tube
from rollover.spec.steel import Steel

Array = NDArray[np.float64]
ALONG = 0.9  # cosine to the vehicle's length beyond which a member runs along it: its depth is upright then


@parameters
class Beam:
    """A straight member with a section and a steel; what touches the ground is a tube as wide as the section's mean."""

    kind: Literal["beam"] = "beam"
    name: Annotated[str, Label()]
    start: Annotated[Point, Quantity("m", "of its axis")]
    end: Annotated[Point, Quantity("m", "of its axis")]
    section: Section
    material: Annotated[Steel, "S235, S275, S355, S420, S460, or numbers of your own"]
    depth_towards: Annotated[
        Point | None,
        Quantity("1", "direction of the section's depth h, vehicle axes; null: along x, of members along x along z"),
    ] = None

    def validate(self) -> None:
        """Refuse a member without length, and a depth along the member itself."""
        if self.start == self.end:
            raise ValueError(f"end: same as start, got {list(self.end)}; another point")
        if self.depth_towards is not None:
            size = math.hypot(*self.depth_towards)
            if size == 0.0 or abs(float(self._axis @ np.array(self.depth_towards))) > (1.0 - 1e-6) * size:
                got = list(self.depth_towards)
                raise ValueError(f"depth_towards: no direction across the member, got {got}; one across its axis")

    @property
    def _axis(self) -> Array:
        way = np.array(self.end) - np.array(self.start)
        return np.asarray(way / np.linalg.norm(way))

    @property
    def length(self) -> float:
        """Of its axis, m."""
        return math.dist(self.start, self.end)

    @property
    def axes(self) -> Array:
        """Rows: along the member, along its depth, along its width; vehicle axes, (3, 3)."""
        along = self._axis
        wanted = self.depth_towards or ((0.0, 0.0, 1.0) if abs(along[0]) > ALONG else (1.0, 0.0, 0.0))
        depth = np.array(wanted) - along * float(along @ np.array(wanted))
        depth /= np.linalg.norm(depth)
        return np.array([along, depth, np.cross(along, depth)])

    @property
    def tube(self) -> Tube:
        """What of it can touch the ground: a tube about its axis, the mean of width and depth across."""
        across = 0.5 * (self.section.width + self.section.depth)
        return Tube(name=self.name, start=self.start, end=self.end, diameter=across)

    @property
    def body(self) -> MassProperties:
        """Mass properties of the straight bar: m = rho A L, m L^2/12 across, rho L (I_h + I_b) along its axis."""
        p, rho, length = self.section.properties, self.material.density, self.length
        mass = rho * p.area * length
        spread = rho * length * np.array([p.second_h + p.second_b, p.second_b, p.second_h])
        own = np.diag(spread + mass * length**2 / 12.0 * np.array([0.0, 1.0, 1.0]))
        J = self.axes.T @ own @ self.axes
        middle = 0.5 * (np.array(self.start) + np.array(self.end))
        return MassProperties(
            mass=mass,
            centre_of_mass=(float(middle[0]), float(middle[1]), float(middle[2])),
            inertia=(float(J[0, 0]), float(J[1, 1]), float(J[2, 2])),
            products=(float(J[0, 1]), float(J[0, 2]), float(J[1, 2])),
        )

    @property
    def plastic_resistance(self) -> tuple[float, float, float, float]:
        """N_pl (N), M_pl along depth and width, T_pl (N m): A f_y, W_pl f_y, W_t f_y/sqrt(3)."""
        p, fy = self.section.properties, self.material.yield_strength
        return p.area * fy, p.plastic_h * fy, p.plastic_b * fy, p.plastic_torsion * fy / math.sqrt(3.0)

    @property
    def classes(self) -> dict[str, int]:
        """Local buckling, EN 1993-1-1 table 5.2: see `Section.wall_class`."""
        return self.section.wall_class(self.material.yield_strength)
