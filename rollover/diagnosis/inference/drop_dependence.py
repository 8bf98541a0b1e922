"""What the misfit of drops depends on: a force as a function of one quantity, or one channel that goes its own way.

A force f(q) that was left out moves every channel, by (D6); a fault of a sensor moves its own. Each is a linear model
of the whitened misfit w, f a piecewise linear function common to all recordings, and judged by

    |w - J x|^2/phi + k ln n                                                                                     (D7)

with phi what any force at all, free in time, leaves per sample: its number of knots is chosen so, and the quantity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.fit.levenberg_marquardt import Problem
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.fit.tasks import ParallelMap, serial_map
from rollover.diagnosis.fit.time_shift import shifts_from_contact
from rollover.diagnosis.inference.bases import ACCELERATION, DEPTH, SPEED, TIME, linear_b_splines
from rollover.diagnosis.inference.lack_of_fit import Mismatch
from rollover.diagnosis.inference.residual_force import WHERES, Descent, Where, channels_of, descent
from rollover.diagnosis.settings import SETTINGS
from rollover.scenario import Scenario

Array = NDArray[np.float64]
IMPACT, VALUE = "initiation.speed", "value"
TUNING = SETTINGS.inference.drop_dependence


@dataclass(frozen=True, kw_only=True)
class Dependence:
    """Quantities with the share of the excess over the noise that each adds to those before, and the channel, if one.

    The first is the one that a mismatch depends on most; shares add up to at most 1.
    """

    shares: tuple[tuple[str, float], ...] = ()
    channel: str | None = None

    @property
    def on(self) -> str | None:
        """The quantity, where it explains a good part; what a sensor does without any comes and goes in time."""
        if self.shares and self.shares[0][1] > (TUNING.least_share if self.channel is None else TUNING.sensor_share):
            return self.shares[0][0]
        return None if self.channel is None else TIME

    def yields_to(self, motion: Dependence) -> bool:
        """Whether what comes and goes in time in one channel is rather put down to a quantity of the `motion`.

        In tests that begin alike all goes in time, what the vehicle does too; a sensor's fault goes with no attitude.
        """
        has_quantity = bool(motion.shares) and motion.shares[0][0] != TIME and motion.shares[0][1] > TUNING.sensor_share
        return self.on == TIME and has_quantity


@dataclass(frozen=True, kw_only=True)
class Model:
    """A linear model of all recordings: columns J (n_r, k) of each, freed of its time shift."""

    on: str
    columns: tuple[Array, ...]

    def beside(self, other: Model) -> Model:
        """Both together."""
        both = tuple(np.hstack([a, b]) for a, b in zip(other.columns, self.columns, strict=True))
        return Model(on=self.on, columns=both)

    def left(self, misfits: Sequence[Array]) -> float:
        """Sum of squares that it leaves."""
        k = self.columns[0].shape[1]
        N = sum((J.T @ J for J in self.columns), np.zeros((k, k)))
        b = sum((J.T @ w for J, w in zip(self.columns, misfits, strict=True)), np.zeros(k))
        x = np.linalg.solve(N + _steady(N), b)
        return float(sum(np.sum((w - J @ x) ** 2) for J, w in zip(self.columns, misfits, strict=True)))


def _steady(N: Array) -> Array:
    """A faint prior that keeps what nothing determines as what is beside it."""
    k = N.shape[0]
    D = np.diff(np.eye(k), axis=0)
    size = float(np.trace(N)) / k
    return np.asarray(TUNING.smoothness * size * (D.T @ D) + 1e-10 * max(size, 1e-300) * np.eye(k))


def dependence(
    problem: Problem, scenarios: Sequence[Scenario], base: Fitted, parallel_map: ParallelMap[Problem] = serial_map
) -> Dependence:
    """What is left beside a fit depends on what; `scenarios` under the conditions of the recordings."""
    dataset = problem.dataset
    blocks, found = loading_paths(problem, scenarios, base, parallel_map)
    channel = single_faulty_channel(dataset, blocks, found)
    if channel is not None:
        return Dependence(shares=_added(*_of_channel(channel, problem, base)), channel=channel)
    return Dependence(shares=_added(*_of_forces(problem, found, parallel_map))) if found else Dependence()


def dependence_of_one(problem: Problem, base: Fitted, before: Mismatch) -> Dependence | None:
    """What the misfit of the one channel that goes its own way depends on; None where others miss as well."""
    by: dict[str, float] = {}
    for c in before.telling:
        by[c.channel] = by.get(c.channel, 0.0) + c.excess
    most = max(by, key=lambda channel: by[channel], default="")
    others = [c for c in before.telling if c.channel != most]
    chance = TUNING.chance * float(np.sqrt(2.0 * sum(c.rows.size for c in others)))
    if not others or sum(c.excess for c in others) > min(
        TUNING.others_excess * by[most] + chance, TUNING.better_than_force * by[most]
    ):
        return None
    return Dependence(shares=_added(*_of_channel(most, problem, base)), channel=most)


def loading_paths(
    problem: Problem, scenarios: Sequence[Scenario], base: Fitted, parallel_map: ParallelMap[Problem] = serial_map
) -> tuple[list[list[ResidualBlock]], list[Descent]]:
    """Each recording at some time shifts, and its way down at the best of them."""
    shifts = shifts_from_contact(problem, base.candidates, base.x, parallel_map)
    found = parallel_map(
        problem, partial(_loading_path, base=base), list(zip(range(len(scenarios)), scenarios, shifts, strict=True))
    )
    return [blocks for blocks, _ in found], [best for _, best in found if best is not None]


def _loading_path(
    problem: Problem, one: tuple[int, Scenario, float | None], *, base: Fitted
) -> tuple[list[ResidualBlock], Descent | None]:
    """A recording's blocks at some time shifts, and its way down at the best of them.

    Far from an explanation a shift eats what is missing: tried are the base's, what a clock says, the one that the
    first contact tells, and the one that goes with a force that may be anything.
    """
    r, scenario, shifts = one
    e, b = problem.dataset[r], base.blocks[r]
    blocks, best = [b], descent(scenario, e, b)
    tried = [b.shift]
    shift = 0.0 if e.recording.clock.zero != "unknown" else b.shift
    for turn in range(TUNING.most_shifts):
        shift = shifts if turn == 1 and shifts is not None else shift
        if min(abs(shift - other) for other in tried) > TUNING.same_shift * b.prior:
            there = problem.block(r, base.candidates, base.x, shift, 0.0)
            other = None if there is None else descent(scenario, e, there)
            tried.append(shift)
            blocks += [] if there is None else [there]
            best = other if best is None or (other is not None and other.score < best.score) else best
        shift = shift if best is None else best.better
    return blocks, best


def single_faulty_channel(
    dataset: Sequence[Dataset], blocks: Sequence[Sequence[ResidualBlock]], found: Sequence[Descent]
) -> str | None:
    """The channel without which nothing is left to explain, if there is one and no force does as well."""
    total = sum(min(float(b.residual @ b.residual) - b.residual.size for b in several) for several in blocks)
    free = min((sum(d.excess(where) for d in found) for where in WHERES), default=total)
    best, alone_on = np.inf, ""
    for channel in sorted({s.channel for e in dataset for s in e.signals}):
        beside, many = 0.0, 0
        for e, several in zip(dataset, blocks, strict=True):
            rows = np.concatenate([np.full(s.rows.size, s.channel != channel) for s in e.signals])
            beside += min(_left(b, rows) for b in several) - float(rows.sum())
            many += int(rows.sum())
        if many and beside < best:
            best, alone_on = beside, channel
    return alone_on if best < min(TUNING.others_excess * total, TUNING.better_than_force * free) else None


def _left(b: ResidualBlock, rows: NDArray[np.bool_]) -> float:
    """Sum of squares of some rows, their own time shift fitted to them."""
    w, s = b.residual[rows], b.slope[rows]
    g = float(s @ w) - b.shift * b.prior**-2
    return float(w @ w) + (b.shift / b.prior) ** 2 - g * g / (float(s @ s) + b.prior**-2)


def without_shift_directions(w: Array, slope: Array, prior: float) -> Array:
    """A misfit (n,) or columns (n, k) without what the recording's time shift explains."""
    s = slope / np.sqrt(float(slope @ slope) + prior**-2)
    return np.asarray(w - np.outer(s, s @ w) if w.ndim > 1 else w - s * float(s @ w))


