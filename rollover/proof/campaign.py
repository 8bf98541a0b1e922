"""How the drops were made and recorded: speeds, rates, stamps, clocks, gaps, channels, noise. Drawn, never chosen."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rollover.proof.instruments import Noise
from rollover.proof.reference_solver import CHANNELS

FORCE, DEPTH, PLACE, SPEED, ACCELERATION = CHANNELS
CLASSES = (60, 180, 600)


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One drop and its recorder; times in s on the drop's own clock (first contact at 0), `late` is the recorder's."""

    speed: float  # m/s, as written down
    rate: float  # Hz
    start: float
    end: float
    late: float = 0.0
    uneven: float = 0.0  # of the sampling interval, by which stamps stray to either side
    gaps: tuple[tuple[str, float, float], ...] = ()  # channel, from, to
    zero_known: bool = True
    scatter: float = 1.0  # factor on the ground's stiffness, of this drop alone


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """Drops, the channels that were recorded, and the noise of each as a share of its range."""

    shots: tuple[Shot, ...]
    channels: tuple[str, ...]
    noise_share: dict[str, float]
    colour: dict[str, float]
    cfc: dict[str, int]
    states_noise: bool
    rebounds: bool = False  # the scenario knows that this ground springs back

    def noise(self, channel: str, span: float) -> Noise:
        """Noise of a channel whose values span `span`."""
        colour, cfc = self.colour.get(channel, 0.0), self.cfc.get(channel, 0)
        return Noise(sigma=self.noise_share[channel] * span, colour=colour, cfc=cfc)


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is evenly spread."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def draw(random: np.random.Generator, needs: tuple[str, ...] = (), *, hard: bool = False) -> Campaign:
    """A campaign that records the channels of `needs` among others; a `hard` one has every nuisance there is."""
    count = 6 if random.random() < 0.6 else int(random.integers(3, 9))
    low, high = random.uniform(1.0, 1.4), random.uniform(2.6, 3.5)
    speeds = np.linspace(low, high, count) + random.uniform(-0.08, 0.08, count)
    speeds = np.round(random.permutation(np.clip(speeds, 1.0, 3.5)), 3)
    rate = log_uniform(random, 500.0, 10_000.0)
    each = random.random() < 0.3
    uneven = random.uniform(0.1, 0.4) if hard or random.random() < 0.2 else 0.0
    jitter = log_uniform(random, 1e-4, 1.5e-3) if hard or random.random() < 0.5 else 0.0
    unknown = random.random() < (0.5 if hard else 0.08)
    channels = _channels(random, needs)
    shots = []
    for speed in speeds.tolist():
        own = log_uniform(random, 500.0, 10_000.0) if each else rate
        shot = Shot(
            speed=speed,
            rate=float(f"{own:.3g}"),
            start=-random.uniform(0.015, 0.09),
            end=random.uniform(0.30, 0.75) if speed > 2.0 else random.uniform(0.2, 0.6),
            late=float(np.clip(random.normal(0.0, jitter), -3e-3, 3e-3)) + (random.uniform(-0.02, 0.02) * unknown),
            uneven=uneven,
            zero_known=not unknown,
        )
        shots.append(replace(shot, gaps=_gaps(random, channels, shot, 0.6 if hard else 0.15)))
    slowest = min(shot.rate for shot in shots)
    classes = [c for c in CLASSES if 10.0 * c <= slowest]
    colour: dict[str, float] = {}
    cfc: dict[str, int] = {}
    shares = {channel: log_uniform(random, 0.002, 0.03) for channel in channels}
    way = random.random()
    for channel in channels:
        if way < 0.25 and classes and not uneven and not any(gap[0] == channel for s in shots for gap in s.gaps):
            if channel in (FORCE, ACCELERATION):
                cfc[channel] = int(random.choice(classes))
        elif way < 0.55 or hard:
            colour[channel] = float(random.uniform(0.2, 0.9))
    return Campaign(
        shots=tuple(shots),
        channels=channels,
        noise_share=shares,
        colour=colour,
        cfc=cfc,
        states_noise=bool(random.random() < 0.6),
    )


def _channels(random: np.random.Generator, needs: tuple[str, ...]) -> tuple[str, ...]:
    """The load cell and at least one more, mostly those of the paper's rig."""
    found = {FORCE, *needs}
    for channel, chance in ((DEPTH, 0.85), (ACCELERATION, 0.85), (SPEED, 0.25), (PLACE, 0.25)):
        if random.random() < chance:
            found.add(channel)
    if len(found) == 1:
        found.add(DEPTH)
    return tuple(c for c in CHANNELS if c in found)


def _gaps(
    random: np.random.Generator, channels: tuple[str, ...], shot: Shot, chance: float
) -> tuple[tuple[str, float, float], ...]:
    if random.random() >= chance:
        return ()
    start = random.uniform(shot.start, 0.8 * shot.end)
    return ((str(random.choice(channels)), float(start), float(start + random.uniform(0.004, 0.03))),)
