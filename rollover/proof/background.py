"""What every real rig adds and no model has: a smooth discrepancy on all drops of a case.

The ground's force is off by a share of itself that wanders smoothly over the way down, in part alike in all drops, in
part in each as it happens; it acts on the striker, so depth, speed and acceleration follow. The frame that load cell
and accelerometer stand on swings after the blow and changes what they read. Nothing of it is there before contact, and
it has no mean over the way down, which would be a stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.proof.campaign import ACCELERATION, FORCE, log_uniform
from rollover.proof.reference_solver import Descent, descend
from rollover.proof.rig import Rig

Array = NDArray[np.float64]
Course = Callable[[float], float]  # of the time over that of the deepest point
DRAWN = "drawn"  # in place of a share: one of its own for each case
SHARES = (0.01, 0.10)  # of the range of the force, within which it is drawn
MOST = 0.8  # share of the ground's force that it never passes, so that the ground presses still
FADES = 0.5  # of the way down, over which it dies out behind the deepest point: what rests does not wander
PLACES = 200  # of each way down, at which its size is taken
CLOSE = 0.005  # of its size, within which it is as asked for
_STREAM = 77  # of random numbers: what else is in a case stays as it is without


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A swing of the frame: sin(2 pi f t) exp(-t/tau) behind the blow, as a share of what a channel reads."""

    frequency: float
    decay: float
    shares: dict[str, float]

    def __call__(self, times: Array, channel: str) -> Array:
        """Share by which a channel reads off at times (n,), s."""
        t = np.maximum(times, 0.0)
        starts = 1.0 - np.exp(-((t * self.frequency) ** 2))
        swing = np.sin(2.0 * math.pi * self.frequency * t) * np.exp(-t / self.decay)
        return np.asarray(self.shares.get(channel, 0.0) * starts * swing)


@dataclass(frozen=True, kw_only=True)
class Background:
    """The discrepancy of one case: a course for each drop, how long its way down lasts (s), and the frame's swing."""

    family: str
    common: float  # share of its power that is alike in all drops
    courses: tuple[Course, ...]
    lasts: tuple[float, ...]
    swing: Frame
    size: float = 0.0
    until: tuple[float, ...] = ()  # s, to which its size is taken: the first of two ways down, with and without it

    def frame(self, times: Array, channel: str) -> Array:
        """Share by which a channel reads off at times (n,), s."""
        return self.size * self.swing(times, channel)

    def about(self, rig: Rig, drop: int) -> Rig:
        """The rig of that drop with it; behind the deepest point it dies out."""
        course, lasts = self.courses[drop], self.lasts[drop]

        def off(t: float) -> float:
            at = max(t, 0.0) / lasts
            fades = math.exp(-(((at - 1.0) / FADES) ** 2)) if at > 1.0 else 1.0
            return MOST * math.tanh(fades * self.size * course(at) / MOST)

        return replace(rig, background=off)

    def summary(self, share: float) -> dict[str, Any]:
        """What the sealed truth says of it."""
        frame = {"frequency": self.swing.frequency, "decay": self.swing.decay}
        return {"share": share, "family": self.family, "common": self.common, "frame": frame}


def drawn_share(seed: int, index: int) -> float:
    """Share of range of a case, even in the logarithm."""
    return log_uniform(np.random.default_rng([seed, index, _STREAM, 1]), *SHARES)


def background(seed: int, index: int, share: float, rigs: Sequence[Rig], plain: Sequence[Descent]) -> Background:
    """The discrepancy of a case, of a size by which force is off by `share` of its range.

    Root mean square over the ways down of all drops, each of the same weight, against `plain` ones of the same `rigs`
    without it, up to where the first of the two turns. Raises ``ValueError`` where no size comes that far.
    """
    return _sized(unsized(seed, index, plain), share, rigs, plain)


