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
from rollover.diagnosis.fit.scan_jobs import ParallelMap, serial_map
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.time_shift
UNKNOWN = 1e30  # power of what cannot be compared

Made = Callable[[float], Array | None]
Cost = Callable[[Array, float], float]


def align(problem: Problem) -> None:
    """Begin with the time shift at which each recording meets the scenario best."""
    for r, e in enumerate(problem.dataset if problem.effort.is_timed else ()):
        found = _best(problem, r, partial(problem.raw, r, (), ()), partial(_whole, problem, r), _places(e))
        problem.shifts[r] = problem.shifts[r] if found is None else found


def shifts_from_contact(
    problem: Problem, candidates: Sequence[Candidate], x: Sequence[float], parallel_map: ParallelMap = serial_map
) -> list[float | None]:
    """Time shift (s) of each recording by its first contact; None where nothing comes of it."""
    return parallel_map(problem, partial(_by_contact, beside=(candidates, x)), range(len(problem.dataset)))


def _by_contact(problem: Problem, r: int, *, beside: Point) -> float | None:
    # leaps as they are: these are what tells the time
    e = problem.dataset[r]
    at = _first_contact(problem, r, partial(problem.predicted_with_jumps, r, *beside))
    known = e.recording.clock.zero != "unknown"
    return None if at is None or (known and abs(at) > TUNING.believed_width * e.shift_prior) else at


def _first_contact(problem: Problem, r: int, made: Made) -> float | None:
    """Time shift (s) of recording r by its first contact: found without a model, then beside there by the model."""
    e = problem.dataset[r]
    places = _places(e)
    # what never fell tells of no contact
    places = places[places + e.simulator.contact > e.recording.time[TUNING.early_samples]]
    if not (np.isfinite(e.simulator.contact) and places.size):
        return None
    about = _best(problem, r, made, partial(onset, problem, r), places)
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


def clock_outliers(problem: Problem, fitted: Fitted, parallel_map: ParallelMap = serial_map) -> list[tuple[str, float]]:
    """Recordings that would meet a fit if they came later by a shift (s) far beyond what their clocks may be off by."""
    if not problem.effort.is_timed:
        return []
    found = parallel_map(problem, partial(_distant_shift, fitted=fitted), range(len(problem.dataset)))
    return [(e.name, at) for e, at in zip(problem.dataset, found, strict=True) if at is not None]


def is_explained_by_clocks(problem: Problem, fitted: Fitted, parallel_map: ParallelMap = serial_map) -> bool:
    """Whether such shifts are all that separates the recordings from a fit: each else is met as it stands."""
    late = {name for name, _ in clock_outliers(problem, fitted, parallel_map)}
    others = [b for e, b in zip(problem.dataset, fitted.blocks, strict=True) if e.name not in late]
    return bool(late) and all(b.normal()[2] < TUNING.accepted_power * b.residual.size for b in others)


def clock_evidence(found: Sequence[tuple[str, float]]) -> str:
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
        partial(_left, e),
        np.arange(-TUNING.largest_error, TUNING.largest_error, min(e.shift_prior, TUNING.no_physics)),
    )
    shown = [at for at in onset_delay(e) if abs(at) > TUNING.no_physics] if falls else []
    starts = [*([] if about is None else [about]), *shown]
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
    signals, known = [], np.zeros(raw.size, dtype=bool)
    for s, part in e.spans():
        time = e.recording.time[s.rows]
        known[part] = whole | ((time - shift >= time[0]) & (time - shift <= time[-1]))
        signals.append(s if s.weight is None else replace(s, weight=np.interp(time - shift, time, s.weight)))
    if known.mean() < TUNING.least_overlap or not np.all(np.isfinite(raw[known])):
        return UNKNOWN
    moved = replace(e, signals=tuple(signals))
    misfit = np.where(known, np.concatenate([s.values for s in signals]) - e.masked(raw, e.discontinuities(raw)), 0.0)
    left = moved.whitened(misfit)[known]
    return float(left @ left / np.sum(moved.due[known]))


