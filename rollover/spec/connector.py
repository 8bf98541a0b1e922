"""What joins the parts of a ROPS, and these to the chassis: a yielding spring on each of six axes (data only)."""

from __future__ import annotations

import math
from typing import Annotated

from ground.quantity import Label, Quantity, parameters
from rollover.spec.shapes import Point

Limits = tuple[float | None, float | None, float | None]
NONE: Limits = (None, None, None)


@parameters
class RateFactor:
    """Cowper and Symonds: what yields at a strain rate e carries 1 + (e/D)^(1/q) times its static yield.

    The strain rate is the rate of the plastic deflection over the gauge length, that of the plastic turn over the gauge
    angle. D = 40.4 1/s and q = 5 are the usual numbers of mild steel, from memory: check them for your steel.
    """

    rate: Annotated[float, Quantity("1/s", "D", above=0)] = 40.4
    exponent: Annotated[float, Quantity("1", "q", least=1, most=20)] = 5.0
    gauge_length: Annotated[float, Quantity("m", "over which a plastic deflection is strain", above=0)]
    gauge_angle: Annotated[
        float,
        Quantity("rad", "plastic turn at a strain of 1; 2 where a section is as deep as its hinge is long", above=0),
    ] = 2.0


@parameters
class Connector:
    """A mount or a hinge: on each axis a spring with play, yield and hardening, a dashpot beside it.

    On each axis of the body below: F = k (d - p -+ play), |F| <= F_y (1 + rate factor) + H w, with the permanent set p
    and the plastic way w = sum |dp|; H = k a/(1 - a), so that a is the ratio of the tangent after yield to the elastic
    one. Unloading is elastic. Null: no play, no yield, no hardening, no rate factor.
    """

    name: Annotated[str, Label("in channels: rops/mount/NAME/force_x, rops/hinge/NAME/moment_x")]
    position: Annotated[Point, Quantity("m", "vehicle axes")]
    stiffness: Annotated[Point, Quantity("N/m", "along x, y, z", above=0)]
    damping: Annotated[Point, Quantity("N s/m", "along x, y, z", least=0)]
    rotational_stiffness: Annotated[Point, Quantity("N m/rad", "about x, y, z", least=0)] = (0.0, 0.0, 0.0)
    rotational_damping: Annotated[Point, Quantity("N m s/rad", "about x, y, z", least=0)] = (0.0, 0.0, 0.0)
    yield_force: Annotated[Limits, Quantity("N", "F_y", above=0)] = NONE
    yield_moment: Annotated[Limits, Quantity("N m", "M_y", above=0)] = NONE
    hardening: Annotated[Point, Quantity("1", "tangent over elastic stiffness", least=0, below=1)] = (0.0, 0.0, 0.0)
    rotational_hardening: Annotated[Point, Quantity("1", "the same about x, y, z", least=0, below=1)] = (0.0, 0.0, 0.0)
    play: Annotated[Point, Quantity("m", "free play to either side along x, y, z", least=0)] = (0.0, 0.0, 0.0)
    rotational_play_deg: Annotated[Point, Quantity("deg", "free turn to either side", least=0, most=45)] = (
        0.0,
        0.0,
        0.0,
    )
    rate_factor: RateFactor | None = None

    @property
    def row(self) -> list[float]:
        """Stiffness, damping, yield, hardening modulus, play, D of the rate factor as a speed; six each; then q."""
        stiffness = (*self.stiffness, *self.rotational_stiffness)
        share = (*self.hardening, *self.rotational_hardening)
        rates = [0.0] * 6
        if (r := self.rate_factor) is not None:
            rates = [r.rate * r.gauge_length] * 3 + [r.rate * r.gauge_angle] * 3
        limits = (*self.yield_force, *self.yield_moment)
        return [
            *stiffness,
            *self.damping,
            *self.rotational_damping,
            *(math.inf if limit is None else limit for limit in limits),
            *(k * a / (1.0 - a) for k, a in zip(stiffness, share, strict=True)),
            *self.play,
            *(math.radians(angle) for angle in self.rotational_play_deg),
            # without a yield there is nothing that the rate could raise
            *(0.0 if limit is None else rate for limit, rate in zip(limits, rates, strict=True)),
            1.0 if r is None else r.exponent,
        ]

    @property
    def turns_far(self) -> bool:
        """Whether angles beyond the small ones of an elastic mount are to be expected."""
        return self.yield_moment != NONE or any(self.rotational_play_deg)
