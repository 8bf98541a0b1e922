"""When a recording's clock began: by all that was recorded, or by its first contact alone.

A time shift that is fitted to a whole recording bends towards whatever the simulation misses. The first contact hardly
depends on that: an error of the model grows with the force, so that samples after it are trusted to `model_error` of
what they have changed since the start, and none later than `early_window`.

It is sought before by what hardly asks for a model: until then a body falls, then it does something else (`onset`).

A clock that is off by far more than it is said to be leaves a recording that nothing explains, and that meets the
simulation at another time altogether (`clock_outliers`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.data.onset import onset_delay
from rollover.diagnosis.fit.finite_differences import Point
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted
from rollover.diagnosis.fit.parameterisation import Candidate
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.time_shift
UNKNOWN = 1e30  # power of what cannot be compared

Made = Callable[[float], Array | None]
Cost = Callable[[Array, Array], Array]  # of runs (m, n), each that many of the shifts (m,) late, s: what each leaves


def estimate_time_shifts(problem: Problem) -> None:
    """Begin with the time shift at which each recording meets the scenario best."""
    for r, e in enumerate(problem.dataset if problem.effort.is_timed else ()):
        found = _best(problem, r, partial(problem.raw, r, (), ()), partial(_whole, problem, r), _scan_points(e))
        problem.shifts[r] = problem.shifts[r] if found is None else found


def shifts_from_contact(
    problem: Problem,
    candidates: Sequence[Candidate],
    x: Sequence[float],
    parallel_map: ParallelMap[Problem] = serial_map,
) -> list[float | None]:
    """Time shift (s) of each recording by its first contact; None where nothing comes of it."""
    return parallel_map(problem, partial(_by_contact, beside=(candidates, x)), range(len(problem.dataset)))


def _by_contact(problem: Problem, r: int, *, beside: Point) -> float | None:
    # jumps as they are: these are what tells the time
    e = problem.dataset[r]
    at = _first_contact(problem, r, partial(problem.predicted_with_jumps, r, *beside))
    known = e.recording.clock.zero != "unknown"
    return None if at is None or (known and abs(at) > TUNING.believed_width * e.shift_prior) else at


def _first_contact(problem: Problem, r: int, made: Made) -> float | None:
    """Time shift (s) of recording r by its first contact: found without a model, then beside there by the model."""
    e = problem.dataset[r]
    shifts = _scan_points(e)
    # what never fell tells of no contact
    shifts = shifts[shifts + e.simulator.contact > e.recording.time[TUNING.early_samples]]
    if not (np.isfinite(e.simulator.contact) and shifts.size):
        return None
    about = _best(problem, r, made, partial(onset, problem, r), shifts)
    if about is None or not _is_free_fall(problem, r, made(about), about):
        return None
    at = _best(
        problem,
        r,
        made,
        partial(_early, problem, r),
        about + TUNING.contact_window * np.linspace(-1.0, 1.0, TUNING.search_count),
    )
    return (
        about if at is None or abs(at - about) > TUNING.end_share * TUNING.contact_window else at
    )  # the model leads away from it


def clock_outliers(
    problem: Problem, fitted: Fitted, parallel_map: ParallelMap[Problem] = serial_map
) -> list[tuple[str, float]]:
    """Recordings that would meet a fit if they came later by a shift (s) far beyond what their clocks may be off by."""
    if not problem.effort.is_timed:
        return []
    found = parallel_map(problem, partial(_distant_shift, fitted=fitted), range(len(problem.dataset)))
    return [(e.name, at) for e, at in zip(problem.dataset, found, strict=True) if at is not None]


def is_explained_by_clocks(problem: Problem, fitted: Fitted, parallel_map: ParallelMap[Problem] = serial_map) -> bool:
    """Whether such shifts are all that separates the recordings from a fit: each else is met as it stands."""
    late = {name for name, _ in clock_outliers(problem, fitted, parallel_map)}
    others = [b for e, b in zip(problem.dataset, fitted.blocks, strict=True) if e.name not in late]
    return bool(late) and all(b.normal()[2] < TUNING.accepted_power * b.residual.size for b in others)


def clock_offset_sentence(found: Sequence[tuple[str, float]]) -> str:
    """What of `clock_outliers` stands behind the verdict."""
    each = [f"{spoken(abs(s) * 1e3)} ms {'late' if s > 0.0 else 'early'} ({name})" for name, s in found]
    if not each:
        return ""
    return (
        " The simulation would meet these recordings, or come far nearer to them, if their clocks were off by far more "
        f"than they are said to be: {', '.join(each)}. Check what started them; a `clock` of `{{zero: unknown}}` or "
        "`{within: SECONDS}` in a sidecar allows for it."
    )


def _distant_shift(problem: Problem, r: int, *, fitted: Fitted) -> float | None:
    """Time shift (s), however large, at which recording r meets a fit far better than where it stands; None if none.

    Beside that it is met far worse: what rests long before and after is met by any clock in most of its samples.
    """
    e, made = problem.dataset[r], partial(problem.raw, r, fitted.candidates, fitted.x)
    falls = not problem.effort.is_ensemble  # a drop is known at any time

    def left(shift: float) -> float:
        raw = made(float(shift))
        return UNKNOWN if raw is None else _left(e, raw, float(shift), whole=falls)

    about = _best(
        problem,
        r,
        made,
        lambda raws, shifts: np.array([_left(e, raw, float(shift)) for raw, shift in zip(raws, shifts, strict=True)]),
        np.arange(-TUNING.largest_error, TUNING.largest_error, min(e.shift_prior, TUNING.no_physics)),
    )
    delays = [at for at in onset_delay(e) if abs(at) > TUNING.no_physics] if falls else []
    starts = [*([] if about is None else [about]), *delays]
    if not starts:
        return None
    there, least = min((_local_minimum(left, start, e.shift_prior) for start in starts), key=lambda found: found[1])
    here = left(fitted.blocks[r].shift)
    bound = max(
        min(TUNING.accepted_power, here / TUNING.least_improvement),
        here / (TUNING.least_fall_far if abs(there) > TUNING.no_physics else TUNING.least_fall),
    )
    if (
        least >= bound
        or min(left(there - TUNING.no_physics), left(there + TUNING.no_physics)) < TUNING.least_rise * least
    ):
        return None
    return there


def _local_minimum(left: Callable[[float], float], start: float, width: float) -> tuple[float, float]:
    """Time shift (s) beside a first one that leaves least, and what it leaves."""
    from scipy.optimize import minimize_scalar

    beside = start + width * np.arange(-6.0, 4.0)
    about = beside[int(np.argmin([left(float(s)) for s in beside]))]
    there = minimize_scalar(left, bounds=about + width * np.array([-1.0, 1.0]), method="bounded")
    return float(there.x), float(there.fun)


def _left(e: Dataset, raw: Array, shift: float, *, whole: bool = False) -> float:
    """Power over the noise of what a run leaves that comes `shift` (s) late; `UNKNOWN` where most of it is.

    `whole` says that a run is known at all stamps, however late.
    """
    known = np.full(raw.size, whole)
    for time, (_, part) in zip(e.times, e.spans(), strict=True):
        if not whole:
            at = time - shift
            known[part] = (at >= time[0]) & (at <= time[-1])
    if known.mean() < TUNING.least_overlap or not np.all(np.isfinite(raw[known])):
        return UNKNOWN
    moved = _with_weights_moved(e, shift)
    misfit = np.where(known, e.values - e.masked(raw, e.discontinuities(raw)), 0.0)
    left = moved.whitened(misfit)[known]
    return float(left @ left / np.sum(moved.due[known]))


def _with_weights_moved(e: Dataset, shift: float) -> Dataset:
    """A recording whose weights come `shift` (s) late; itself where there are none."""
    if all(s.weight is None for s in e.signals):
        return e
    each = zip(e.times, e.signals, strict=True)
    moved = [s if s.weight is None else replace(s, weight=np.interp(t - shift, t, s.weight)) for t, s in each]
    return replace(e, signals=tuple(moved))


def _scan_points(e: Dataset) -> Array:
    """Time shifts (s) that a recording's may be."""
    return np.asarray(TUNING.search_width * e.shift_prior * np.linspace(-1.0, 1.0, TUNING.search_count))


