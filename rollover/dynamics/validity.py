"""Domain flags: what a ground law's numbers do not cover, by name, and those that are told row by row of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ground.kernel import ROW, SINKAGE
from ground.law import GroundLaw
from rollover.kernels import tables as c
from rollover.kernels.tables import Tables

UNCALIBRATED, DEEP = 1 << 16, 1 << 17  # bits beyond those of the kernels
FLAG_NAMES = {**c.FLAG_NAMES, UNCALIBRATED: "uncalibrated", DEEP: "deep-sinkage"}


class Told:
    """Flags of the elements in contact that follow from their laws alone: nothing measured behind it, or too deep."""

    def __init__(self, laws: Sequence[GroundLaw]) -> None:
        domains = [law.domain for law in laws]
        self.uncalibrated = np.array([not domain.calibrated for domain in domains])
        self.deepest = np.array([domain.sinkage_most for domain in domains])
        self.any = bool(self.uncalibrated.any() or np.isfinite(self.deepest).any())

    def now(self, t: Tables) -> int:
        """Bits of `FLAG_NAMES` for the contacts of this moment."""
        count = int(t.counts[c.ACTIVE])
        if not self.any or not count:
            return 0
        slots = t.active[:count]
        row, depth = t.state[slots, ROW], t.memory[slots, SINKAGE]
        flags = UNCALIBRATED if self.uncalibrated[row].any() else 0
        return flags | (DEEP if (depth > self.deepest[row]).any() else 0)


def flag_names(flags: int) -> tuple[str, ...]:
    """Names of the domain flags in a bit field."""
    return tuple(name for bit, name in FLAG_NAMES.items() if flags & bit)
