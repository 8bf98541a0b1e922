"""Plans of a study: at which points of its axes the cases lie."""

from __future__ import annotations

from typing import Annotated, Literal

from ground.kinds import ByKind
from ground.quantity import Quantity, parameters


@parameters
class Grid:
    """Every combination of the axes' levels; a distribution gives the middles of parts of equal probability."""

    kind: Literal["grid"] = "grid"
    levels: Annotated[int, Quantity("1", "of an axis that is a distribution", least=1)] = 5


@parameters
class Random:
    """Independent draws: the plan whose quantiles and probabilities have exact intervals."""

    kind: Literal["random"] = "random"
    count: Annotated[int, Quantity("1", "cases", least=1)]
    seed: Annotated[int, Quantity("1", least=0)] = 0


@parameters
class Lhs:
    """Latin hypercube: each of `count` parts of equal probability once on every axis."""

    kind: Literal["lhs"] = "lhs"
    count: Annotated[int, Quantity("1", "cases", least=1)]
    seed: Annotated[int, Quantity("1", least=0)] = 0


@parameters
class Sobol:
    """Scrambled Sobol sequence; balanced where `count` is a power of two."""

    kind: Literal["sobol"] = "sobol"
    count: Annotated[int, Quantity("1", "cases", least=1)]
    seed: Annotated[int, Quantity("1", least=0)] = 0


@parameters
class SobolIndices:
    """Saltelli's scheme for first and total Sobol indices: `count` (axes + 2) cases; axes are independent."""

    kind: Literal["sobol-indices"] = "sobol-indices"
    count: Annotated[int, Quantity("1", "base points, a power of two", least=2)]
    seed: Annotated[int, Quantity("1", least=0)] = 0

    def validate(self) -> None:
        """Refuse a number that unbalances the sequence."""
        if self.count & (self.count - 1):
            raise ValueError(f"count: not a power of two, got {self.count}; {1 << self.count.bit_length()}")


@parameters
class Morris:
    """Elementary effects, one axis at a time: `count` (axes + 1) cases, between the 1st and 99th percentile."""

    kind: Literal["morris"] = "morris"
    count: Annotated[int, Quantity("1", "trajectories", least=2)] = 10
    levels: Annotated[int, Quantity("1", "of each axis; even", least=2)] = 4
    seed: Annotated[int, Quantity("1", least=0)] = 0

    def validate(self) -> None:
        """Refuse an odd number of levels."""
        if self.levels % 2:
            raise ValueError(f"levels: odd, got {self.levels}; {self.levels + 1}")


@parameters
class Table:
    """A case for each row of a CSV or Parquet file, whose columns are named as the axes."""

    kind: Literal["table"] = "table"
    file: Annotated[str, "a .csv or .parquet file, from the folder of the study"]


AnyPlan = Annotated[Grid | Random | Lhs | Sobol | SobolIndices | Morris | Table, ByKind()]
