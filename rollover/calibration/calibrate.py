"""Parameters of a scenario from recordings: several starts, least squares over noise, intervals, what stays open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.identifiability import Determination, Profile, determine
from rollover.calibration.objective import Case, Noise, Objective, Parameter, Simulate, case, check_free
from rollover.calibration.posterior import Posterior, of_fit
from rollover.comparison import alignment
from rollover.comparison.rating import Iso18571, Rating, rate
from rollover.dynamics import drop_test, simulate
from rollover.recording import Recording
from rollover.recording.noise_floor import USUAL
from rollover.recording.time_stamps import Zero
from rollover.scenario import Scenario
from rollover.spec.document import exchanged
from rollover.system.processes import map_cases

Array = NDArray[np.float64]

STARTS, FOLLOWED = 8, 3  # random starts that are looked at besides the scenario's own, and how many are followed
CAP = 3.0  # sigmas: residuals beyond count by their size, no longer by its square
OUTLIER = 4.5  # sigmas, of the fitted residual in its own scatter
NEAR = 1e-3  # of the range: at a bound
SAME = 0.02  # of the range: two starts that ended at one place
TURNS = 40
SOFTENINGS = (30.0, 5.0, 1.0)  # of the noise, one after another, from a start that may be far away


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter: value, 95 % interval, and whether the recordings determine it.

    `alone_low`, `alone_high`: the interval if all the other parameters were known.
    """

    path: str
    unit: str
    start: float
    value: float
    low: float
    high: float
    method: Literal["quadratic", "profile"]
    bounds: tuple[float, float]
    open_low: bool
    open_high: bool
    at_bound: Literal["", "low", "high"]
    determined: bool
    why: str
    alone_low: float
    alone_high: float


@dataclass(frozen=True, kw_only=True)
class Score:
    """How well recordings are followed: means over channels; None where nothing can be rated.

    `over_noise` is the root mean square of residual over noise; 1 is perfect.
    """

    over_noise: float
    nrmse: float | None
    iso18571: float | None
    peak_force_error: float | None


@dataclass(frozen=True, kw_only=True)
class Scores:
    """Before and after, over some recordings."""

    recordings: tuple[str, ...]
    before: Score
    after: Score


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What was found. `correlation` (p, p) of the estimates; `combinations` sentences on what stays open together.

    `clocks` s by which each recording is late in all, `clock_errors` 1 sigma beside the fitted values, `zeros` what
    clocks in doubt were set by.
    """

    scenario: Scenario
    calibrated: Scenario
    estimates: tuple[Estimate, ...]
    correlation: Array
    condition: float
    combinations: tuple[str, ...]
    clocks: Mapping[str, float]
    clock_errors: Mapping[str, float]
    zeros: Mapping[str, Zero]
    clock_sigma: float
    noise: Mapping[str, Mapping[str, float]]
    training: Scores
    held_out: Scores | None
    samples: int
    independent: float
    outliers: int
    widening: float
    starts_agreeing: tuple[int, int]
    warnings: tuple[str, ...]
    parameters: tuple[Parameter, ...] = ()
    posterior: Posterior | None = None
    profiles: tuple[Profile, ...] = ()

    @property
    def draws(self) -> Array:
        """Draws (n, p) of the fitted values, SI; none where no posterior was asked for."""
        drawn = np.zeros((0, len(self.parameters))) if self.posterior is None else self.posterior.draws
        return np.column_stack([[p.value(float(u)) for u in c] for p, c in zip(self.parameters, drawn.T, strict=True)])

    @property
    def override(self) -> dict[str, float]:
        """Path -> value."""
        return {e.path: e.value for e in self.estimates}


def simulator(scenario: Scenario) -> Simulate:
    """The quickest simulation of a scenario's kind: the one place that chooses it."""
    return drop_test.simulate_drop if not drop_test.unfit(scenario) else _simulated


def _simulated(scenario: Scenario) -> Recording:
    return simulate.run(scenario.of_many()).recording


