"""Axes of a study: which values of the scenario vary, over which values or by which distribution.

An axis maps u in (0, 1) to a value: x = F^-1(u). A plan chooses the u; a grid takes levels instead.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ground.kinds import ByKind
from ground.quantity import Label, Quantity, parameters
from ground.soils import log_scatter
from ground.ye import MULTIPLE_CORRELATION
from rollover.system import budget

Array = NDArray[np.float64]
EDGE = 1e-12  # u is kept this far from 0 and 1, where a normal has no value
STIFFNESS = "ground.law.stiffness_scale"


@parameters
class Axis:
    """What every axis has; `apply` says whether a number stands for itself, scales what is there or is added to it."""

    name: Annotated[str, Label("column of the table of cases")]
    paths: Annotated[tuple[str, ...], "values of the scenario, see `rollover list paths`; all take the same value"]
    apply: Annotated[Literal["value", "factor", "offset"], "what a number does to the values at the paths"] = "value"

    drawn = True  # whether it is a distribution rather than a set of levels

    def validate(self) -> None:
        """Refuse an axis without a path."""
        if not self.paths:
            raise ValueError("paths: none given; at least one")

    @abstractmethod
    def at(self, u: Array) -> NDArray[Any]:
        """Values (n,) for u (n,) in [0, 1]."""

    def levels(self, count: int) -> NDArray[Any]:
        """Values of a grid: what the axis lists, or the middles of `count` parts of equal probability."""
        return self.at((np.arange(count) + 0.5) / count)

    def how_many(self, count: int) -> int:
        """Number of `levels`, known before they are made."""
        return count


@parameters
class Listed(Axis):
    """Numbers, one after the other; drawn with equal weights."""

    kind: Literal["list"] = "list"
    values: tuple[float, ...]

    drawn = False

    def validate(self) -> None:
        """Refuse an empty list."""
        Axis.validate(self)
        if not self.values:
            raise ValueError("values: none given; at least one")

    def at(self, u: Array) -> NDArray[Any]:
        """One of the values."""
        return np.array(self.values)[_places(u, len(self.values))]

    def levels(self, count: int) -> NDArray[Any]:
        """All of them."""
        return np.array(self.values)

    def how_many(self, count: int) -> int:
        """All of them."""
        return len(self.values)


@parameters
class Chosen(Axis):
    """Words, one after the other: names of .yaml files, kinds; drawn with equal weights."""

    kind: Literal["choice"] = "choice"
    values: tuple[str, ...]

    drawn = False

    def validate(self) -> None:
        """Refuse an empty list, and arithmetic with words."""
        Axis.validate(self)
        if not self.values:
            raise ValueError("values: none given; at least one")
        if self.apply != "value":
            raise ValueError(f"apply: words stand for themselves, got {self.apply!r}; 'value'")

    def at(self, u: Array) -> NDArray[Any]:
        """One of the words."""
        return np.array(self.values, dtype=object)[_places(u, len(self.values))]

    def levels(self, count: int) -> NDArray[Any]:
        """All of them."""
        return np.array(self.values, dtype=object)

    def how_many(self, count: int) -> int:
        """All of them."""
        return len(self.values)


@parameters
class Range(Axis):
    """Evenly from `low` to `high`: `count` levels of a grid, ends included; drawn, any value between them."""

    kind: Literal["range"] = "range"
    low: float
    high: float
    count: Annotated[int, Quantity("1", "levels in a grid", least=2)] = 5
    scale: Literal["linear", "log"] = "linear"

    drawn = False

    def validate(self) -> None:
        """Refuse ends in the wrong order, and a logarithm of what has none."""
        Axis.validate(self)
        _rising(self.low, self.high)
        if self.scale == "log" and self.low <= 0.0:
            raise ValueError(f"low: has no logarithm, got {self.low!r}; more than 0")
        budget.check_count(self.count, budget.CASES, lambda message: ValueError(f"count: {message}"), "levels")

    def at(self, u: Array) -> NDArray[Any]:
        """Low + u (high - low), or that of the logarithms."""
        if self.scale == "log":
            return np.asarray(np.exp(math.log(self.low) + u * math.log(self.high / self.low)))
        return self.low + u * (self.high - self.low)

    def levels(self, count: int) -> NDArray[Any]:
        """`self.count` values with both ends exact."""
        found = self.at(np.linspace(0.0, 1.0, self.count))
        found[0], found[-1] = self.low, self.high
        return found

    def how_many(self, count: int) -> int:
        """`self.count`, whatever a plan says."""
        return self.count


@parameters
class Uniform(Axis):
    """Any value between `low` and `high` with equal probability."""

    kind: Literal["uniform"] = "uniform"
    low: float
    high: float

    def validate(self) -> None:
        """Refuse ends in the wrong order."""
        Axis.validate(self)
        _rising(self.low, self.high)

    def at(self, u: Array) -> NDArray[Any]:
        """Low + u (high - low)."""
        return self.low + u * (self.high - self.low)


@parameters
class LogUniform(Axis):
    """Any order of magnitude between `low` and `high` with equal probability."""

    kind: Literal["log-uniform"] = "log-uniform"
    low: Annotated[float, Quantity("", above=0)]
    high: Annotated[float, Quantity("", above=0)]

    def validate(self) -> None:
        """Refuse ends in the wrong order."""
        Axis.validate(self)
        _rising(self.low, self.high)

    def at(self, u: Array) -> NDArray[Any]:
        """Low (high/low)^u."""
        return np.asarray(self.low * (self.high / self.low) ** u)


@parameters
class Triangular(Axis):
    """From `low` over the likeliest value `mode` to `high`."""

    kind: Literal["triangular"] = "triangular"
    low: float
    mode: float
    high: float

    def validate(self) -> None:
        """Refuse a mode outside."""
        Axis.validate(self)
        _rising(self.low, self.high)
        if not self.low <= self.mode <= self.high:
            raise ValueError(f"mode: outside, got {self.mode!r}; {self.low:g} to {self.high:g}")

    def at(self, u: Array) -> NDArray[Any]:
        """F^-1(u) of the triangle."""
        a, c, b = self.low, self.mode, self.high
        below = a + np.sqrt(u * (b - a) * (c - a))
        return np.where(u < (c - a) / (b - a), below, b - np.sqrt((1.0 - u) * (b - a) * (b - c)))


@parameters
class Normal(Axis):
    """Gaussian; what lies below `low` or above `high` is cut off and its probability shared out."""

    kind: Literal["normal"] = "normal"
    mean: float
    deviation: Annotated[float, Quantity("", "standard deviation, before anything is cut off", above=0)]
    low: float | None = None
    high: float | None = None

    def validate(self) -> None:
        """Refuse bounds in the wrong order."""
        Axis.validate(self)
        _rising(self.low, self.high)

    def at(self, u: Array) -> NDArray[Any]:
        """Mean + deviation Phi^-1(u)."""
        low, high = ((b - self.mean) / self.deviation if b is not None else None for b in (self.low, self.high))
        return self.mean + self.deviation * _normal(u, low, high)


@parameters
class LogNormal(Axis):
    """ln x is Gaussian about ln `median`; what lies below `low` or above `high` is cut off."""

    kind: Literal["lognormal"] = "lognormal"
    median: Annotated[float, Quantity("", above=0)]
    log_deviation: Annotated[float, Quantity("1", "standard deviation of ln x", above=0)]
    low: Annotated[float | None, Quantity("", above=0)] = None
    high: Annotated[float | None, Quantity("", above=0)] = None

    def validate(self) -> None:
        """Refuse bounds in the wrong order."""
        Axis.validate(self)
        _rising(self.low, self.high)

    def at(self, u: Array) -> NDArray[Any]:
        """Median exp(sigma Phi^-1(u))."""
        low, high = (math.log(b / self.median) / self.log_deviation if b else None for b in (self.low, self.high))
        return np.asarray(self.median * np.exp(self.log_deviation * _normal(u, low, high)))


@parameters
class Weibull(Axis):
    """F = 1 - exp(-((x - low)/scale)^shape): strengths, wear, wind."""

    kind: Literal["weibull"] = "weibull"
    scale: Annotated[float, Quantity("", above=0)]
    shape: Annotated[float, Quantity("1", above=0)]
    low: float = 0.0

    def at(self, u: Array) -> NDArray[Any]:
        """Low + scale (-ln(1 - u))^(1/shape)."""
        return np.asarray(self.low + self.scale * (-np.log1p(-_inside(u))) ** (1.0 / self.shape))


@parameters
class Gumbel(Axis):
    """F = exp(-exp(-(x - mode)/scale)): largest of many."""

    kind: Literal["gumbel"] = "gumbel"
    mode: float
    scale: Annotated[float, Quantity("", above=0)]

    def at(self, u: Array) -> NDArray[Any]:
        """Mode - scale ln(-ln u)."""
        return np.asarray(self.mode - self.scale * np.log(-np.log(_inside(u))))


@parameters
class Beta(Axis):
    """From `low` to `high` with density ~ t^(a - 1) (1 - t)^(b - 1)."""

    kind: Literal["beta"] = "beta"
    low: float
    high: float
    a: Annotated[float, Quantity("1", above=0)]
    b: Annotated[float, Quantity("1", above=0)]

    def validate(self) -> None:
        """Refuse ends in the wrong order."""
        Axis.validate(self)
        _rising(self.low, self.high)

    def at(self, u: Array) -> NDArray[Any]:
        """Low + (high - low) I^-1(u; a, b)."""
        from scipy.special import betaincinv

        return np.asarray(self.low + (self.high - self.low) * betaincinv(self.a, self.b, u))


@parameters
class SoilScatter(Axis):
    """Scatter of the regression behind eqs (4), (5) as a factor on K': ln x ~ N(0, sigma), sigma = s sqrt(1 - R^2)/R.

    R^2 = explained/(explained + residual) in a regression of ln K', so residual sd = s sqrt(1 - R^2)/R with s the sd
    that the curves themselves explain over the four drop speeds, 0.64 (`ground.soils.log_scatter`; R = 0.923 gives
    0.27). Two assumptions: ln K' was what was regressed, records evenly spread over the sinkage; the paper tells
    neither. One factor holds for the whole ground of a case, as for another field: scatter from element to element
    would average out under a vehicle, so this is the wider reading.
    """

    kind: Literal["soil-scatter"] = "soil-scatter"
    paths: tuple[str, ...] = (STIFFNESS,)
    apply: Literal["value", "factor", "offset"] = "factor"
    correlation: Annotated[float, Quantity("1", "R, multiple correlation of the regression", above=0, below=1)] = (
        MULTIPLE_CORRELATION
    )

    @property
    def log_deviation(self) -> float:
        """sigma = s sqrt(1 - R^2)/R, standard deviation of ln x."""
        return log_scatter() * _ratio(self.correlation) / _ratio(MULTIPLE_CORRELATION)

    def at(self, u: Array) -> NDArray[Any]:
        """exp(sigma Phi^-1(u))."""
        return np.asarray(np.exp(self.log_deviation * _normal(u)))


@parameters
class Column(Axis):
    """What a column of the plan's table says; words where the table has words."""

    kind: Literal["column"] = "column"

    drawn = False

    def at(self, u: Array) -> NDArray[Any]:
        """A column cannot be drawn. Raises ``ValueError``."""
        raise ValueError("kind: a column has no values of its own, got a plan that draws; plan.kind: table")


AnyAxis = Annotated[
    Listed
    | Chosen
    | Range
    | Uniform
    | LogUniform
    | Triangular
    | Normal
    | LogNormal
    | Weibull
    | Gumbel
    | Beta
    | SoilScatter
    | Column,
    ByKind(),
]


def _ratio(R: float) -> float:
    return math.sqrt(1.0 - R**2) / R


def _places(u: Array, count: int) -> NDArray[np.int64]:
    return np.minimum((u * count).astype(np.int64), count - 1)


def _inside(u: Array) -> Array:
    return np.clip(u, EDGE, 1.0 - EDGE)


def _normal(u: Array, low: float | None = None, high: float | None = None) -> Array:
    """Phi^-1 over the part between `low` and `high` standard deviations."""
    from scipy.special import ndtr, ndtri

    a = ndtr(low) if low is not None else 0.0
    b = ndtr(high) if high is not None else 1.0
    return np.asarray(ndtri(a + _inside(u) * (b - a)))


def _rising(low: float | None, high: float | None) -> None:
    if low is not None and high is not None and low >= high:
        raise ValueError(f"high: not above low ({low!r}), got {high!r}; larger")
