"""The subgrade-compaction model: an elastic spring in series with a plastic one (Ye 2006, Fig. 1a).

Source: the model that Ye (2006) draws after Pietzsch (1991), reduced to what one element needs. Both springs
carry the same force, so the sinkage divides as z_e/z_p = K_p/K_e. While the striker goes down both give way; on
the way back only the elastic one does. Its share of the deepest sinkage is therefore

    recovery = z_e/z_max = K/K_e = K_p/(K_e + K_p),   K = K_e K_p/(K_e + K_p)

and the array's unloading line, F_max/(recovery z_max), has exactly the slope K_e. The same share of the work done
on the springs comes back; the rest, F_max^2/(2 K_p), stays in the rut F_max/K_p. The dashpots are one dashpot here,
in parallel with the pair. The co-moving mass is the array's; Pietzsch puts it at 10.7 % of the striker's.
"""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Literal

from ground.compiled import force_law
from ground.law import GroundLaw
from ground.quantity import Quantity, parameters

_RECOVERY, _ELASTIC, _DAMPING = 0, 1, 3  # places of the fields in p


@parameters
class Compaction(GroundLaw):
    """F = K z + c v with K = K_e K_p/(K_e + K_p); only K_e springs back. The user brings the numbers."""

    kind: Literal["compaction"] = "compaction"
    # follows from the springs, so that it can neither be given nor contradict them; `validate` puts it in place
    recovery: Annotated[float, Quantity("1", "K_p/(K_e + K_p)", above=0, below=1)] = field(init=False, default=0.5)
    elastic_stiffness: Annotated[float, Quantity("N/m", "K_e on the reference face", above=0)]
    plastic_stiffness: Annotated[float, Quantity("N/m", "K_p on the reference face", above=0)]
    damping: Annotated[float, Quantity("N s/m", "c, in parallel with both springs", least=0)] = 0.0

    def validate(self) -> None:
        """Set the recovery, and refuse springs so far apart that one of them is not there."""
        share = self.plastic_stiffness / (self.elastic_stiffness + self.plastic_stiffness)
        if not 0.0 < share < 1.0:
            raise ValueError(
                f"plastic_stiffness: too far from elastic_stiffness, got {self.plastic_stiffness:g} against "
                f"{self.elastic_stiffness:g} N/m; a share K_p/(K_e + K_p) between 0 and 1 is allowed"
            )
        object.__setattr__(self, "recovery", share)

    @property
    def stiffness(self) -> float:
        """K = K_e K_p/(K_e + K_p), both springs in series, N/m."""
        return self.recovery * self.elastic_stiffness

    @staticmethod
    @force_law
    def force(p, s, z, v):  # type: ignore[no-untyped-def]
        """K z + c v; K is the elastic stiffness times the recovery."""
        return p[_RECOVERY] * p[_ELASTIC] * z + p[_DAMPING] * v
