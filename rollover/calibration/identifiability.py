"""What recordings determine: intervals, correlations, and parameters or combinations that they say nothing about."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.objective import Objective
from rollover.system.numbers import Z95

Array = NDArray[np.float64]

AGREES = 0.10  # of Z95: a quadratic interval whose ends differ by more from the objective is replaced by a profile
LEAVES = 0.80  # share of the allowed range that an interval leaves: as good as nothing was learnt
WEAK = 0.25  # standard deviation of a direction, in ranges: its 95 % interval is as wide as the range
PARTAKES = 0.10  # squared component in a weak direction
SHARES = (0.5, 1.0, 1.4)  # of an interval's half: a bend within it and beyond its end shows; each costs a short fit
FLAT = 3.0  # ranges: stands for a standard deviation without bound
_TURNS = 7


@dataclass(frozen=True, kw_only=True)
class Interval:
    """95 % interval in `u`; `open_low`, `open_high`: the data do not end it, the bound does."""

    low: float
    high: float
    method: Literal["quadratic", "profile"]
    open_low: bool = False
    open_high: bool = False


@dataclass(frozen=True, kw_only=True)
class Profile:
    """The misfit along one parameter, all the others fitted anew at each place.

    `places` (n,) in `u`, rising; `rises` (n,) of the squared residual over `widening`: 0 at the `fit`, below it where
    the fit is not the least, 3.84 where a 95 % interval ends. `sigma` in `u`: the parabola of the quadratic interval is
    ((u - fit)/sigma)^2.
    """

    places: Array
    rises: Array
    fit: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class Determination:
    """What is known about all parameters together, in `u`.

    `covariance` (p, p) includes `widening`, the squared residual over noise where that is above 1; `alone` (p,) is 1
    sigma of each if the others were known; `condition` of the Jacobian with columns scaled to one; `directions`:
    combinations that the data do not determine, unit vectors (k, p), each with its 1 sigma in `spread` (k,).
    """

    intervals: tuple[Interval, ...]
    covariance: Array
    correlation: Array
    alone: Array
    condition: float
    directions: Array
    spread: Array
    widening: float
    undetermined: tuple[Literal["", "insensitive", "combination"], ...]
    profiles: tuple[Profile, ...]


def determine(objective: Objective, u: Array) -> Determination:
    """Examine an objective at its minimum `u` (p,).

    The quadratic intervals of the Jacobian are compared with the objective at their ends; where they disagree, the
    profile likelihood takes their place.
    """
    r = objective.residuals(u)
    J = objective.jacobian(u, central=True)
    samples = sum(n for case in objective.shape() for n in case)
    worth = _independent(objective)
    # r are scaled so that correlated samples count once: their squares sum to the number of independent ones
    widening = max(1.0, float(r @ r) / max(worth - len(u), 1.0)) if samples else 1.0
    # all directions of the parameters, none of the samples: that matrix would be as large as their square
    _, singular, directions = np.linalg.svd(np.linalg.qr(J, mode="r"), full_matrices=True)
    singular = np.concatenate([singular, np.zeros(len(u) - singular.size)])
    spread = np.sqrt(widening / (singular**2 + widening / FLAT**2))
    covariance = directions.T @ np.diag(spread**2) @ directions
    sigma = np.sqrt(np.diag(covariance))
    size = np.linalg.norm(J, axis=0)
    scaled = J / np.where(size > 0.0, size, 1.0)
    tops = np.linalg.svd(scaled, compute_uv=False)
    weak = spread > WEAK
    intervals = tuple(_interval(objective, u, i, covariance, widening, float(r @ r)) for i in range(len(u)))
    return Determination(
        intervals=intervals,
        covariance=covariance,
        correlation=covariance / np.outer(sigma, sigma),
        alone=np.sqrt(widening) / np.where(size > 0.0, size, 1e-300),
        condition=float(tops[0] / tops[-1]) if tops[-1] > 1e-12 * tops[0] else float("inf"),
        directions=directions[weak],
        spread=spread[weak],
        widening=widening,
        profiles=tuple(
            _profile(objective, u, i, interval, covariance, widening, float(r @ r))
            for i, interval in enumerate(intervals)
        ),
        undetermined=tuple(
            _verdict(i, intervals[i], directions[weak], np.sqrt(widening) / max(float(size[i]), 1e-300))
            for i in range(len(u))
        ),
    )


def _independent(objective: Objective) -> float:
    """Number of independent samples: the clocks' priors bring one and take one."""
    if not objective.correlation:
        return float(sum(n for case in objective.shape() for n in case))
    return sum(
        n / tau
        for counts, worth in zip(objective.shape(), objective.correlation, strict=True)
        for n, tau in zip(counts, worth, strict=True)
    )


