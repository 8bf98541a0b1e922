"""A candidate effect: which parameters are fitted, over which ranges, and where scans and fits begin."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.forward.interface import EDGES
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import EFFECTS, Search, nth

Array = NDArray[np.float64]

Key = tuple[int, tuple[object, ...], tuple[float, ...], float]
TUNING = SETTINGS.fit.parameterisation
LIMIT_NAMES = ("limit", "yield_force", "stiffness", "angle")  # what acts the more the lower it is


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """An effect with the parameters that are fitted, where to look for them, and the channel of a sensor effect."""

    id: str
    kind: str
    family: str
    search: Mapping[str, Search]
    channel: str | None = None
    null: tuple[float | None, ...] | None = None  # null coordinates, None where a parameter has none; of full runs only
    # secondary parameters: fitted only where the misfit asks for them
    secondary: Mapping[str, Search] = field(default_factory=dict)
    fixed: Mapping[str, Any] = field(default_factory=dict)  # parameters that are not fitted
    variant: Mapping[str, float] = field(default_factory=dict)  # fixed parameters that make it a variant
    own: Mapping[str, float] = field(default_factory=dict)  # the scenario's values, where no number is an effect's null
    points: tuple[tuple[float, ...], ...] = ()  # points that are scanned, if not `scan_points`
    along: tuple[str, ...] = ()  # of a secondary parameter, at whose default all others are held: `Effect.reshaped`
    # no effect: what any explanation is fitted beside, see `Fitted.effects`; fits begin from its `points` as well
    is_baseline: bool = False

    @property
    def key(self) -> str:
        """Id, with the channel of a sensor effect and what is not fitted."""
        suggested = [str(v) for v in self.fixed.values()]
        return ":".join([self.id, *([] if self.channel is None else [self.channel]), *suggested])

    @property
    def spoken(self) -> str:
        """As a sentence names it: the id, with the channel of a sensor effect."""
        return self.id if self.channel is None else f"{self.id} of {self.channel}"

    @cached_property
    def token(self) -> tuple[object, ...]:
        """Identity of its coordinates: candidates with the same token mean the same by them."""
        return (self.key, len(self.search), self.along, *self.variant.items())

    @property
    def is_placed(self) -> bool:
        """Whether a parameter says where or when it acts: one that changes nothing nowhere."""
        return self.null is not None and len(self.search) > 1 and None in self.null

    @property
    def is_local(self) -> bool:
        """Whether it acts only near one point of its range."""
        return bool(EFFECTS[self.id].local_starts)

    @property
    def is_discontinuous(self) -> bool:
        """Whether it acts at the least of its strength already."""
        return EFFECTS[self.id].is_discontinuous

    @property
    def is_oscillatory(self) -> bool:
        """Whether it rings, by a frequency and a damping."""
        return EFFECTS[self.id].is_abrupt and {"stiffness", "damping"} <= self.search.keys()

    @property
    def has_secondary(self) -> bool:
        """Whether secondary parameters are fitted too, or a variant of it is."""
        return bool(self.variant) or not set(self.search).isdisjoint(EFFECTS[self.id].secondary)

    def is_fine(self, k: int) -> bool:
        """Whether the k-th parameter says where a local effect acts: scanned finely, over less about each point."""
        return self.is_local and list(self.search)[k] == "travel"

    def ridge(self, x: Sequence[float], k: int) -> tuple[int, float] | None:
        """Which coordinate follows the k-th one along the ridge of a local effect at x, and how fast; else None.

        At a tilt theta a load slides by s, proportional to tan theta - mu, until a given moment:
        d ln s / d mu = -1/(tan theta - mu). Along that it meets its wall no sooner and no later.
        """
        names = list(self.search)
        if not self.is_local or names[k] != "friction":
            return None
        travel, friction = self.search["travel"], self.search["friction"]
        slope = -(friction.high - friction.low) / (TUNING.sliding_tilt - physical(x[k], friction))
        return names.index("travel"), slope / math.log(travel.high / travel.low)

    def changes(self, x: Sequence[float], number: int = 1) -> dict[str, Any]:
        """Values to exchange in the scenario for coordinates x, each from 0 (low) to 1 (high).

        `number` counts effects of this id, each on its own channel.
        """
        key = nth(self.id, number)
        found: dict[str, Any] = {} if self.channel is None else {f"effects.{key}.channel": self.channel}
        found |= {f"effects.{key}.{name}": value for name, value in (*self.fixed.items(), *self.variant.items())}
        return found | {f"effects.{key}.{name}": value for name, value in self.values(x).items()}

    def values(self, x: Sequence[float]) -> dict[str, float]:
        """Parameters by name for coordinates x."""
        found: Mapping[str, float] = {n: physical(v, s) for v, (n, s) in zip(x, self.search.items(), strict=True)}
        for name in self.along:
            found = EFFECTS[self.id].reshaped({**found, name: getattr(EFFECTS[self.id](), name)}, name, found[name])
        return dict(found)

    def strength(self, x: Sequence[float]) -> float:
        """How many times as strong as it usually is, by the parameter that is furthest from its null value."""
        usual, nulls = EFFECTS[self.id](), EFFECTS[self.id].null
        found = []
        for name, value in self.values(x).items():
            null, own = nulls.get(name), getattr(usual, name)
            if null is not None and own is not None and own != null:
                found.append(abs((value - null) / (own - null)))
        return max(found, default=1.0)

    def starts(self) -> list[tuple[float, ...]]:
        """Coordinates of a start grid; the first of two parameters, a depth or a frequency, in the finer steps."""
        if self.null is not None:
            return self._beside(self.null)
        axes = []
        for s, many in zip(
            self.search.values(), TUNING.grid_of_one if len(self.search) == 1 else TUNING.grid_of_several, strict=False
        ):
            inside = [(k + 0.5) / many for k in range(many)]
            if len(self.search) == 1 and s.scale == "linear" and s.low < 0.0 < s.high:
                middle, near = -s.low / (s.high - s.low), (0.05, 0.4)
                inside = [middle + f * (1.0 - middle) for f in near] + [middle - f * middle for f in near]
            elif len(self.search) == 1 and s.scale == "log" and s.low < 1.0 < s.high and s.high / s.low < 20.0:
                middle = math.log(1.0 / s.low) / math.log(s.high / s.low)
                near = (0.1, 0.5)
                inside = [middle + f * (1.0 - middle) for f in near] + [middle - f * middle for f in near]
            axes.append(inside)
        return list(itertools.product(*axes))

    def _beside(self, null: tuple[float | None, ...]) -> list[tuple[float, ...]]:
        """Few coordinates: a step to either side of the null value, a spread of points where there is none."""
        known = [k for k, n in enumerate(null) if n is not None]
        if len(known) == len(null):
            at = [float(n) for n in null if n is not None]
            steps = [(k, sign * TUNING.run_step) for k in known for sign in (1.0, -1.0)]
            beside = [tuple(a + (d if a + d < 1.0 else -d) * (j == k) for j, a in enumerate(at)) for k, d in steps]
            # what the scenario has may be far above what ever acts: a yield force, a stop
            is_limit = len(at) == 1 and None in EFFECTS[self.id].null.values()
            return [*beside, *((x,) for x in TUNING.limit_points if is_limit)]
        axes, local = [], EFFECTS[self.id].local_starts
        for n, (name, search) in zip(null, self.search.items(), strict=True):
            if n is not None:
                axes.append([min(n + 2.0 * TUNING.run_step, 0.9)])
            elif name in local:
                axes.append(list(local[name]))
            elif EFFECTS[self.id].null.get(name) == 0.0 or any(len(a) > 1 for a in axes):
                # a strength, or more than one place: what is usual shows the direction
                usual = coordinate(getattr(EFFECTS[self.id](), name), search)
                axes.append([min(max(usual, TUNING.run_step), 1.0 - TUNING.run_step)])
            else:
                axes.append(list(TUNING.length_points))
        return list(itertools.product(*axes))

    def strong(self) -> list[tuple[float, ...]]:
        """Coordinates where the effect is strong, one parameter at a time, and `scan_points`; none of drops.

        Where it acts, if that is a parameter, is spread as there; what begins at no strength at all has one end.
        """
        if self.null is None:
            return []
        beside = self._beside(self.null)
        ways = [
            (k, end, way, n)
            for k, n in enumerate(self.null)
            if n is not None
            for end in (0.0, 1.0)
            for way in TUNING.strong_shares
        ]
        if not ways:
            nulls = EFFECTS[self.id].null
            ways = [
                (k, 1.0, TUNING.strong_shares[-1], 0.0) for k, name in enumerate(self.search) if nulls.get(name) == 0.0
            ][:1]
        found = list(beside)
        for point in beside:
            usual = [p if n is None else n for p, n in zip(point, self.null, strict=True)]
            found += [(*usual[:k], n + way * (end - n), *usual[k + 1 :]) for k, end, way, n in ways]
        return list(dict.fromkeys(found))

    def plain(self, x: Sequence[float]) -> tuple[Candidate, tuple[float, ...]]:
        """The same with nothing `along` its shape, and the coordinates at which that is what this one is at x."""
        return replace(self, along=()), coordinates(self.values(x), self.search)

    def reshaped(self, x: Sequence[float]) -> tuple[Candidate, tuple[float, ...]]:
        """The same along its shape as far as that is fitted, and its coordinates there: the way back from `plain`."""
        kind, values = EFFECTS[self.id], self.values(x)
        names = tuple(name for name in self.search if name in kind.secondary)
        for name in names:
            values = {**kind.reshaped(values, name, getattr(kind(), name)), name: values[name]}
        return replace(self, along=names), coordinates(values, self.search)

    def whole(self) -> Candidate:
        """The same effect with its secondary parameters fitted too."""
        return replace(self, search={**self.search, **self.secondary}, secondary={})

    def variants(self) -> list[Candidate]:
        """Variants of the same effect; none of a variant, or where secondary parameters are fitted."""
        if self.has_secondary:
            return []
        found = []
        for form in EFFECTS[self.id].forms:
            search = {name: s for name, s in self.search.items() if name not in form.fixed}
            found.append(replace(self, variant=form.fixed, search={**search, **form.search}, secondary={}))
        return found

    def with_secondary(self, x: Sequence[float]) -> list[tuple[float, ...]]:
        """Coordinates of `whole` at which its fit may begin: the defaults of the secondary parameters, and others."""
        kind: Any = EFFECTS[self.id]()
        default = [_begun(getattr(kind, n), s) for n, s in self.secondary.items()]
        points = [tuple(default), *itertools.product(*[TUNING.secondary_starts] * len(default))]
        return [(*x, *point) for point in points]

    def scan_points(self) -> list[tuple[float, ...]]:
        """Coordinates to linearise at: close to the null value, or spread where there is none, or `points`."""
        if self.points:
            return list(self.points)
        if self.null is not None:
            return self._beside(self.null)
        axes: list[list[float]] = []
        for name, s in self.search.items():
            null = EFFECTS[self.id].null.get(name)
            at = coordinate(null, s) if isinstance(null, (int, float)) and (s.scale != "log" or null > 0.0) else None
            if at is not None and 0.0 < at < 1.0:
                axes.append([at + TUNING.zero_step])
            elif null is not None:
                axes.append([0.1, 0.6])
            else:
                many = (TUNING.threshold_count if len(self.search) > 1 else 4) if not axes else 1
                suggested = [] if s.suggested is None else [coordinate(s.suggested, s)]
                axes.append([(k + 0.5) / many for k in range(many)] + suggested)
        return list(itertools.product(*axes))

    def further(self) -> list[tuple[float, ...]]:
        """Coordinates of a clock that is far off: an edge moved by more than it is wide is no multiple of a small move.

        None of what else there is. Where runs are dear these cost none.
        """
        if self.id not in EDGES:
            return []
        name, s = next(iter(self.search.items()))
        null = EFFECTS[self.id].null[name]
        if null is None or not s.low < null < s.high:
            return []
        return [(coordinate(null, s) + sign * f,) for f in TUNING.clock_steps for sign in (1.0, -1.0)]


def with_slices(candidates: Sequence[Candidate]) -> Iterator[tuple[Candidate, slice]]:
    """Each of several candidates with where its own coordinates lie among those of all."""
    at = 0
    for c in candidates:
        yield c, slice(at, at + len(c.search))
        at += len(c.search)


def same_family(candidates: Iterable[Candidate], to: Iterable[Candidate]) -> list[Candidate]:
    """Candidates that act somewhere, of the family of one that does.

    A depth, a length: one is taken for the other where a look shows little of its place.
    """
    families = {c.family for c in to if c.is_placed}
    return [c for c in candidates if c.is_placed and c.family in families]


def is_one_sensor(candidates: Sequence[Candidate]) -> bool:
    """Whether several effects are all of one sensor."""
    return len(candidates) > 1 and len({c.channel for c in candidates}) == 1 and candidates[0].channel is not None


def _begun(value: float | None, search: Search) -> float:
    """Coordinate at which the fit of a shape begins: its default, if that is inside; what has none begins low."""
    if value is None or (search.scale == "log" and value <= 0.0):
        return 0.02
    return min(max(coordinate(value, search), 0.02), 0.98)


def physical(x: float, search: Search) -> float:
    """Value of a parameter for its coordinate."""
    if search.scale == "log":
        return float(search.low * (search.high / search.low) ** x)
    return float(search.low + x * (search.high - search.low))


def key_at(r: int, candidates: Sequence[Candidate], x: Sequence[float], shift: float) -> Key:
    """What tells a simulation of recording r at x from any other, its time shift (s) to the nanosecond."""
    return (r, tuple([c.token for c in candidates]), tuple([round(float(v), 12) for v in x]), round(shift, 9))


def coordinates(values: Mapping[str, float], search: Mapping[str, Search]) -> tuple[float, ...]:
    """Coordinates of values by name, those out of range at its end."""
    return tuple(min(max(coordinate(values[name], s), 0.0), 1.0) for name, s in search.items())


def coordinate(value: float, search: Search) -> float:
    """Coordinate of a value."""
    if search.scale == "log":
        return math.log(value / search.low) / math.log(search.high / search.low)
    return (value - search.low) / (search.high - search.low)


def strength_parameter(id: str, names: Collection[str]) -> tuple[str, float]:
    """The parameter that says how strong an effect is, of those fitted, and its value at no effect.

    The first that has a number for its null; otherwise the first of all, and 0.
    """
    for name, null in EFFECTS[id].null.items():
        if name in names and isinstance(null, (int, float)):
            return name, float(null)
    return next(iter(names)), 0.0


def null_of(c: Candidate) -> tuple[str, float | None]:
    """The parameter of `strength_parameter` and its value at no effect, which the scenario may say; None if unknown."""
    name, null = strength_parameter(c.id, c.search)
    return name, c.own.get(name) if EFFECTS[c.id].null.get(name) is None else null


def is_limit(c: Candidate) -> bool:
    """Whether an effect is the stronger the lower its first parameter is, without a number at which it is none."""
    name, zero = null_of(c)
    return zero is None and name in LIMIT_NAMES


def followed(c: Candidate, x: Sequence[float], factor: float) -> tuple[float, ...] | None:
    """Coordinates at which an effect is `factor` times as strong as at x; None for one without a zero to go from."""
    name, null = strength_parameter(c.id, c.search)
    if EFFECTS[c.id].null.get(name) is None:
        return None
    search, at = c.search[name], list(c.search).index(name)
    value = null + factor * (physical(x[at], search) - null)
    inside = coordinate(min(max(value, search.low), search.high), search)
    return (*x[:at], min(max(inside, TUNING.end_distance), 1.0 - TUNING.end_distance), *x[at + 1 :])
