"""Where a drop leaves the law of Ye (2006): its K', eq (3), never rises with depth, so that a rise is another soil.

A hard layer, a plate, a stone: the striker meets what the soil above does not tell of.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ground.drops import Loading, UnusableDrop, stiffness

Array = NDArray[np.float64]
SURE = 5.0  # sd of a difference: 60 depths make 1770 pairs, and chance passes it in 1 of 2000 drops (1770 x 2.9e-7)
LEAST = 1.28  # times: R = 0.923 leaves sqrt(1 - R^2) 0.65 = 0.25 of ln K', whose sd along a drop is 0.65, to one soil
KNOWN = 0.2  # sd over K' beyond which F/z so close to the surface is no number


@dataclass(frozen=True, kw_only=True)
class Rise:
    """From which depth to which (m) K' rises, from which value to which (N/m)."""

    above: float
    below: float
    soft: float
    hard: float

    @property
    def cut(self) -> float:
        """Depth that ends above the rise, m, to three digits downwards."""
        unit = 10.0 ** (math.floor(math.log10(self.above)) - 2)
        return math.floor(self.above / unit) * unit

    @property
    def sentence(self) -> str:
        """What it is, where, and what takes the rows above it."""
        return (
            f"K' rises from {self.soft:.0f} to {self.hard:.0f} N/m between {self.above:.3g} and {self.below:.3g} m, "
            f"where the law has it fall: a harder layer; to-depth {self.cut:.3g} takes the rows above it alone"
        )


def rise(load: Loading) -> Rise | None:
    """The surest rise of K' that is beyond noise and the scatter of a soil; None where it falls, as in the law."""
    z, K, sd = stiffness(load)
    use = (sd < KNOWN * np.abs(K)) & (K > 0.0)
    z, K, sd = z[use], K[use], sd[use]
    # sd holds what all depths of a drop share, which no difference has: too wide rather than too narrow
    sure = (K[None, :] - K[:, None]) / np.hypot(sd[None, :], sd[:, None])
    times = K[None, :] / K[:, None]
    found = np.triu((sure > SURE) & (times > LEAST), 1)
    if not found.any():
        return None
    i, j = np.unravel_index(int(np.argmax(np.where(found, sure, 0.0))), times.shape)
    return Rise(above=float(z[i]), below=float(z[j]), soft=float(K[i]), hard=float(K[j]))


def check_one_soil(load: Loading) -> None:
    """Refuse a drop that leaves the law on its way down. Raises `UnusableDrop`."""
    found = rise(load)
    if found is not None:
        raise UnusableDrop(f"{load.drop.name}: {found.sentence}")
