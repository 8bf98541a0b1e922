"""What the array relies on in a compiled force, asked of one that nobody has tested: a sentence where it fails."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ground.law import HIDDEN, GroundLaw, touched

# what the loading curve is asked over: touches, overturns and beyond both
SPEEDS = (0.3, 2.0, 6.0)  # m/s
DEPTHS = (1e-9, 1e-4, 0.01, 0.1, 0.5)  # m
RATES = (0.0, 0.01, 1.0, 6.0)  # m/s
GUARD = 64  # places behind the numbers and the memory; what is read there is no number


def broken_by_law(law: GroundLaw) -> str:
    """What a law does that its array cannot live with; nothing if it is well."""
    for speed in SPEEDS:
        try:
            memory = touched(law, speed=speed)
        except Exception as e:
            return f"begin(p, s) fails at a touch with {speed:g} m/s: {e}"
        if wrong := _broken(law.force, law.p, memory, f"at an impact speed of {speed:g} m/s", least=0.0):
            return wrong
    return ""


def broken_by_term(force: Any, p: Sequence[float], *, is_null: bool) -> str:
    """What a force on top of the loading curve does that it must not; `is_null`: it must be nothing anywhere."""
    memory = np.zeros(HIDDEN)
    memory[:] = (2.0, 100.0, math.inf)
    least, most = (0.0, 0.0) if is_null else (-math.inf, math.inf)
    return _broken(force, np.array(p, dtype=float), memory, "at the null" if is_null else "", least=least, most=most)


def _broken(
    force: Any, p: NDArray[np.float64], s: NDArray[np.float64], when: str, *, least: float, most: float = math.inf
) -> str:
    own_p, own_s = (np.concatenate([own, np.full(GUARD, math.nan)]) for own in (p, s))
    before = own_p.tobytes(), own_s.tobytes()
    at = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (own_p, own_s)]
    for z, v in [(0.0, 0.0), *((z, v) for z in DEPTHS for v in RATES)]:
        value = float(force.ctypes(*at, z, v))
        place = " ".join(filter(None, (f"at z = {z:g} m, v = {v:g} m/s", when)))
        if not math.isfinite(value):
            held = f"p has {p.size} numbers, s has {s.size}"
            return f"force is not finite {place}, got {value}; a finite one of numbers that it has ({held}) is needed"
        if z == 0.0 and value != 0.0:
            return f"force without any sinkage, got {value:g} N {place}; F = 0 at z = 0 is needed"
        if not least <= value <= most:
            asked = "no force" if most == 0.0 else "a force of at least 0 (the ground does not pull)"
            return f"force {value:g} N {place}; {asked} is needed"
    if (own_p.tobytes(), own_s.tobytes()) != before:
        return "force writes to p or s; it may only read, it is asked several times within a step"
    return ""
