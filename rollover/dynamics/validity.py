"""Domain flags: what a ground law's numbers do not cover, by name, and those that are told row by row of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ground.law import GroundLaw
from rollover.kernels import tables as c

FLAG_NAMES = {**c.FLAG_NAMES, c.UNCALIBRATED: "uncalibrated", c.DEEP: "deep-sinkage"}


def calibrated_by_laws(laws: Sequence[GroundLaw]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Of each law (nr,) whether nothing measured stands behind it, and how deep what was measured went, m."""
    domains = [law.domain for law in laws]
    return np.array([not domain.calibrated for domain in domains]), np.array([float(d.sinkage_most) for d in domains])


def flag_names(flags: int) -> tuple[str, ...]:
    """Names of the domain flags in a bit field."""
    return tuple(name for bit, name in FLAG_NAMES.items() if flags & bit)