def _verdict(i: int, interval: Interval, weak: Array, alone: float) -> Literal["", "insensitive", "combination"]:
    """Not determined: the interval leaves nearly all of the range, or much of it along a weak direction."""
    width = interval.high - interval.low
    partakes = bool(np.any(weak[:, i] ** 2 > PARTAKES)) if weak.size else False
    if width < LEAVES and not (partakes and width > WEAK):
        return ""
    return "insensitive" if alone > WEAK / 2.0 else "combination"


def _interval(objective: Objective, u: Array, i: int, covariance: Array, widening: float, least: float) -> Interval:
    sigma = float(np.sqrt(covariance[i, i]))
    along = covariance[:, i] / covariance[i, i]
    ends = [u[i] - Z95 * sigma, u[i] + Z95 * sigma]

    def rise(r: Array) -> float:
        return float(np.sqrt(max(float(r @ r) - least, 0.0) / widening))

    agree = bool(ends[0] >= 0.0 and ends[1] <= 1.0)
    for end in ends if agree else ():
        point = u + along * (end - u[i])
        if np.any(point < 0.0) or np.any(point > 1.0) or abs(rise(objective.residuals(point)) - Z95) > AGREES * Z95:
            agree = False
    if agree:
        return Interval(low=float(ends[0]), high=float(ends[1]), method="quadratic")
    found = [_end(objective, u, i, along, sigma * sign, rise) for sign in (-1.0, 1.0)]
    return Interval(low=found[0][0], high=found[1][0], method="profile", open_low=found[0][1], open_high=found[1][1])


def _profile(
    objective: Objective, u: Array, i: int, interval: Interval, covariance: Array, widening: float, least: float
) -> Profile:
    """The profile at shares of the interval to both sides, each place begun from the one before."""
    along = covariance[:, i] / covariance[i, i]
    found = {float(u[i]): 0.0}
    for end in (interval.low, interval.high):
        guess = u
        for share in SHARES:
            place = float(np.clip(u[i] + share * (end - u[i]), 0.0, 1.0))
            if place in found:
                continue
            guess = _conditional(objective, u, i, place, along, guess)
            r = objective.residuals(guess)
            found[place] = (float(r @ r) - least) / widening
    places = np.array(sorted(found))
    rises = np.array([found[place] for place in places.tolist()])
    return Profile(places=places, rises=rises, fit=float(u[i]), sigma=float(np.sqrt(covariance[i, i])))


def _end(
    objective: Objective, u: Array, i: int, along: Array, step: float, rise: Callable[[Array], float]
) -> tuple[float, bool]:
    """Where the profile rises by 1.96 sigma on one side; the bound, and True, if it does not before.

    The root of the rise grows about linearly, so that the secant from the minimum nearly hits.
    """
    bound = 0.0 if step < 0.0 else 1.0
    room = abs(bound - u[i])
    if room <= 1e-12:
        return bound, True
    inner, low = 0.0, 0.0  # distance where the rise is below, and that rise
    outer, high = room, None
    away = min(Z95 * abs(step), room)
    guess = u
    for _ in range(_TURNS):
        point = _conditional(objective, u, i, float(u[i] + np.sign(step) * away), along, guess)
        now, guess = rise(objective.residuals(point)), point
        if abs(now - Z95) < 0.02 * Z95:
            return float(point[i]), False
        if now < Z95:
            if away >= room:
                return bound, True
            inner, low = away, now
        else:
            outer, high = away, now
        if high is None:
            away = min(max(away * Z95 / max(now, 0.1 * Z95), 1.2 * away), room)
        else:
            away = inner + (outer - inner) * (Z95 - low) / (high - low)
            away = min(max(away, inner + 0.05 * (outer - inner)), outer - 0.05 * (outer - inner))
    return float(u[i] + np.sign(step) * (outer if high is not None else inner)), False


def _conditional(objective: Objective, u: Array, i: int, fixed: float, along: Array, guess: Array) -> Array:
    """Minimum over all parameters but `i`, by Gauss-Newton from the better of two predictions."""
    from scipy.optimize import least_squares

    point: Array = np.clip(u + along * (fixed - u[i]), 0.0, 1.0)
    point[i] = fixed
    others = [k for k in range(len(u)) if k != i]
    if not others:
        return point
    other = guess.copy()
    other[i] = fixed
    first, second = (objective.residuals(p) for p in (point, other))
    if float(second @ second) < float(first @ first):
        point = other

    def at(v: Array) -> Array:
        whole: Array = point.copy()
        whole[others] = v
        return whole

    def slopes(v: Array) -> Array:
        return objective.jacobian(at(v), only=others)

    found = least_squares(
        lambda v: objective.residuals(at(v)),
        np.clip(point[others], 1e-9, 1.0 - 1e-9),
        jac=slopes,
        bounds=(0.0, 1.0),
        max_nfev=8,
        xtol=1e-5,
        ftol=1e-7,
    )
    return at(found.x)
