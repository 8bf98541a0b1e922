"""A drop that was not made at the speed that its sidecar states: it contradicts the others.

With the speed v that is stated, and a how many times what is simulated the ground gives way (`slips`),

    ln a = b0 + b1 ln v + d        b0, b1 by the other recordings        (M1)

What all recordings lack, or read too large, lies on that line. One that is off it was dropped faster or more slowly
than it states, or met what the others do not. In the first case another speed is all that it takes: each drop
is met best at some speed, what is missing makes of these a line as well, and at its own it misses the simulation by
little more than the others do at theirs. Which is wrong, the drop or what is stated, nobody can tell: such a
recording is left aside, which is said.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rollover.diagnosis.data.dataset import Dataset, Signal
from rollover.diagnosis.data.inconsistent import Aside, relative_scale
from rollover.diagnosis.settings import SETTINGS
from rollover.effects import spoken

SPEED, DEPTH = "initiation.speed", "ground/sinkage"
TUNING = SETTINGS.inference.wrong_condition


@dataclass(frozen=True, kw_only=True, eq=False)
class WrongCondition(Aside):
    """A recording that was made at another `speed` (m/s) than it states, as its sinkage, `signal`, shows first."""

    speed: float

    summary = "What is stated of a recording is not what was tested."

    def message(self) -> str:
        """The sentence on it."""
        stated = spoken(_speed(self.dataset))
        return (
            f"{self.dataset.name}: beside the others it is a drop at about {self.speed:.2g} m/s, not at the stated "
            f"{stated} m/s; it was excluded."
        )


def wrong_conditions(every: Sequence[Dataset]) -> list[WrongCondition]:
    """The one recording, if any, that contradicts the speed that it states and all others."""
    known = [e for e in every if _speed(e) > 0.0 and np.isfinite(e.simulator.contact)]
    if not TUNING.least_recordings <= len(known) == len(every):
        return []
    factors = [(e, s, a) for e in known for s in e.signals if s.channel == DEPTH and (a := _factor(e, s)) > 0.0]
    if len(factors) < TUNING.least_recordings:
        return []
    x, y = np.log([_speed(e) for e, *_ in factors]), np.log([a for *_, a in factors])
    off = [_deviation(r, x, y) for r in range(x.size)]
    r = int(np.argmax([abs(d) / error for d, error in off]))
    d, error = off[r]
    if abs(d) < max(TUNING.least_deviation, TUNING.least_errors * error):
        return []
    e, signal, _ = factors[r]
    best = [_best_speed(other) for other, *_ in factors]
    more, _ = _deviation(r, x, np.array([log_ for log_, _ in best]))
    _, left = best[r]
    stated = _misfit_power(e, _speed(e))
    alike = left < TUNING.most_power * max(power for k, (_, power) in enumerate(best) if k != r)
    if more * d < 0.0 or abs(more) < TUNING.least_speed_change or not alike or left > stated / TUNING.least_fall:
        return []
    return [WrongCondition(dataset=e, signal=signal, speed=_speed(e) * math.exp(more))]


def _best_speed(e: Dataset) -> tuple[float, float]:
    """Logarithm of the speed, over the stated one, at which a recording is met best, and what is left there."""
    from scipy.optimize import minimize_scalar

    def left(log_: float) -> float:
        return _misfit_power(e, _speed(e) * math.exp(log_))

    about = min(np.linspace(-TUNING.most_speed_change, TUNING.most_speed_change, 9), key=left)
    beside = about + TUNING.most_speed_change / 4.0 * np.array([-1.0, 1.0])
    found = minimize_scalar(left, bounds=beside, method="bounded", options={"xatol": 3e-3})
    return float(found.x), float(found.fun)


def _misfit_power(e: Dataset, speed: float) -> float:
    """Power over the noise that a recording misses the simulation at a speed (m/s) by, at its best time shift."""
    from scipy.optimize import minimize_scalar

    def left(shift: float) -> float:
        made = e.simulator.predict({SPEED: speed}, float(shift))
        if made is None:
            return math.inf
        misfit = np.concatenate([s.values - made[s.channel][s.rows] for s in e.signals])
        return float(np.mean(e.whitened(misfit) ** 2)) + (shift / e.shift_prior) ** 2 / misfit.size

    wide = SETTINGS.fit.time_shift.search_width * e.shift_prior
    return float(minimize_scalar(left, bounds=(-wide, wide), method="bounded", options={"maxiter": 12}).fun)


def _deviation(r: int, x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """d of (M1) of recording r, and its standard error by how far the others lie off their line."""
    rest = np.arange(x.size) != r
    if np.ptp(x[rest]) == 0.0:
        return 0.0, math.inf
    A = np.column_stack([np.ones(x.size), x])
    line, *_ = np.linalg.lstsq(A[rest], y[rest], rcond=None)
    residual = y[rest] - A[rest] @ line
    scatter = max(TUNING.least_scatter, math.sqrt(float(residual @ residual) / (residual.size - 2)))
    wide = float(A[r] @ np.linalg.solve(A[rest].T @ A[rest], A[r]))
    return float(y[r] - A[r] @ line), scatter * math.sqrt(1.0 + wide)


def _factor(e: Dataset, s: Signal) -> float:
    """How many times what is simulated a signal reads; 0 where the two are not alike."""
    made = (e.simulator.predict({}, 0.0) or {}).get(s.channel)
    return 0.0 if made is None else relative_scale(e, s, made) or 0.0


def _speed(e: Dataset) -> float:
    stated = e.recording.conditions.get(SPEED)
    return float(stated) if isinstance(stated, (int, float)) else 0.0