def _best(problem: Problem, r: int, made: Made, cost: Cost, shifts: Array) -> float | None:
    """One run moved along the stamps tells where to look among `shifts` (s); the best places are then simulated."""
    e = problem.dataset[r]
    raw = made(0.0)
    if raw is None:
        return None
    costs = []
    for first in range(0, len(shifts), TUNING.search_at_once):
        some = shifts[first : first + TUNING.search_at_once]
        moved = np.empty((len(some), raw.size))
        for time, (_, part) in zip(e.times, e.spans(), strict=True):
            moved[:, part] = np.interp(time - some[:, None], time, raw[part])
        costs.append(cost(moved, some))
    near = shifts[int(np.argmin(np.concatenate(costs)))] + np.linspace(-2.0, 2.0, 5) * float(shifts[1] - shifts[0])
    there = [made(float(s)) for s in near]
    left = np.full(len(near), np.inf)
    known = [k for k, y in enumerate(there) if y is not None]
    if known:
        left[known] = cost(np.stack([y for y in there if y is not None]), near[known])
    return float(near[int(np.argmin(left))])


def _prior(e: Dataset, shifts: Array) -> Array:
    """What shifts (m,), s, cost by themselves."""
    return np.array([(float(shift) / e.shift_prior) ** 2 for shift in shifts])