def calibrate(
    scenario: Scenario,
    recordings: Mapping[str, Recording],
    parameters: Sequence[Parameter],
    *,
    held_out: Mapping[str, Recording] | None = None,
    noise: Noise,
    simulate: Simulate | None = None,
    clock_sigma: float = 1e-3,
    channels: Sequence[str] | None = None,
    starts: int = STARTS,
    seed: int = 0,
    workers: int = 0,
    posterior: int = 0,
) -> Calibration:
    """Fit parameters to recordings, all at once, each under its own conditions.

    `noise(recording, channel)` gives 1 sigma where a recording states none. `clock_sigma` s is the width of the
    prior of each recording's clock offset, 0 for exact clocks. `workers` child processes follow the starts, 0 none;
    `posterior` draws of what stays open are made. Raises `InputError` for a fitted parameter that a recording states
    as its condition, ``ValueError`` for a recording of which nothing can be compared.
    """
    everything = {**recordings, **(held_out or {})}
    check_free(parameters, {name: r.conditions for name, r in everything.items()})
    how = simulate or simulator(scenario)
    ready = {
        name: case(scenario, recording, how, name=name, noise=noise, channels=channels)
        for name, recording in everything.items()
    }
    fitted = tuple(ready[name] for name in recordings)
    plain = Objective(cases=fitted, parameters=tuple(parameters), simulate=how, clock_sigma=clock_sigma)
    given = np.array([p.place(p.start) for p in parameters])
    u, agreeing = _from_starts(plain, given, starts, seed, workers)
    weighted = plain.correlated(u)
    weighted, outliers = _without_outliers(weighted, u)
    u, _ = follow((weighted, u, "linear"))
    # the residual of the last fit decides how many of its samples are independent
    final = replace(weighted.correlated(u), weights=weighted.weights)
    found = determine(final, u)
    result = _calibration(scenario, plain, final, u, found, given, ready, list(recordings), outliers, agreeing)
    if not posterior:
        return result
    drawn = of_fit(final, u, found, draws=posterior, seed=seed)
    return replace(result, posterior=drawn, warnings=(*result.warnings, *drawn.warnings))


def follow(task: tuple[Objective, Array, Literal["linear", "soft_l1"]]) -> tuple[Array, float]:
    """Least squares from one start: where it ends, (p,), and its cost. `soft_l1` counts large residuals by size."""
    from scipy.optimize import least_squares

    objective, u, loss = task
    cost = np.inf
    for softening in SOFTENINGS if loss == "soft_l1" else (1.0,):
        # a clock that is free from far away would lead into a valley of its own
        soft = replace(objective, softening=softening, held=softening != 1.0)
        # at the end differences to both sides: those to one side lead beside the minimum
        slopes = soft.jacobian if loss == "soft_l1" else partial(soft.jacobian, central=True)
        found = least_squares(
            soft.residuals,
            np.clip(u, 1e-6, 1.0 - 1e-6),
            jac=slopes,
            bounds=(0.0, 1.0),
            loss=loss,
            f_scale=CAP,
            x_scale=1.0,
            xtol=1e-6,
            ftol=1e-7 if softening == 1.0 else 1e-4,
            gtol=1e-12,
            max_nfev=TURNS,
        )
        u, cost = np.asarray(found.x), float(found.cost)
    return u, cost


def robust_cost(objective: Objective, u: Array) -> float:
    """Half the sum of CAP^2 rho((r/CAP)^2) with rho(z) = 2 (sqrt(1 + z) - 1)."""
    z = (objective.residuals(u) / CAP) ** 2
    return float(np.sum(CAP**2 * (np.sqrt(1.0 + z) - 1.0)))


