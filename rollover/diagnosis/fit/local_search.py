"""Local searches where finite differences mislead: along curved ridges, over edges in time, beyond discontinuities."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import with_uncertain_conditions_at
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.parameterisation import Candidate, coordinate, physical, with_slices
from rollover.diagnosis.settings import SETTINGS

Array = NDArray[np.float64]
TUNING = SETTINGS.fit.local_search
SPREAD = (
    np.arange(TUNING.coarse_secondary) + 0.5
) / TUNING.coarse_secondary  # places of a shape that goes along with them
SCANNED = (np.arange(TUNING.fine_secondary) + 0.5) / TUNING.fine_secondary  # places of a shape


def chi2_at(
    problem: Problem,
    candidates: Sequence[Candidate],
    x: Sequence[float],
    shifts: Sequence[float],
    only: Sequence[int] | None = None,
) -> float | None:
    """What is left of all recordings or `only` some at x, with time shifts (s) of all; None if a run fails."""
    blocks = blocks_at(problem, candidates, x, shifts, only)
    return None if blocks is None else sum(b.normal()[2] for b in blocks)


def blocks_at(
    problem: Problem,
    candidates: Sequence[Candidate],
    x: Sequence[float],
    shifts: Sequence[float],
    only: Sequence[int] | None = None,
    *,
    clock: bool = True,
) -> list[ResidualBlock] | None:
    """Recordings at x and these time shifts (s), without slopes but a clock's; None where one cannot be simulated."""
    use = range(len(shifts)) if only is None else only
    found = [problem.block(r, candidates, x, shifts[r], 0.0, clock=clock) for r in use]
    blocks = [b for b in found if b is not None]
    return blocks if len(blocks) == len(found) else None


def ranked_by_misfit(
    problem: Problem,
    candidates: Sequence[Candidate],
    points: Sequence[tuple[float, ...]],
    shifts: Sequence[float],
    only: Sequence[int] | None = None,
) -> list[tuple[float, ...]]:
    """Those places that can be simulated, the one that leaves least of all recordings or `only` some first."""
    met = [(there, x) for x in points if (there := chi2_at(problem, candidates, x, shifts, only)) is not None]
    return [x for _, x in sorted(met)]


def polish(problem: Problem, fitted: Fitted, size: float = 0.02, most: int = 45) -> Fitted:
    """Follow a curved ridge by a simplex: where a threshold is crossed, differences mislead; never worse."""
    from scipy.optimize import minimize

    shifts = [b.shift for b in fitted.blocks]

    def left(x: Array) -> float:
        inside = [float(v) for v in np.clip(x, 0.0, 1.0)]
        out = float(np.sum(np.abs(x - np.array(inside))))
        there = chi2_at(problem, fitted.candidates, inside, shifts)
        return 1e300 if there is None else there * (1.0 + out)

    start = np.array(fitted.x)
    simplex = np.vstack(
        [start, *(start + size * (1.0 if v < 0.9 else -1.0) * np.eye(start.size)[k] for k, v in enumerate(start))]
    )
    found = minimize(
        left, start, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": most, "xatol": 1e-4}
    )
    again = problem.fit(fitted.candidates, np.clip(found.x, 0.0, 1.0), rounds=3, shifts=shifts, width=2)
    return again if again is not None and again.chi2 < fitted.chi2 else fitted


def grid_scan(fitted: Fitted) -> list[tuple[float, ...]]:
    """Places all along the second parameter of the last effect of a fit, beside where its first one stands.

    What hops leaves a misfit full of cliffs: a frequency is found soon, what damps it may lie far off behind one.
    """
    at = len(fitted.x) - 2
    firsts = np.clip(fitted.x[at] + TUNING.first_half_width * np.linspace(-1.0, 1.0, TUNING.first_count), 0.0, 1.0)
    return [
        (*fitted.x[:at], float(a), float(b))
        for a in firsts
        for b in (np.arange(TUNING.second_count) + 0.5) / TUNING.second_count
    ]


def frequency_scan(last: Candidate, own: Sequence[float]) -> tuple[Candidate, list[tuple[float, ...]]]:
    """The last effect of a fit along its shape, and places all along its frequency and its shape, little damped.

    One that was fitted beside a wrong frequency hardly rings any more: what it rings by is not to be seen from there.
    """
    whole = replace(last.whole(), along=tuple(last.secondary))
    firsts = np.clip(own[0] + TUNING.frequency_half_width * np.linspace(-1.0, 1.0, TUNING.frequency_count), 0.0, 1.0)
    secondaries = itertools.product(*(SPREAD for _ in last.secondary))
    return whole, [
        (float(a), b, *map(float, shape)) for shape in secondaries for a in firsts for b in TUNING.light_damping
    ]