def unsized(seed: int, index: int, plain: Sequence[Descent]) -> Background:
    """The courses of a case, each of a root mean square of one, and the frame's swing."""
    random = np.random.default_rng([seed, index, _STREAM])
    family = ("waves", "bumps")[int(random.integers(2))]
    draw = {"waves": _waves, "bumps": _bumps}[family]
    common = float(random.uniform(0.3, 0.7))
    shared = draw(random)
    courses = tuple(_joined(shared, draw(random), common) for _ in plain)
    swing = Frame(
        frequency=float(random.uniform(12.0, 40.0)),
        decay=float(random.uniform(0.05, 0.2)),
        shares={FORCE: float(random.uniform(0.2, 0.8)), ACCELERATION: float(random.uniform(0.2, 0.8))},
    )
    lasts = tuple(drop.deepest()[0] for drop in plain)
    return Background(family=family, common=common, courses=courses, lasts=lasts, swing=swing)


def _sized(found: Background, share: float, rigs: Sequence[Rig], plain: Sequence[Descent]) -> Background:
    found = replace(found, size=2.0 * share)
    times = [np.linspace(0.0, end, PLACES) for end in found.lasts]
    bare = [drop.channels(t)[FORCE] for drop, t in zip(plain, times, strict=True)]
    span = max(float(f.max()) for f in bare)
    for _ in range(20):
        squares, until = [], []
        for i, (rig, t, f) in enumerate(zip(rigs, times, bare, strict=True)):
            drop = descend(found.about(rig, i), -1e-6, float(t[-1]) + 1e-4)
            until.append(min(drop.deepest()[0], found.lasts[i]))
            read = drop.channels(t)[FORCE] * (1.0 + found.frame(t, FORCE))
            squares.append(float(np.mean((read - f)[t <= until[-1]] ** 2)))
        size = math.sqrt(float(np.mean(squares))) / span
        if abs(size / share - 1.0) < CLOSE:
            return replace(found, until=tuple(until))
        found = replace(found, size=found.size * min(max(share / size, 0.3), 3.0))
    raise ValueError(f"background: {share:g} of the range of the force cannot be reached")


def _joined(shared: Course, own: Course, common: float) -> Course:
    alike, alone = math.sqrt(common), math.sqrt(1.0 - common)
    return lambda x: alike * shared(x) + alone * own(x)


def _waves(random: np.random.Generator) -> Course:
    """Some waves of no more than two over the way down, their place warped, their heights with heavy tails."""
    heights = random.laplace(size=6)
    turns = 2.0 * math.pi * random.uniform(0.3, 2.2, 6)
    phases = random.uniform(0.0, 2.0 * math.pi, 6)
    warp = float(random.uniform(-0.6, 0.6))
    parts = list(zip(heights.tolist(), turns.tolist(), phases.tolist(), strict=True))

    def course(x: float) -> float:
        at = x + warp * math.sin(math.pi * x) / math.pi
        return float(sum(h * math.cos(w * at + p) for h, w, p in parts))

    return _even(course)


def _bumps(random: np.random.Generator) -> Course:
    """A few bumps and dips 1/cosh^2, each of a place, a width and a height of its own."""
    count = int(random.integers(3, 6))
    heights = random.uniform(0.4, 1.0, count) * random.choice((-1.0, 1.0), count)
    places, widths = random.uniform(0.0, 1.2, count), random.uniform(0.08, 0.3, count)
    parts = list(zip(heights.tolist(), places.tolist(), widths.tolist(), strict=True))

    def course(x: float) -> float:
        return float(sum(h / math.cosh(min((x - c) / w, 300.0)) ** 2 for h, c, w in parts))

    return _even(course)


def _even(course: Course) -> Course:
    """Without its mean over the way down, with a root mean square of one."""
    values = np.array([course(x) for x in np.linspace(0.0, 1.0, 400)])
    mean = float(values.mean())
    rms = float(np.sqrt(np.mean((values - mean) ** 2)))
    return lambda x: (course(x) - mean) / rms
