"""The undisturbed surface: height, normal and element frame. World z is up, gravity acts along -z."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from ground.kinds import ByKind
from ground.quantity import Quantity, parameters


@parameters
class Plane:
    """z = 0: level ground."""

    kind: Literal["plane"] = "plane"

    @property
    def gradient(self) -> tuple[float, float]:
        """(dz/dx, dz/dy)."""
        return (0.0, 0.0)


@parameters
class Slope:
    """z = tan(angle) (x cos(d) + y sin(d)): a plane that rises towards the direction d."""

    kind: Literal["slope"] = "slope"
    angle_deg: Annotated[float, Quantity("deg", "inclination", least=-60, most=60)]
    direction_deg: Annotated[
        float, Quantity("deg", "uphill direction about z, 0 along x, 90 along y", least=-360, most=360)
    ] = 90.0

    @property
    def gradient(self) -> tuple[float, float]:
        """(dz/dx, dz/dy)."""
        rise, d = math.tan(math.radians(self.angle_deg)), math.radians(self.direction_deg)
        return (rise * math.cos(d), rise * math.sin(d))


Surface = Annotated[Plane | Slope, ByKind()]


def height(surface: Surface, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of the undisturbed surface at world x, y (m, any shape)."""
    gx, gy = surface.gradient
    return gx * np.asarray(x) + gy * np.asarray(y)


def normal(surface: Surface) -> NDArray[np.float64]:
    """Unit normal, up, in world axes, shape (3,)."""
    gx, gy = surface.gradient
    n = np.array([-gx, -gy, 1.0])
    return np.asarray(n / np.linalg.norm(n))