def separate_minima(met: Sequence[tuple[float, tuple[float, ...]]]) -> list[tuple[float, ...]]:
    """Of places, each with what it leaves, the best that are not beside each other."""
    chosen: list[tuple[float, ...]] = []
    for _, x in sorted(met):
        if len(chosen) < TUNING.starts and all(
            max(abs(a - b) for a, b in zip(x, c, strict=True)) > TUNING.start_distance for c in chosen
        ):
            chosen.append(x)
    return chosen


def starts_along_secondary(last: Candidate, x: Sequence[float]) -> list[tuple[float, ...]]:
    """Places beside x all along each parameter of the shape of its last effect, the others as they usually are.

    A recording in which a face lets go, or does not, is met within a narrow stretch alone.
    """
    at = len(x)
    begun = (*x[: at - len(last.search)], *last.with_secondary(x[-len(last.search) :])[0])
    return [(*begun[:k], float(v), *begun[k + 1 :]) for k in range(at, len(begun)) for v in SCANNED]


def smallest_misfit(
    problem: Problem, item: tuple[Sequence[Candidate], Sequence[tuple[float, ...]]], *, shifts: Sequence[float]
) -> tuple[float, tuple[float, ...]] | None:
    """What is left of all recordings at that of some places where it is least, and this; None if all runs fail."""
    candidates, points = item
    least, best = np.inf, None
    for x in points:
        chi2 = 0.0
        for r, shift in enumerate(shifts):
            block = problem.block(r, candidates, x, shift, 0.0)
            chi2 += np.inf if block is None else block.normal()[2]
            if chi2 >= least:
                break
        else:
            least, best = chi2, x
    return None if best is None else (least, best)


def with_time_shift_search(problem: Problem, fitted: Fitted) -> Fitted:
    """The fit with each time shift scanned to either side: edges bias its slope; never worse.

    Where one channel has a clock of its own all shifts are tried against that first: the edges of the channel stay.
    """
    best = fitted
    for _ in range(TUNING.repeats if problem.effort.is_timed else 0):
        x, shifts = _against(problem, best)
        moved = [problem.block(r, best.candidates, x, s, 0.0, clock=False) for r, s in enumerate(shifts)]
        blocks = [b if b is None else _tried(problem, r, best.candidates, x, b) for r, b in enumerate(moved)]
        shifts = [s if b is None else b.shift for s, b in zip(shifts, blocks, strict=True)]
        again = problem.fit(best.candidates, x, rounds=3, shifts=shifts, width=2)
        if again is None or again.chi2 > best.chi2 - TUNING.least_gain:
            break
        best = again
    return best


def ended(problem: Problem, fitted: Fitted) -> Fitted:
    """The fit gone on with over narrow steps as long as that gains: its rounds may have been too few; never worse."""
    best = fitted
    for _ in range(TUNING.repeats):
        again = problem.fit(best.candidates, best.x, shifts=[b.shift for b in best.blocks], width=2, finely=True)
        if again is None or again.chi2 > best.chi2:
            break
        is_there = again.chi2 > best.chi2 - TUNING.least_gain
        best = again
        if is_there:
            break
    return best


def _against(problem: Problem, fitted: Fitted) -> tuple[tuple[float, ...], list[float]]:
    """Coordinates, and time shifts (s) of all, moved against the clock of each channel that has one of its own."""
    best, chi2 = (fitted.x, [b.shift for b in fitted.blocks]), fitted.total
    for c, own in with_slices(fitted.candidates):
        if c.id != "sensor-clock-offset":
            continue
        k, step, search = own.start, TUNING.shift_step, c.search["offset"]
        while step > TUNING.shift_step_least:
            for d in (step, -step):
                moved = coordinate(physical(best[0][k], search) - d, search)
                x, shifts = (*best[0][:k], moved, *best[0][k + 1 :]), [s + d for s in best[1]]
                blocks = blocks_at(problem, fitted.candidates, x, shifts, clock=False) if 0.0 < moved < 1.0 else None
                there = np.inf if blocks is None else sum(b.total for b in blocks)
                if there < chi2:
                    best, chi2 = (x, shifts), there
                    break
            else:
                step *= TUNING.shift_step_factor
    return best