def _places(e: Dataset) -> Array:
    """Time shifts (s) that a recording's may be."""
    return np.asarray(TUNING.search_width * e.shift_prior * np.linspace(-1.0, 1.0, TUNING.search_count))


def _best(problem: Problem, r: int, made: Made, cost: Cost, shifts: Array) -> float | None:
    """One run moved along the stamps tells where to look among `shifts` (s); the best places are then simulated."""
    e = problem.dataset[r]
    raw = made(0.0)
    if raw is None:
        return None
    rough = []
    for s in shifts:
        moved = raw.copy()
        for signal, part in e.spans():
            time = e.recording.time[signal.rows]
            moved[part] = np.interp(time - s, time, raw[part])
        rough.append(cost(moved, float(s)))
    near = shifts[int(np.argmin(rough))] + np.linspace(-2.0, 2.0, 5) * float(shifts[1] - shifts[0])
    there = [made(float(s)) for s in near]
    left = [np.inf if y is None else cost(y, float(s)) for s, y in zip(near, there, strict=True)]
    return float(near[int(np.argmin(left))])


def _whole(problem: Problem, r: int, raw: Array, shift: float) -> float:
    """What is left of recording r by all its samples."""
    e = problem.dataset[r]
    return float(np.sum(e.marginalised(problem.measured[r] - e.whitened(raw)) ** 2)) + (shift / e.shift_prior) ** 2


def onset(problem: Problem, r: int, raw: Array, shift: float) -> float:
    """-2 ln of the likelihood that recording r falls until its contact, `shift` (s) late, and is something else then.

    Before, what it misses is noise; thereafter it may be as large as what is predicted, and larger at times: a Cauchy
    distribution of that width.
    """
    e = problem.dataset[r]
    total = (shift / e.shift_prior) ** 2
    for s, part in e.spans():
        late = e.recording.time[s.rows] > e.simulator.contact + shift
        z = (s.values - raw[part]) / s.sigma
        wide = np.hypot(1.0, (raw[part] - raw[part][0]) / s.sigma)
        each = np.where(late, 2.0 * np.log(wide) + 2.0 * np.log1p((z / wide) ** 2), z**2)
        total += _worth(s) * float(np.sum(each))
    return total


def _is_free_fall(problem: Problem, r: int, raw: Array | None, shift: float) -> bool:
    """Whether what recording r shows before its contact, `shift` (s) late, is a fall: it may have begun too late."""
    e = problem.dataset[r]
    if raw is None:
        return False
    z = [
        ((s.values - raw[part]) / s.sigma)[e.recording.time[s.rows] <= e.simulator.contact + shift]
        for s, part in e.spans()
    ]
    return bool(np.median(np.abs(np.concatenate([np.zeros(1), *z]))) < TUNING.quiet_median)


def _worth(s: Signal) -> float:
    """What a sample of a coloured noise is worth of one of a white one."""
    return max(1.0 - sum(s.ar), 0.05) / (1.0 + max(sum(s.ar), 0.0))


def _early(problem: Problem, r: int, raw: Array, shift: float) -> float:
    """What is left of it by those up to shortly after the first contact, coloured ones for what they are worth."""
    e = problem.dataset[r]
    total = (shift / e.shift_prior) ** 2
    for s, part in e.spans():
        time = e.recording.time[s.rows] - shift - e.simulator.contact
        after = time[time > 0.0][TUNING.early_samples - 1 : TUNING.early_samples]
        inside = time < max([TUNING.early_window, *after])  # a record may end before
        sigma = np.hypot(s.sigma, TUNING.model_error * (raw[part] - raw[part][0]))
        total += _worth(s) * float(np.sum((((s.values - raw[part]) / sigma)[inside]) ** 2))
    return total
