"""The same attitude written otherwise, as instruments and their software do: wrapped, signs turned, other branches."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rollover.recording import Recording
from rollover.recording.attitude import ANGLES, QUATERNION

TURN = 2.0 * math.pi


def within_half_a_turn(r: Recording) -> Recording:
    """Angles from -180 to 180 degrees."""
    return _angles(r, lambda v: (v + math.pi) % TURN - math.pi)


def within_a_turn(r: Recording) -> Recording:
    """Angles from 0 to 360 degrees."""
    return _angles(r, lambda v: v % TURN)


def by_its_negative(r: Recording) -> Recording:
    """-q for q."""
    return _quaternion(r, np.full(r.time.size, -1.0))


def by_either_sign(r: Recording) -> Recording:
    """q or -q, by chance for each sample."""
    return _quaternion(r, np.random.default_rng(1).choice([-1.0, 1.0], r.time.size))


def by_the_other_branch(r: Recording) -> Recording:
    """Roll + 180, 180 - pitch, yaw + 180 degrees throughout."""
    return _other(r, np.ones(r.time.size, dtype=bool))


def by_either_branch(r: Recording) -> Recording:
    """One of both, by chance for each sample, from -180 to 180 degrees."""
    return within_half_a_turn(_other(r, np.random.default_rng(2).random(r.time.size) < 0.5))


OTHERWISE: tuple[Callable[[Recording], Recording], ...] = (
    within_half_a_turn,
    within_a_turn,
    by_its_negative,
    by_either_sign,
    by_the_other_branch,
    by_either_branch,
)


def _angles(r: Recording, of: Callable[[np.ndarray], np.ndarray]) -> Recording:
    return replace(r, channels={n: of(v) if n in ANGLES else v for n, v in r.channels.items()})


def _quaternion(r: Recording, sign: np.ndarray) -> Recording:
    return replace(r, channels={n: sign * v if n in QUATERNION else v for n, v in r.channels.items()})


def _other(r: Recording, where: np.ndarray) -> Recording:
    roll, pitch, yaw = ANGLES
    made = {roll: lambda v: v + math.pi, pitch: lambda v: math.pi - v, yaw: lambda v: v + math.pi}
    return replace(r, channels={n: np.where(where, made[n](v), v) if n in made else v for n, v in r.channels.items()})