def _from_starts(
    objective: Objective, given: Array, starts: int, seed: int, workers: int
) -> tuple[Array, tuple[int, int]]:
    """Best of several starts: the given one and the most promising of a Latin hypercube."""
    tried = [given]
    if starts > 0:
        from scipy.stats import qmc

        spread = qmc.LatinHypercube(d=len(given), seed=seed).random(starts)
        soft = replace(objective, softening=SOFTENINGS[0], held=True)
        ranked = sorted(spread, key=lambda u: robust_cost(soft, np.asarray(u)))
        tried += [np.asarray(u) for u in ranked[: FOLLOWED - 1]]
    tasks: list[tuple[Objective, Array, Literal["linear", "soft_l1"]]] = [(objective, u, "soft_l1") for u in tried]
    outcomes = list(map_cases(follow, tasks, workers=workers))
    ends = [o.value for o in outcomes if o.value is not None]
    if not ends:
        failure = outcomes[0].failure
        raise ValueError(f"no start converged, got {failure.sentence if failure else 'nothing'}; other bounds")
    best = min(ends, key=lambda end: end[1])
    same = sum(bool(np.max(np.abs(end[0] - best[0])) < SAME) for end in ends)
    return best[0], (same, len(ends))


def _without_outliers(objective: Objective, u: Array) -> tuple[Objective, int]:
    """Hold down what lies far outside the scatter of its own channel, by the weight of the robust loss there."""
    weights, count = [], 0
    for k in range(len(objective.cases)):
        for r in objective.parts(k, u)[0]:
            scatter = USUAL * float(np.median(np.abs(r))) if r.size > 8 else np.inf
            away = np.abs(r) > OUTLIER * scatter if scatter > 0.0 else np.zeros(r.size, dtype=bool)
            z = (r / (CAP * scatter)) ** 2 if scatter > 0.0 else np.zeros(r.size)
            weights.append(np.where(away, (1.0 + z) ** -0.25, 1.0))
            count += int(away.sum())
    return (replace(objective, weights=np.concatenate(weights)) if count else objective), count


def score(cases: Sequence[Case], objective: Objective, u: Array) -> Score:
    """Ratings of some cases at `u`, each with its own clock at its best."""
    squares, samples = 0.0, 0
    rated: list[tuple[str, Rating]] = []
    own = replace(objective, cases=tuple(cases), correlation=(), weights=None)
    for k, each in enumerate(cases):
        parts, late = own.parts(k, u)
        squares += sum(float(p @ p) for p in parts[:-1])
        samples += sum(p.size for p in parts[:-1])
        under = exchanged(each.scenario, own.values(u))
        simulated = each.seen(under, own.simulate(under))
        for signal, sigma in zip(each.signals, each.sigmas, strict=True):
            found = rate(signal.time, signal.values, alignment.simulated_at(signal, simulated, late=late), noise=sigma)
            if isinstance(found, Rating):
                rated.append((signal.unit, found))
    return Score(
        over_noise=float(np.sqrt(squares / samples)),
        nrmse=_mean(r.nrmse for _, r in rated),
        iso18571=_mean(r.iso18571.overall for _, r in rated if isinstance(r.iso18571, Iso18571)),
        peak_force_error=_mean(
            abs(r.peak.relative_error) for unit, r in rated if unit == "N" and r.peak.relative_error is not None
        ),
    )


def _mean(values: Any) -> float | None:
    known = [v for v in values if v is not None]
    return float(np.mean(known)) if known else None