def _whole(problem: Problem, r: int, raws: Array, shifts: Array) -> Array:
    """What is left of recording r by all its samples."""
    e = problem.dataset[r]
    left = [float(np.sum(e.marginalised(problem.measured[r] - e.whitened(raw)) ** 2)) for raw in raws]
    return np.asarray(left) + _prior(e, shifts)


def onset(problem: Problem, r: int, raws: Array, shifts: Array) -> Array:
    """-2 ln of the likelihood that recording r falls until its contact, `shifts` (s) late, and is something else then.

    Before, what it misses is noise; thereafter it may be as large as what is predicted, and larger at times: a Cauchy
    distribution of that width.
    """
    e = problem.dataset[r]
    total = _prior(e, shifts)
    for time, (s, part) in zip(e.times, e.spans(), strict=True):
        raw, late = raws[:, part], time > e.simulator.contact + shifts[:, None]
        z = (s.values - raw) / s.sigma
        wide = np.hypot(1.0, (raw - raw[:, :1]) / s.sigma)
        each = np.where(late, 2.0 * np.log(wide) + 2.0 * np.log1p((z / wide) ** 2), z**2)
        total += _worth(s) * np.sum(each, axis=1)
    return total


def _is_free_fall(problem: Problem, r: int, raw: Array | None, shift: float) -> bool:
    """Whether what recording r shows before its contact, `shift` (s) late, is a fall: it may have begun too late."""
    e = problem.dataset[r]
    if raw is None:
        return False
    z = [
        ((s.values - raw[part]) / s.sigma)[time <= e.simulator.contact + shift]
        for time, (s, part) in zip(e.times, e.spans(), strict=True)
    ]
    return bool(np.median(np.abs(np.concatenate([np.zeros(1), *z]))) < TUNING.quiet_median)


def _worth(s: Signal) -> float:
    """Effective samples of one sample of autocorrelated noise."""
    return max(1.0 - sum(s.ar), 0.05) / (1.0 + max(sum(s.ar), 0.0))


def _early(problem: Problem, r: int, raws: Array, shifts: Array) -> Array:
    """What is left of it by those up to shortly after the first contact, coloured ones for what they are worth."""
    e = problem.dataset[r]
    total = _prior(e, shifts)
    for stamps, (s, part) in zip(e.times, e.spans(), strict=True):
        raw, times = raws[:, part], stamps - shifts[:, None] - e.simulator.contact
        sigma = np.hypot(s.sigma, TUNING.model_error * (raw - raw[:, :1]))
        each, worth = ((s.values - raw) / sigma) ** 2, _worth(s)
        # stamps rise, so that what is early are the first of them; a record may end before
        last = np.count_nonzero(times <= 0.0, axis=1) + TUNING.early_samples - 1
        known = np.minimum(last, stamps.size - 1)[:, None]
        end = np.where(last < stamps.size, np.take_along_axis(times, known, axis=1)[:, 0], -np.inf)
        early = np.count_nonzero(times < np.maximum(end, TUNING.early_window)[:, None], axis=1)
        total += worth * np.array([float(np.sum(row[:n])) for row, n in zip(each, early, strict=True)])
    return total


def with_shifts_near_prior(problem: Problem, base: Fitted) -> Fitted:
    """A base with its time shifts no further from where known clocks say than their error."""
    blocks = []
    for r, b in enumerate(base.blocks):
        known = problem.dataset[r].recording.clock.zero != "unknown"
        there = min(max(b.shift, -b.prior), b.prior) if known else b.shift
        new = problem.block(r, base.candidates, base.x, there, problem.effort.fine) if there != b.shift else b
        blocks.append(new or b)
    return replace(base, blocks=tuple(blocks))
