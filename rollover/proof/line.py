"""The way back of the soil: the line from the deepest point into the rut, and how it is met again."""

from __future__ import annotations

from dataclasses import dataclass, replace

from rollover.proof.rig import Curve, Rig


@dataclass(frozen=True, kw_only=True)
class Line:
    """The way back: F = min(force - stiffness (z - depth) ..., force) with a dashpot; it ends in the rut.

    A rig's `unloading` bends it between the rut and the depth.
    """

    depth: float
    force: float
    stiffness: float
    dashpot: float = 0.0

    @property
    def rut(self) -> float:
        """Depth at which nothing presses any more, m."""
        return max(self.depth - self.force / self.stiffness, 0.0) if self.stiffness > 0.0 else 0.0

    def presses(self, rig: Rig, x: float, v: float) -> float:
        """Force at depth x (m) and speed v (m/s), N; a pull is held up to what the rig's adhesion bears."""
        if rig.unloading is None:
            force = min(self.force - self.stiffness * (self.depth - x) + self.dashpot * v, self.force)
        else:
            share = (x - self.rut) / (self.depth - self.rut)
            straight = self.force * (rig.unloading(share) if share > 0.0 else share)
            force = min(straight + self.dashpot * v, self.force)
        gap = self.rut - x
        least = 0.0
        if rig.pull > 0.0:
            if gap > 0.0:
                force = min(force, 0.0)
            least = -rig.pull * _held(rig, max(gap, 0.0) / rig.reach)
        force = max(force, least)
        return force if rig.returning is None else rig.returning(0.0, x, v, force)


def _held(rig: Rig, gap: float) -> float:
    if rig.holding is not None:
        return rig.holding(gap) if gap < 1.0 else 0.0
    return max(0.0, 1.0 - gap)


def line_back(rig: Rig, curve: Curve, t: float, depth: float, dashpot: float) -> Line:
    """The way back from a depth, m."""
    force = curve(t, depth, 0.0)
    return Line(depth=depth, force=force, stiffness=force / (rig.recovery * depth), dashpot=dashpot)


def met_again(line: Line, curve: Curve, t: float) -> Line:
    """The line of a rut up to where it meets another hit's loading curve."""
    from scipy.optimize import brentq

    def over(depth: float) -> float:
        return line.stiffness * (depth - line.rut) - curve(t, depth, 0.0)

    far = line.depth
    while over(far) < 0.0:
        far += line.depth - line.rut
    depth = float(brentq(over, line.rut, far, xtol=1e-13))
    return replace(line, depth=depth, force=line.stiffness * (depth - line.rut))