def _tried(
    problem: Problem, r: int, candidates: Sequence[Candidate], x: Sequence[float], block: ResidualBlock
) -> ResidualBlock:
    """Recording r at a time shift beside which none is better, nor its clock's as stated, nor the one it began with.

    Edges leave one of many recordings in a dip that is a millisecond off.
    """
    for there in (0.0, problem.shifts[r]):
        other = problem.block(r, candidates, x, there, 0.0, clock=False)
        block = other if other is not None and other.total < block.total else block
    step, tried = TUNING.shift_step, 0
    while step > TUNING.shift_step_least and tried < TUNING.most_shift_trials:
        for there in (block.shift + step, block.shift - step):
            tried += 1
            other = problem.block(r, candidates, x, there, 0.0, clock=False)
            if (
                other is not None
                and other.total < block.total
                and abs(there) < SETTINGS.fit.linearisation.widest_shift * other.prior
            ):
                block = other
                break
        else:
            step *= TUNING.shift_step_factor
    return block


def has_uncertain_conditions(problem: Problem) -> bool:
    """Whether conditions leave something uncertain whose work beside an effect is worth its runs."""
    return not problem.effort.is_ensemble and any(e.nuisance is not None for e in problem.dataset)


def refitted_with_conditions(problem: Problem, fitted: Fitted) -> Fitted:
    """The fit again with what the conditions leave uncertain as it acts beside it, recordings weighed by that.

    What an error of a condition does was seen on the scenario as it is: a mass in doubt moves a spike there, and
    beside a spring that was found its frequency.
    """
    for _ in range(TUNING.condition_rounds):
        beside = problem.changes(fitted.candidates, fitted.x)
        shifts = [b.shift for b in fitted.blocks]
        problem.with_noise_model(
            [with_uncertain_conditions_at(e, beside, s) for e, s in zip(problem.dataset, shifts, strict=True)]
        )
        again = problem.fit(fitted.candidates, fitted.x, shifts=shifts, width=1)
        fitted = again or problem.again(fitted)
    return fitted


def representative_recordings(f: Fitted) -> list[int]:
    """The recordings that a fit meets worst, best and in the middle."""
    ranked = sorted(range(len(f.blocks)), key=lambda r: f.blocks[r].normal()[2] / f.blocks[r].residual.size)
    return sorted({ranked[0], ranked[len(ranked) // 2], ranked[-1]})


def completed_shifts(shifts: Sequence[float], short: Fitted, few: Sequence[int]) -> tuple[float, ...]:
    """Time shifts (s) of all recordings: as fitted to the few that a short fit was made to, elsewhere as given."""
    known_shifts = {r: block.shift for r, block in zip(few, short.blocks, strict=True)}
    return tuple(known_shifts.get(r, s) for r, s in enumerate(shifts))


def all_but_one(fitted: Fitted, k: int) -> tuple[list[Candidate], list[int]]:
    """The effects of a fit but its k-th, and the places of their coordinates."""
    others = [(c, own) for j, (c, own) in enumerate(with_slices(fitted.candidates)) if j != k]
    return [c for c, _ in others], [at for _, own in others for at in range(own.start, own.stop)]


def without_effect(
    problem: Problem, fitted: Fitted, k: int, rounds: int = 8, *, no_jacobian: bool = False
) -> Fitted | None:
    """The explanation fitted again without its k-th effect; `no_jacobian` as in `Problem.fit`."""
    rest, columns = all_but_one(fitted, k)
    x, shifts = [fitted.x[at] for at in columns], [b.shift for b in fitted.blocks]
    reused = [b.unweighted_J[:, columns] for b in fitted.blocks] if problem.effort.is_ensemble else None
    return problem.fit(rest, x, rounds=rounds, shifts=shifts, no_jacobian=no_jacobian, reused=reused)


def linearised(
    problem: Problem,
    candidates: Sequence[Candidate],
    x: Sequence[float],
    shifts: Sequence[float],
    recordings: Sequence[int] | None = None,
    *,
    no_jacobian: bool = False,
) -> Fitted | None:
    """A fit to all recordings or some as it stands at x and these time shifts (s); None if nothing can be simulated.

    A `no_jacobian` one has no slopes.
    """
    blocks: list[ResidualBlock] = []
    use = range(len(shifts)) if recordings is None else recordings
    fd_step = 0.0 if no_jacobian else problem.effort.fine
    if not no_jacobian:
        problem.simulate_neighbourhood(use, candidates, x, shifts, fd_step)
    for r, shift in zip(use, shifts, strict=True):
        block = problem.block(r, candidates, x, shift, fd_step)
        if block is None:
            return None
        blocks.append(block)
    return Fitted(candidates=tuple(candidates), x=tuple(x), blocks=tuple(blocks))
