"""Sections as fibres along the member, each elastic and then plastic with kinematic hardening and rate of strain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rollover.spec.sections import Section

Array = NDArray[np.float64]
ALONG_WALL = 8  # fibres along a wall, three times that around a ring
ACROSS = 12  # along either side of a bar
# of the elastic slope: a perfectly plastic fibre keeps this, so that a mechanism has a stiffness; EN 1993-1-5 annex C.6
# has E/10000 for the same reason
PERFECT = 1e-4
NEWTON, ROUNDED = 60, 1e-13  # iterations at most, and the relative step that is round-off


def fibres(section: Section) -> tuple[Array, Array, Array]:
    """Places along depth and width (m) and areas (m2) of a section's fibres, (n,) each.

    Laid out for sharp corners, then drawn out or together, p -> c |p|^q sign(p), so that A, both I and both W_pl are
    those of the closed forms.
    """
    h, b = section.depth, section.width
    t = section.wall
    if section.is_round:
        around = 3 * ALONG_WALL
        turn = 2.0 * np.pi * (np.arange(around) + 0.5) / around
        inner = 0.5 * h - (t if t is not None else 0.5 * h)
        edges = np.linspace(inner, 0.5 * h, 2 if t is not None else 7)
        ring = 0.5 * (edges[1:] + edges[:-1])
        area = np.repeat(np.pi * np.diff(edges**2) / len(turn), len(turn))
        p, r = np.outer(ring, np.cos(turn)).ravel(), np.outer(ring, np.sin(turn)).ravel()
    elif t is None:
        p, r, area = _grid(h, b, ACROSS, ACROSS)
    else:
        across, dr, da = _grid(t, b, 1, ALONG_WALL)
        up, ur, ua = _grid(h - 2.0 * t, t, ALONG_WALL, 1)
        side = 0.5 * (h - t), 0.5 * (b - t)
        p = np.concatenate([across + side[0], across - side[0], up, up])
        r = np.concatenate([dr, dr, ur + side[1], ur - side[1]])
        area = np.concatenate([da, da, ua, ua])
    want = section.properties
    area = area * (want.area / area.sum())
    return _fitted(p, area, want.second_h, want.plastic_h), _fitted(r, area, want.second_b, want.plastic_b), area


def _fitted(p: Array, area: Array, second: float, plastic: float) -> Array:
    def drawn(q: float) -> Array:
        x = np.sign(p) * np.abs(p) ** q
        return np.asarray(x * np.sqrt(second / np.sum(area * x * x)))

    q = brentq(lambda q: float(np.sum(area * np.abs(drawn(q)))) / plastic - 1.0, 0.5, 1.6)
    return drawn(q)


def _grid(high: float, wide: float, n: int, m: int) -> tuple[Array, Array, Array]:
    p, r = (((np.arange(k) + 0.5) / k - 0.5) * side for k, side in ((n, high), (m, wide)))
    area = np.full(n * m, high * wide / (n * m))
    return np.repeat(p, m), np.tile(r, n), area


@dataclass(frozen=True, kw_only=True)
class Law:
    """One-dimensional: F = k (d - p), |F - H p| <= F_y (1 + (|p'|/D)^(1/q)); arrays of one shape. `plastic` is p.

    H = k a/(1 - a) with the ratio a of the slope after yield to k, so that the slope is k a. `rate` is D, 0 where the
    yield does not depend on the rate.
    """

    stiffness: Array
    yields: Array
    hardening: Array
    plastic: Array
    rate: Array
    exponent: Array

    @classmethod
    def of(
        cls, stiffness: Any, yields: Any, ratio: Any, shape: tuple[int, ...], rate: Any = 0.0, exponent: Any = 1.0
    ) -> Law:
        """A law without memory yet; `ratio` is a of the slopes, `yields` may be infinite."""
        k = np.broadcast_to(np.asarray(stiffness, dtype=float), shape)
        a = np.maximum(np.asarray(ratio, dtype=float), PERFECT)
        return cls(
            stiffness=k,
            yields=np.broadcast_to(np.asarray(yields, dtype=float), shape),
            hardening=np.broadcast_to(k * a / (1.0 - a), shape),
            plastic=np.zeros(shape),
            rate=np.broadcast_to(np.asarray(rate, dtype=float), shape),
            exponent=np.broadcast_to(np.asarray(exponent, dtype=float), shape),
        )

    def tried(self, strain: Array, h: float = np.inf) -> tuple[Array, Array, Array]:
        """Force, its slope, and the plastic part that a deflection within `h` (s) would leave; nothing is written."""
        k, H = self.stiffness, self.hardening
        trial = k * (strain - self.plastic)
        over = trial - H * self.plastic
        beyond = np.abs(over) - self.yields
        flows = beyond > 0.0
        room = np.where(k + H > 0.0, k + H, 1.0)
        flow, slope = np.where(flows, beyond, 0.0) / room, np.where(flows, k * H / room, k)
        timed = flows & (self.rate > 0.0)
        if h < np.inf and timed.any():
            flow[timed], slope[timed] = self._in_time(timed, beyond[timed], h)
        flow = np.sign(over) * flow
        return trial - k * flow, slope, self.plastic + flow

    def _in_time(self, at: NDArray[np.bool_], beyond: Array, h: float) -> tuple[Array, Array]:
        """How far flows what a trial leaves `beyond` its yield, and the slope of its force, where `at` holds.

        Implicit Euler: (k + H) dp + F_y (dp/(h D))^(1/q) = beyond.
        """
        k, q, strength, D = self.stiffness[at], self.exponent[at], self.yields[at], self.rate[at]
        room = k + self.hardening[at]
        # x = (dp/(h D))^(1/q): room h D x^q + F_y x is convex and rises, and either term alone ends beyond the root, so
        # that Newton's iteration from the nearer of the two never overshoots
        x = np.minimum(beyond / strength, (beyond / (room * h * D)) ** (1.0 / q))
        for _ in range(NEWTON):
            flow = room * h * D * x**q
            step = (flow + strength * x - beyond) / (q * flow / x + strength)
            x = x - step
            if np.all(step <= ROUNDED * x):
                break
        flow = h * D * x**q
        return flow, k * (1.0 - k / (room + strength * x / (q * flow)))

    def left(self, plastic: Array) -> Law:
        """The same with this plastic part."""
        return replace(self, plastic=plastic)