def _calibration(
    scenario: Scenario,
    plain: Objective,
    final: Objective,
    u: Array,
    found: Determination,
    given: Array,
    ready: Mapping[str, Case],
    fitted: list[str],
    outliers: int,
    agreeing: tuple[int, int],
) -> Calibration:
    estimates = tuple(_estimate(final, found, u, i) for i in range(len(u)))
    rest = [name for name in ready if name not in fitted]

    def scores(names: list[str]) -> Scores:
        cases = [ready[name] for name in names]
        # before: the values that the scenario has, which need not lie between the bounds
        bare = replace(plain, parameters=())
        return Scores(recordings=tuple(names), before=score(cases, bare, np.empty(0)), after=score(cases, plain, u))

    fine, everything = plain.clocks(u), {c.name: c for c in plain.cases}
    zeros = {name: c.zero for name, c in ready.items() if c.zero is not None}
    clocks = {name: late + (zeros[name].late if name in zeros else 0.0) for name, late in fine.items()}
    beyond = [name for name, late in fine.items() if abs(late) > 3.0 * plain.width(everything[name]) > 0.0]
    counts = final.shape()
    result = Calibration(
        scenario=scenario,
        calibrated=scenario.replaced(final.values(u), origin="calibrated"),
        estimates=estimates,
        correlation=found.correlation,
        condition=found.condition,
        combinations=tuple(_combination(final, d, s) for d, s in zip(found.directions, found.spread, strict=True)),
        clocks=clocks,
        clock_errors={c.name: final.clock_error(k, u) for k, c in enumerate(final.cases)},
        zeros=zeros,
        clock_sigma=plain.clock_sigma,
        noise={c.name: {s.channel: sigma for s, sigma in zip(c.signals, c.sigmas, strict=True)} for c in plain.cases},
        training=scores(fitted),
        held_out=scores(rest) if rest else None,
        samples=sum(n for counted in counts for n in counted),
        independent=sum(
            n / tau
            for counted, worth in zip(counts, final.correlation, strict=True)
            for n, tau in zip(counted, worth, strict=True)
        ),
        outliers=outliers,
        widening=found.widening,
        starts_agreeing=agreeing,
        warnings=(),
        parameters=final.parameters,
        profiles=found.profiles,
    )
    return replace(result, warnings=tuple(_warnings(result, fine, beyond)))


def _estimate(objective: Objective, found: Determination, u: Array, i: int) -> Estimate:
    p, interval, why = objective.parameters[i], found.intervals[i], found.undetermined[i]
    alone = 1.96 * float(found.alone[i])
    sentence = {
        "": "",
        "insensitive": "the recordings do not depend on it enough",
        "combination": "the recordings determine it only together with others",
    }[why]
    return Estimate(
        path=p.path,
        unit=p.unit,
        start=p.start,
        value=p.value(float(u[i])),
        low=p.value(interval.low),
        high=p.value(interval.high),
        method=interval.method,
        bounds=(p.low, p.high),
        open_low=interval.open_low,
        open_high=interval.open_high,
        at_bound="low" if u[i] < NEAR else "high" if u[i] > 1.0 - NEAR else "",
        determined=not why,
        why=sentence,
        alone_low=p.value(max(float(u[i]) - alone, 0.0)),
        alone_high=p.value(min(float(u[i]) + alone, 1.0)),
    )


def _combination(objective: Objective, direction: Array, spread: float) -> str:
    """A direction in words: which parameters can change together, and in which proportion, without being seen."""
    parts = [(p, float(d)) for p, d in zip(objective.parameters, direction, strict=True) if d**2 > 0.01]
    parts.sort(key=lambda part: -abs(part[1]))
    if len(parts) == 1:
        return f"{parts[0][0].path} alone is not observable in these recordings"
    lead, size = parts[0][0], parts[0][0].change(parts[0][1])
    words = [f"{lead.path} by +1 {lead.change_unit}"]
    words += [f"{p.path} by {p.change(d) / size:+.3g} {p.change_unit}" for p, d in parts[1:]]
    return "changed together these are not observable: " + ", ".join(words)


def _warnings(c: Calibration, fine: Mapping[str, float], beyond: Sequence[str]) -> list[str]:
    found = [
        f"{e.path}: at its {'lower' if e.at_bound == 'low' else 'upper'} bound {e.value:.6g}; wider bounds, or another "
        "parameter is at fault"
        for e in c.estimates
        if e.at_bound and e.determined
    ]
    found += [f"{e.path}: not determined: {e.why}" for e in c.estimates if not e.determined]
    found += list(c.combinations)
    if c.training.after.over_noise > 1.5:
        found.append(
            f"the fitted scenario stays {c.training.after.over_noise:.3g} noise levels away: intervals are widened by "
            f"{np.sqrt(c.widening):.3g}, but what the model leaves out may have moved the values further"
        )
    same, tried = c.starts_agreeing
    if tried > 1 and same == 1:
        found.append(f"of {tried} starts none ended where the best did: there may be a better minimum; narrower bounds")
    found += [
        f"{name}: its clock is off by {1e3 * fine[name]:.3g} ms{' more' if name in c.zeros else ''}, beyond 3 sigma"
        for name in beyond
    ]
    return found