def _of_forces(
    problem: Problem, found: Sequence[Descent], parallel_map: ParallelMap[Problem]
) -> tuple[list[Model], list[Array], float, float]:
    """Every model of a force, the misfits, the noise's part of them, and phi."""
    misfits = [without_shift_directions(d.residual[d.rows], d.slope[d.rows], d.prior) for d in found]
    strength = [(d.way.force / float(d.way.force.max()))[:, None] for d in found]
    models: list[Model] = []
    for where in WHERES:
        functions: list[tuple[str, list[Array]]] = []
        for on in (TIME, DEPTH, SPEED, ACCELERATION):
            x = [_quantity(d, on) for d in found]
            for many in TUNING.force_knots:
                knots = _knots(np.concatenate(x), many)
                basis = [linear_b_splines(one, knots) for one in x]
                functions.append((on, basis))
                if where == "ground" and on != ACCELERATION:
                    functions.append((on, [b * s for b, s in zip(basis, strength, strict=True)]))
        faded = [_fading(d) for d in found]
        functions += [(TIME, [f[:, k : k + 2] for f in faded]) for k in range(len(TUNING.decay_times) - 1)]
        functions.append((DEPTH, strength))  # the ground all the way, by a factor
        if where == "push":  # friction: the sign of the speed, which stays the same
            functions.append((SPEED, [np.ones((d.way.time.size, 1)) for d in found]))
        if where == "ground":
            by_touch = [np.array([[1.0, np.log(d.way.touch)]]) for d in found]
            functions.append((IMPACT, [s * row for s, row in zip(strength, by_touch, strict=True)]))
        splits = np.cumsum([basis[0].shape[1] for _, basis in functions])[:-1]
        forces = [np.hstack([basis[k] for _, basis in functions]) for k in range(len(found))]
        felt = parallel_map(problem, partial(_felt, where=where), list(zip(found, forces, strict=True)))
        each = zip(*(np.split(J, splits, axis=1) for J in felt), strict=True)
        models += [Model(on=on, columns=columns) for (on, _), columns in zip(functions, each, strict=True)]
    n = float(sum(w.size for w in misfits))
    free = sum(d.free for d in found)
    dispersion = min(sum(d.left[where] for d in found) for where in WHERES) / max(n - free, 1.0)
    return models, misfits, n, max(dispersion, 1.0)


