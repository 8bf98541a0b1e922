"""The effect that has no name: a law of the ground's resistance that a regression of the unexplained force proposed."""

from __future__ import annotations

from typing import Annotated, ClassVar

from ground.empirical import TERMS, empirical
from ground.quantity import Quantity, parameters
from ground.settings import ForceTerm
from rollover.effects.effect import Effect, Search

NUMBER = {name: float(k) for k, name in enumerate(TERMS)}
FORCE = Search(-5e3, 5e3)
PARTS = ("first", "second", "third")


@parameters
class Empirical(Effect):
    """F += sum_i c_i T_i(z/z_0, v/v_0, v_s/v_0), the T_i by their names in `ground.empirical.TERMS`."""

    first: Annotated[str, "name of a term, such as 'z v^2'"] = "v"
    first_force: Annotated[float, Quantity("N", "of the first term at the scales, on the reference face")] = 300.0
    second: Annotated[str, "name of a term"] = "1"
    second_force: Annotated[float, Quantity("N", "of the second term at the scales, on the reference face")] = 0.0
    third: Annotated[str, "name of a term"] = "1"
    third_force: Annotated[float, Quantity("N", "of the third term at the scales, on the reference face")] = 0.0
    depth: Annotated[float, Quantity("m", "z_0, scale of the depth", above=0)] = 0.1
    speed: Annotated[float, Quantity("m/s", "v_0, scale of the speed", above=0)] = 1.0

    id = "empirical"
    competes = False  # it is proposed where no effect explains what is left
    family = "a resistance of the ground that has no name"
    equation = "F += sum_i c_i T_i(z/z_0, v/v_0, v_s/v_0) on the loading curve"
    source = "sparse regression of the residual force of recordings; no physics stands behind it"
    sentence = (
        "A law found by regression: {first_force} of {first!r}, {second_force} of {second!r} and {third_force} of "
        "{third!r}, over {depth} and {speed}."
    )
    rivals: ClassVar = {
        "soil-viscous-damping": "drops at other speeds than those it was found on",
        "soil-layer": "drops that go deeper than those it was found on",
    }
    channels = ("ground/force_normal", "striker/acceleration_z")
    is_smooth = True
    null: ClassVar = {"first_force": 0.0, "second_force": 0.0, "third_force": 0.0}
    search: ClassVar = {f"{part}_force": FORCE for part in PARTS}

    def validate(self) -> None:
        """Refuse a term that is not in the table."""
        for part in PARTS:
            name = getattr(self, part)
            if name not in TERMS:
                raise ValueError(f"{part}: unknown term, got {name!r}; {', '.join(TERMS)}")

    @property
    def parts(self) -> list[tuple[str, float]]:
        """Names and forces of the terms that act."""
        pairs = [(getattr(self, part), getattr(self, f"{part}_force")) for part in PARTS]
        return [(name, force) for name, force in pairs if force != 0.0]

    @property
    def law(self) -> str:
        """The law in one line."""
        terms = " ".join(f"{force:+.4g} N * {name}" for name, force in self.parts) or "0"
        return f"F = {terms}, z over {self.depth:.4g} m, v over {self.speed:.4g} m/s"

    def force_terms(self) -> tuple[ForceTerm, ...]:
        """The compiled sum; nothing where no term acts."""
        if not self.parts:
            return ()
        filled = [*self.parts, ("1", 0.0), ("1", 0.0)][: len(PARTS)]
        numbers = tuple(n for name, force in filled for n in (NUMBER[name], force))
        return (ForceTerm(empirical, (*numbers, self.depth, self.speed)),)
