"""Slopes among runs that differ by chance: over both sides of a point, and over as wide a step as shows clearly more.

Between two runs lies what the parameter does and what chance does. Over a narrow step that is mostly chance, which
squares make look like a strong slope: steps too short, and intervals too narrow. Where a run jumps to another branch on
one side, the other side alone tells what the parameter does. Where nothing is left to chance, as in drops, a narrow
step is the better one, see `step_reduced`.

So does an impact that comes some ms later: to a slope it is another impact, to a clock the same one. A prediction
y(tau) of a recording with time shift tau is compared with another, y0(0), at the d where it is most like it,

    y(d) - s d - y0(0),   d = argmin |y(d) - y0(0)|,   s = dy0/dtau                                           (D13)

which a clock explains as far as ever, and no less where s d is far from an impact that comes d later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
Point = tuple[Sequence[Candidate], Sequence[float]]
TUNING = SETTINGS.fit.finite_differences


def step_reduced(moved: Callable[[float], Array | None], step: float, far: float) -> Array | None:
    """dy/dx_k (n,) of a recording over a step, or over a narrower one where that tells far too much; None if it fails.

    `moved` is what the prediction differs by, whitened, over a step; `far` the misfit over the noise. What moves a
    recording by a hundred times its noise carries its edges past samples, and tells nothing of the place itself. A
    slope that is far steeper closer by is that of a single edge that just lies there: on its other side there is none.
    """
    found = moved(step)
    if found is None:
        return None
    size = float(np.linalg.norm(found))
    if size <= TUNING.most_change * TUNING.target_change * far:
        return found / step
    shorter = step * TUNING.target_change * far / size
    closer = moved(shorter)
    if closer is None:
        return found / step
    slope = closer / shorter
    if float(np.linalg.norm(slope)) * abs(step) < TUNING.doubted_ratio * size:
        return slope
    other = moved(-shorter)
    beyond = slope if other is None else -other / shorter
    return beyond if TUNING.doubted_ratio * float(np.linalg.norm(beyond)) < float(np.linalg.norm(slope)) else slope


def adaptive_difference(
    e: Dataset, moved: Callable[[Point], Array | None], at: Point, k: int, fd_step: float, widest: float
) -> Array | None:
    """dy/dx_k (n,) of a recording about a point, over `fd_step` to either side and up to `widest`; None if it fails.

    `moved` is what the prediction differs by, whitened, from the point to another. A `widest` of 0 takes `fd_step` as
    it is.
    """
    candidates = at[0]
    owner, chance = owner_of(candidates, k)[0], ensemble_sum_of_squares(e)
    physical = owner.kind != "sensor"
    while True:
        sides = _two_sided_difference(moved, at, k, fd_step)
        if not sides:
            return None
        if not _needs_wider_step(sides, candidates, k, chance, fd_step, widest):
            break
        fd_step *= 2.0
    whole = _central_difference(sides)
    (quiet, over), (noisy, _) = sorted((sides[0], sides[-1]), key=lambda side: float(side[0] @ side[0]))
    # nothing at all on one side is where an effect ends, and no jump
    discontinuities = (
        physical and widest > 0.0 and 0.0 < TUNING.discontinuity_ratio * float(quiet @ quiet) < float(noisy @ noisy)
    )
    difference, over = (quiet, over) if discontinuities else (whole, sum(abs(over) for _, over in sides))
    return (difference_beyond_chance(e, difference, chance) if owner.is_local and widest > 0.0 else difference) / over


def needs_wider_step(
    e: Dataset, moved: Callable[[Point], Array | None], at: Point, k: int, fd_step: float, widest: float
) -> bool:
    """Whether `adaptive_difference` goes on to twice this `fd_step`."""
    sides = _two_sided_difference(moved, at, k, fd_step)
    return bool(sides) and _needs_wider_step(sides, at[0], k, ensemble_sum_of_squares(e), fd_step, widest)


def ensemble_sum_of_squares(e: Dataset) -> float:
    """Sum of squares that runs of a recording scatter by, whitened."""
    power = [float(np.sum(e.marginalised(e.whitened(perturbed_run)) ** 2)) for perturbed_run in e.perturbed]
    return float(np.mean(power)) if power else 0.0


def stencil(at: Point, k: int, fd_step: float) -> list[list[float]]:
    """Coordinates a step of the k-th one to either side, within its range."""
    step, value = fd_step_of(at[0], k, fd_step), at[1][k]
    return [moved_to(at, k, end) for end in (max(value - step, 0.0), min(value + step, 1.0)) if end != value]


def _two_sided_difference(
    moved: Callable[[Point], Array | None], at: Point, k: int, fd_step: float
) -> list[tuple[Array, float]]:
    """What the prediction differs by to either side, (n,) whitened, and how far that is; but where it fails."""
    there = [(moved((at[0], x)), x[k] - at[1][k]) for x in stencil(at, k, fd_step)]
    return [(d, over) for d, over in there if d is not None]


def _central_difference(sides: Sequence[tuple[Array, float]]) -> Array:
    """The difference from one side to the other; of one side where the other fails."""
    return np.asarray(sum(np.sign(over) * d for d, over in sides))


def _needs_wider_step(
    sides: Sequence[tuple[Array, float]],
    candidates: Sequence[Candidate],
    k: int,
    chance: float,
    fd_step: float,
    widest: float,
) -> bool:
    """Whether chance hides what a step does, and twice as much may be taken."""
    if owner_of(candidates, k)[0].kind == "sensor" or 2.0 * fd_step > widest:
        return False
    whole = _central_difference(sides)
    return float(whole @ whole) < TUNING.least_signal * chance


def difference_beyond_chance(e: Dataset, d: Array, chance: float) -> Array:
    """d sqrt(1 - chance/|d|^2) of samples after the impact: a difference (n,) of runs without what `chance` adds to it.

    Two runs that nobody could tell apart differ by so much; over the small steps of a narrow effect it is most of the
    square, and counted as slope would estimate a parameter better than can be. Before the impact none adds any.
    """
    found, late = d.copy(), ~e.early
    power = float(d[late] @ d[late])
    found[late] *= np.sqrt(max(1.0 - chance / power, 0.0)) if power > 0.0 else 1.0
    return found


def time_derivative(
    e: Dataset, changes: Mapping[str, object], shift: float, raw: Array, later: float, *, both: bool
) -> Array:
    """dy/dtau (n,) of a recording, SI, `raw` y at `shift`; none across a jump, on whichever side a sample was and is.

    Over `later` (s), to both sides where that costs no run.
    """
    found = e.simulator.predict(changes, shift + later)
    after = raw if found is None else e.raw(found)
    discontinuities = e.discontinuities(after, found or {})
    slope = (after - raw) / later
    if both:
        found = e.simulator.predict(changes, shift - later)
        slope = slope if found is None else (after - e.raw(found)) / (2.0 * later)
    slope[discontinuities] = 0.0
    return slope if np.isfinite(slope).all() else np.nan_to_num(slope)


def clock_aligned_difference(
    e: Dataset, first: Array, last: Array, slope: Array, read: Callable[[float], Array | None]
) -> Array:
    """y(d) - s d of (D13), (n,), SI; `last` is y(0), `first` y0, `slope` s, `read` gives y or None."""
    s = e.marginalised(e.whitened(slope))
    size, most = float(s @ s), SETTINGS.fit.linearisation.widest_shift * e.shift_prior
    found, at, w = last, 0.0, e.marginalised(e.whitened(last - first))
    for _ in range(TUNING.shift_rounds if size > 0.0 else 0):
        there = min(max(at - float(s @ w) / size, -most), most)
        y = read(there)
        if y is None:
            break
        left = e.marginalised(e.whitened(y - first))
        if float(left @ left) >= float(w @ w):
            break
        found, at, w = y, there, left
    return found - slope * at


def owner_of(candidates: Sequence[Candidate], k: int) -> tuple[Candidate, int]:
    """The candidate whose parameter the k-th coordinate is, and which of its own that is."""
    return [(c, own) for c in candidates for own in range(len(c.search))][k]


def ridge_at(at: Point, k: int) -> tuple[int, float] | None:
    """`Candidate.ridge` of a point, by coordinates of all candidates."""
    owner, own = owner_of(at[0], k)
    found = owner.ridge(at[1][k - own :], own)
    return None if found is None else (k - own + found[0], found[1])


def fd_step_of(candidates: Sequence[Candidate], k: int, fd_step: float) -> float:
    """How far the k-th coordinate is moved where others are by `fd_step`."""
    owner, own = owner_of(candidates, k)
    return (
        min(fd_step, TUNING.sensor_step)
        if owner.kind == "sensor"
        else fd_step * (TUNING.fine_share if owner.is_fine(own) else 1.0)
    )


def beside(
    use: Sequence[int], candidates: Sequence[Candidate], x: Sequence[float], fd_step: float, first: int = 0
) -> Iterator[tuple[int, Sequence[Candidate], Sequence[float]]]:
    """(recording, candidates, x) of a place and of those a step to either side of it, of the recordings in `use`.

    To the sides of its coordinates from the `first` on.
    """
    for r in use:
        yield r, candidates, x
        for k in range(first, len(x)):
            for there in stencil((candidates, x), k, fd_step):
                yield r, candidates, there


def moved_to(at: Point, k: int, value: float) -> list[float]:
    """Coordinates with the k-th one elsewhere, and what follows it along a ridge."""
    x, ridge = [float(v) for v in at[1]], ridge_at(at, k)
    if ridge is not None:
        follows, slope = ridge
        x[follows] = min(max(x[follows] + slope * (value - x[k]), 0.0), 1.0)
    x[k] = value
    return x