def _felt(problem: Problem, forced: tuple[Descent, Array], *, where: Where) -> Array:
    """What forces (n, k), over the largest on the way, do to a recording, its time shift left out: all in one go."""
    del problem
    d, forces = forced
    J = channels_of(d.way, d.way.moved(forces * float(d.way.force.max()), where), d.dataset, d.shift)[d.rows]
    return without_shift_directions(J, d.slope[d.rows], d.prior)


def _of_channel(channel: str, problem: Problem, base: Fitted) -> tuple[list[Model], list[Array], float, float]:
    """Every model of a sensor that goes its own way by itself."""
    misfits, values, times, slots = [], [], [], []
    for e, b, off in zip(problem.dataset, base.blocks, problem.residuals(base), strict=True):
        for s, part in e.spans():
            if s.channel == channel:
                misfits.append(b.residual[part])
                values.append(s.values - off[part])  # predicted: what is measured holds the fault
                times.append(e.recording.time[s.rows])
                slots.append((e, b, part))
    models: list[Model] = []

    def add(on: str, functions_at: Sequence[Array]) -> None:
        columns = []
        for (e, b, part), f in zip(slots, functions_at, strict=True):
            raw = np.zeros((e.count, f.shape[1]))
            raw[part] = f
            columns.append(b.counted(e.whitened(raw))[part])
        models.append(Model(on=on, columns=tuple(columns)))

    size = max(float(np.abs(np.concatenate(values)).max()), 1e-300)
    for many in TUNING.sensor_knots:
        edges = np.linspace(0.0, 1.0, many)
        both = np.concatenate(values)
        add(VALUE, [linear_b_splines(v, both.min() + np.ptp(both) * edges) * size for v in values])
        every = np.concatenate(times)
        basis = [linear_b_splines(t, every.min() + np.ptp(every) * edges) for t in times]
        add(TIME, [f * size for f in basis])
        add(TIME, [f * v[:, None] for f, v in zip(basis, values, strict=True)])
    n = float(sum(w.size for w in misfits))
    return models, misfits, n, 1.0


def _added(models: list[Model], misfits: list[Array], n: float, dispersion: float) -> tuple[tuple[str, float], ...]:
    """Quantities one after another, each the best by (D7) beside those before it, with the share that it adds."""
    total = sum(float(w @ w) for w in misfits)
    excess = max(total - n * dispersion, 1e-300)
    held: Model | None = None
    at, score = total, total / dispersion
    shares: list[tuple[str, float]] = []
    rest = list(models)
    while rest:
        tried = []
        for m in rest:
            whole = m if held is None else m.beside(held)
            left = whole.left(misfits)
            tried.append((left / dispersion + whole.columns[0].shape[1] * np.log(n), left, m.on, whole))
        best = min(tried, key=lambda one: one[0])
        if best[0] >= score:
            break
        shares.append((best[2], float(min((at - best[1]) / excess, 1.0 - sum(s for _, s in shares)))))
        score, at, _, held = best[0], best[1], best[2], best[3]
        rest = [m for m in rest if m.on != best[2]]
        if len(shares) == 2:
            break
    return tuple(shares)


def _quantity(d: Descent, on: str) -> Array:
    """A quantity on the way down, (n,)."""
    w = d.way
    if on == ACCELERATION:  # of what is known to act: what is measured holds the force that is sought
        return np.asarray((w.mass * w.gravity - w.force) / w.whole)
    return {TIME: w.time, DEPTH: w.depth, SPEED: w.speed}[on]


def _knots(x: Array, many: int) -> Array:
    """Knots between even ones and those that hold as many values."""
    share = np.linspace(0.0, 1.0, many)
    return np.unique(0.5 * (np.quantile(x, share) + x.min() + share * np.ptp(x)))


def _fading(d: Descent) -> Array:
    """integral exp(-(t - s)/tau) v ds for some tau, (n, k): a force that forgets the way."""
    w = d.way
    h, tau = float(w.time[1] - w.time[0]), np.array(TUNING.decay_times)
    fade = np.exp(-h / tau)
    y = np.zeros((w.time.size, tau.size))
    for i in range(1, w.time.size):
        y[i] = y[i - 1] * fade + 0.5 * h * (w.speed[i - 1] * fade + w.speed[i])
    return np.asarray(y / TUNING.decay_times)
