"""Slopes among runs that differ by chance: over both sides of a point, and over as wide a step as shows clearly more.

Between two runs lies what the parameter does and what chance does. Over a narrow step that is mostly chance, which
squares make look like a strong slope: steps too short, and intervals too narrow. Where a run leaps to another course on
one side, the other side alone tells what the parameter does. Where nothing is left to chance, as in drops, a narrow
step is the better one, see `narrowed`.

So does a blow that comes some ms later: to a slope it is another blow, to a clock the same one. A prediction y(tau) of
a recording with time shift tau is compared with another, y0(0), at the d where it is most like it,

    y(d) - s d - y0(0),   d = argmin |y(d) - y0(0)|,   s = dy0/dtau                                           (D13)

which a clock explains as far as ever, and no less where s d is far from a blow that comes d later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Evidence
from rollover.diagnosis.fit.linearisation import WIDEST
from rollover.diagnosis.fit.parameterisation import Candidate

Array = NDArray[np.float64]
Point = tuple[Sequence[Candidate], Sequence[float]]
EXACT = 5e-3  # of a coordinate, for differences that are free of chance
CLOCKED = 3  # times that a time shift is moved to where it fits
CLEAR = 12.0  # times the squares that runs scatter by, that a difference should move
TOLD = 1.0  # times the noise, that a difference should move a recording where a fit ends
LOUD = 4.0  # times that, above which the step was too wide
STEEPER = 2.0  # times another slope, above which one is doubted
LEAP = 4.0  # times the squares of one side, that the other moves where a run leaps to another course
FINER = 0.25  # of a step, for what tells only near its place


def narrowed(moved: Callable[[float], Array | None], step: float, far: float) -> Array | None:
    """dy/dx_k (n,) of a recording over a step, or over a narrower one where that tells far too much; None if it fails.

    `moved` is what the prediction differs by, whitened, over a step; `far` the misfit over the noise. What moves a
    recording by a hundred times its noise carries its edges past samples, and tells nothing of the place itself. A
    slope that is far steeper closer by is that of a single edge that just lies there: on its other side there is none.
    """
    found = moved(step)
    if found is None:
        return None
    size = float(np.linalg.norm(found))
    if size <= LOUD * TOLD * far:
        return found / step
    narrow = step * TOLD * far / size
    closer = moved(narrow)
    if closer is None:
        return found / step
    slope = closer / narrow
    if float(np.linalg.norm(slope)) * abs(step) < STEEPER * size:
        return slope
    other = moved(-narrow)
    beyond = slope if other is None else -other / narrow
    return beyond if STEEPER * float(np.linalg.norm(beyond)) < float(np.linalg.norm(slope)) else slope


def secant(
    e: Evidence, moved: Callable[[Point], Array | None], at: Point, k: int, nudge: float, widest: float
) -> Array | None:
    """dy/dx_k (n,) of a recording about a point, over `nudge` to either side and up to `widest`; None if it fails.

    `moved` is what the prediction differs by, whitened, from the point to another. A `widest` of 0 takes `nudge` as it
    is.
    """
    candidates = at[0]
    owner, chance = owner_of(candidates, k)[0], scattered_by(e)
    physical = owner.kind != "sensor"
    while True:
        sides = _across(moved, at, k, nudge)
        if not sides:
            return None
        if not _too_narrow(sides, candidates, k, chance, nudge, widest):
            break
        nudge *= 2.0
    whole = _whole(sides)
    (quiet, over), (loud, _) = sorted((sides[0], sides[-1]), key=lambda side: float(side[0] @ side[0]))
    # nothing at all on one side is where an effect ends, and no leap
    leaps = physical and widest > 0.0 and 0.0 < LEAP * float(quiet @ quiet) < float(loud @ loud)
    difference, over = (quiet, over) if leaps else (whole, sum(abs(over) for _, over in sides))
    return (but_chance(e, difference, chance) if owner.is_narrow and widest > 0.0 else difference) / over


def wider(e: Evidence, moved: Callable[[Point], Array | None], at: Point, k: int, nudge: float, widest: float) -> bool:
    """Whether `secant` goes on to twice this `nudge`."""
    sides = _across(moved, at, k, nudge)
    return bool(sides) and _too_narrow(sides, at[0], k, scattered_by(e), nudge, widest)


def scattered_by(e: Evidence) -> float:
    """Sum of squares that runs of a recording scatter by, whitened."""
    power = [float(np.sum(e.eased(e.whitened(stray)) ** 2)) for stray in e.strays]
    return float(np.mean(power)) if power else 0.0


def looked_at(at: Point, k: int, nudge: float) -> list[list[float]]:
    """Coordinates a nudge of the k-th one to either side, within its range."""
    step, value = nudged(at[0], k, nudge), at[1][k]
    return [moved_to(at, k, end) for end in (max(value - step, 0.0), min(value + step, 1.0)) if end != value]


def _across(moved: Callable[[Point], Array | None], at: Point, k: int, nudge: float) -> list[tuple[Array, float]]:
    """What the prediction differs by to either side, (n,) whitened, and how far that is; but where it fails."""
    there = [(moved((at[0], x)), x[k] - at[1][k]) for x in looked_at(at, k, nudge)]
    return [(d, over) for d, over in there if d is not None]


def _whole(sides: Sequence[tuple[Array, float]]) -> Array:
    """The difference from one side to the other; of one side where the other fails."""
    return np.asarray(sum(np.sign(over) * d for d, over in sides))


def _too_narrow(
    sides: Sequence[tuple[Array, float]],
    candidates: Sequence[Candidate],
    k: int,
    chance: float,
    nudge: float,
    widest: float,
) -> bool:
    """Whether chance hides what a nudge does, and twice as much may be taken."""
    if owner_of(candidates, k)[0].kind == "sensor" or 2.0 * nudge > widest:
        return False
    whole = _whole(sides)
    return float(whole @ whole) < CLEAR * chance


def but_chance(e: Evidence, d: Array, chance: float) -> Array:
    """d sqrt(1 - chance/|d|^2) of samples after the blow: a difference (n,) of runs without what `chance` adds to it.

    Two runs that nobody could tell apart differ by so much; over the small steps of a narrow effect it is most of the
    square, and counted as slope would tell a parameter better than it can be told. Before the blow none adds any.
    """
    found, late = d.copy(), ~e.early
    power = float(d[late] @ d[late])
    found[late] *= np.sqrt(max(1.0 - chance / power, 0.0)) if power > 0.0 else 1.0
    return found


def in_time(e: Evidence, changes: Mapping[str, object], shift: float, raw: Array, later: float, *, both: bool) -> Array:
    """dy/dtau (n,) of a recording, SI, `raw` y at `shift`; none across a leap, on whichever side a sample was and is.

    Over `later` (s), to both sides where that costs no run.
    """
    found = e.simulator.predict(changes, shift + later)
    after = raw if found is None else e.raw(found)
    leaps = e.leaps(after, found or {})
    slope = (after - raw) / later
    if both:
        found = e.simulator.predict(changes, shift - later)
        slope = slope if found is None else (after - e.raw(found)) / (2.0 * later)
    slope[leaps] = 0.0
    return np.nan_to_num(slope)


def in_step(e: Evidence, first: Array, last: Array, slope: Array, read: Callable[[float], Array | None]) -> Array:
    """y(d) - s d of (D13), (n,), SI; `last` is y(0), `first` y0, `slope` s, `read` gives y or None."""
    s = e.eased(e.whitened(slope))
    size, most = float(s @ s), WIDEST * e.shift_prior
    found, at, w = last, 0.0, e.eased(e.whitened(last - first))
    for _ in range(CLOCKED if size > 0.0 else 0):
        there = min(max(at - float(s @ w) / size, -most), most)
        y = read(there)
        if y is None:
            break
        left = e.eased(e.whitened(y - first))
        if float(left @ left) >= float(w @ w):
            break
        found, at, w = y, there, left
    return found - slope * at


def owner_of(candidates: Sequence[Candidate], k: int) -> tuple[Candidate, int]:
    """The candidate whose parameter the k-th coordinate is, and which of its own that is."""
    return [(c, own) for c in candidates for own in range(len(c.search))][k]


def valley_at(at: Point, k: int) -> tuple[int, float] | None:
    """`Candidate.valley` of a point, by coordinates of all candidates."""
    owner, own = owner_of(at[0], k)
    found = owner.valley(at[1][k - own :], own)
    return None if found is None else (k - own + found[0], found[1])


def nudged(candidates: Sequence[Candidate], k: int, nudge: float) -> float:
    """How far the k-th coordinate is moved where others are by `nudge`."""
    owner, own = owner_of(candidates, k)
    return min(nudge, EXACT) if owner.kind == "sensor" else nudge * (FINER if owner.is_fine(own) else 1.0)


def beside(
    use: Sequence[int], candidates: Sequence[Candidate], x: Sequence[float], nudge: float, first: int = 0
) -> Iterator[tuple[int, Sequence[Candidate], Sequence[float]]]:
    """(recording, candidates, x) of a place and of those a nudge to either side of it, of the recordings in `use`.

    To the sides of its coordinates from the `first` on.
    """
    for r in use:
        yield r, candidates, x
        for k in range(first, len(x)):
            for there in looked_at((candidates, x), k, nudge):
                yield r, candidates, there


def moved_to(at: Point, k: int, value: float) -> list[float]:
    """Coordinates with the k-th one elsewhere, and what follows it along a valley."""
    x, valley = [float(v) for v in at[1]], valley_at(at, k)
    if valley is not None:
        follows, slope = valley
        x[follows] = min(max(x[follows] + slope * (value - x[k]), 0.0), 1.0)
    x[k] = value
    return x
