"""Samples of what recordings leave open of the fitted values: the posterior beside a uniform prior within the bounds.

The likelihood is that of the fit: residuals over noise with correlated samples worth one, each clock at its best
under its prior, and all of it wider by the misfit over the noise where that is above 1. Walkers jump independently, by
a heavy-tailed copy of the quadratic approximation at the fit, and now and then along the differences of two others, by
which they follow what is no ellipse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.identifiability import Determination
from rollover.calibration.objective import Objective
from rollover.system.arguments import within
from rollover.system.errors import Fault, InputError

Array = NDArray[np.float64]
LogDensity = Callable[[Array], float]

DRAWS = 3000
FEWEST, MOST = 500, 1_000_000  # draws: quantiles at 2.5 % of fewer are a dozen draws; of more fill the memory
OPTION = "--posterior"
LEAST_WALKERS = 16  # and at least twice as many as parameters, which jumps along differences ask for
WARM_UP = 0.1  # share of the steps that are thrown away: walkers start from the jumps' density, near to the posterior's
FREEDOM = 5.0  # of the Student's t that jumps are drawn by: heavier tails than those of any quadratic approximation
WIDER = 1.15  # times as wide as that: what is too narrow never gets into the tails
WIDEST = 0.3  # standard deviation of jumps in ranges: about that of a uniform prior, 1/sqrt(12)
ALONG = 0.2  # share of steps along differences
MIXED = 1.05  # R-hat above which walkers do not agree; 1.01 is asked of tail quantiles, 1.1 was once of means


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """Draws (n, p) in `u`, of `walkers` side by side, `steps` each; convergence of each parameter (p,).

    `r_hat` is 1 where walkers agree, `autocorrelation` the steps that are worth one, `effective` the independent draws.
    """

    draws: Array
    r_hat: Array
    autocorrelation: Array
    effective: Array
    acceptance: float
    walkers: int
    steps: int
    warm_up: int
    seed: int
    sampler: str

    @property
    def is_mixed(self) -> bool:
        """Whether the walkers agree."""
        return bool(np.all(self.r_hat < MIXED))

    @property
    def warnings(self) -> list[str]:
        """What is to be said of draws that cannot be trusted."""
        if self.is_mixed:
            return []
        worst = float(np.max(self.r_hat))
        return [f"the walkers of the posterior do not agree, R-hat {worst:.3g}: more draws, or narrower bounds"]


def summary(names: Sequence[str], values: Array, drawn: Posterior, prior: str) -> dict[str, Any]:
    """Bare values that say what draws (n, p) of named values say, each with its convergence."""
    low, median, high = np.quantile(values, [0.025, 0.5, 0.975], axis=0)
    each = {
        name: {
            "mean": values[:, k].mean(),
            "deviation": values[:, k].std(ddof=1),
            "low": low[k],
            "median": median[k],
            "high": high[k],
            "r_hat": drawn.r_hat[k],
            "autocorrelation_time": drawn.autocorrelation[k],
            "effective_draws": drawn.effective[k],
        }
        for k, name in enumerate(names)
    }
    return {
        "sampler": drawn.sampler,
        "draws": len(values),
        "walkers": drawn.walkers,
        "steps": drawn.steps,
        "warm_up_steps": drawn.warm_up,
        "acceptance": drawn.acceptance,
        "seed": drawn.seed,
        "prior": prior,
        "parameters": each,
        "correlation": np.corrcoef(values.T) if len(each) > 1 else [[1.0]],
    }


def table(names: Sequence[str], values: Array) -> str:
    """posterior.csv: a column for each value, SI, a row for each draw."""
    rows = [",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in values)]
    return "\n".join(rows) + "\n"


def of_fit(objective: Objective, u: Array, found: Determination, *, draws: int = DRAWS, seed: int = 0) -> Posterior:
    """Draws about a fit that ended at `u` (p,)."""
    clocks = [objective.parts(k, u)[1] for k in range(len(objective.cases))]

    def log_density(v: Array) -> float:
        return -0.5 * objective.squares(v, clocks) / found.widening

    return sampled(log_density, u, found.covariance, draws=draws, seed=seed)


def draws_of(asked: bool | int) -> int:
    """How many draws are asked for: none, the usual number, or so many.

    Raises `InputError`, where emcee is missing too.
    """
    if isinstance(asked, bool) or asked == 0:
        draws = DRAWS if asked else 0
    else:
        within("posterior", asked, FEWEST, MOST)
        if int(asked) != asked:
            message = f"not a whole number, got {asked!r}; True, or a number of draws is allowed"
            raise InputError(Fault(path="posterior", message=message))
        draws = int(asked)
    if draws:
        installed("posterior")
    return draws


def installed(by: str = OPTION) -> None:
    """Raise `InputError` with the cure where emcee is missing; `by` names what asks for it."""
    try:
        import emcee  # noqa: F401
    except ImportError:
        message = f"emcee is not installed; pip install 'rollover[posterior]' brings it, or leave {by} out"
        raise InputError(Fault(file=by, message=message)) from None


def sampled(
    log_density: LogDensity, centre: Array, covariance: Array, *, draws: int = DRAWS, seed: int = 0
) -> Posterior:
    """Draws of a density on the unit box whose best point and covariance there, (p,) and (p, p), are roughly known.

    `log_density` is asked inside the box only. The same `seed` gives the same draws.
    """
    import emcee

    jump = _Independent(centre, covariance)
    walkers = max(LEAST_WALKERS, 2 * centre.size + 2)
    steps = -(-draws // walkers)
    warm_up = max(int(np.ceil(WARM_UP * steps)), 1)
    random = np.random.RandomState(seed)

    def inside(u: Array) -> float:
        return log_density(u) if np.all((u >= 0.0) & (u <= 1.0)) else -np.inf

    moves = [(emcee.moves.MHMove(jump.proposed), 1.0 - ALONG), (emcee.moves.DEMove(), ALONG)]
    chains = emcee.EnsembleSampler(walkers, centre.size, inside, moves=moves)
    chains.random_state = random.get_state()
    start = np.clip(jump.drawn(walkers, random), 1e-6, 1.0 - 1e-6)
    chains.run_mcmc(start, warm_up + steps, skip_initial_state_check=True)
    kept = np.asarray(chains.get_chain(discard=warm_up))  # (steps, walkers, p)
    with np.errstate(invalid="ignore"):  # of a walker that never moved
        autocorrelation_time = emcee.autocorr.integrated_time(kept, tol=0)  # what is too short for it shows in R-hat
    worth = np.where(np.isfinite(autocorrelation_time), np.clip(autocorrelation_time, 1.0, steps), steps)
    return Posterior(
        draws=kept.reshape(-1, centre.size)[:draws],
        r_hat=r_hat(kept),
        autocorrelation=worth,
        effective=steps * walkers / worth,
        acceptance=float(np.mean(chains.acceptance_fraction)),
        walkers=walkers,
        steps=steps,
        warm_up=warm_up,
        seed=seed,
        sampler=f"emcee {emcee.__version__}",
    )


class _Independent:
    """Jumps that do not depend on where a walker stands: Student's t about the centre."""

    def __init__(self, centre: Array, covariance: Array) -> None:
        size, directions = np.linalg.eigh(covariance)
        self.spread = WIDER * np.clip(np.sqrt(np.maximum(size, 0.0)), 1e-9, WIDEST)
        self.centre, self.directions = centre, directions

    def drawn(self, count: int, random: Any) -> Array:
        """Places (count, p)."""
        z = random.standard_normal((count, self.centre.size))
        scale = np.sqrt(random.chisquare(FREEDOM, count) / FREEDOM)
        return np.asarray(self.centre + (z / scale[:, None] * self.spread) @ self.directions.T)

    def log_density(self, places: Array) -> Array:
        """Log density (count,), but for a constant."""
        z = (places - self.centre) @ self.directions / self.spread
        p = self.centre.size
        return np.asarray(-0.5 * (FREEDOM + p) * np.log1p(np.sum(z**2, axis=1) / FREEDOM))

    def proposed(self, places: Array, random: Any) -> tuple[Array, Array]:
        """New places, and the logarithm of the proposal's density back over that there (Hastings' ratio)."""
        new = self.drawn(len(places), random)
        return new, self.log_density(places) - self.log_density(new)


def r_hat(chains: Array) -> Array:
    """Split R-hat (p,) of chains (steps, walkers, p): spread of all halves over the spread within each."""
    half = chains.shape[0] // 2
    if half < 2:
        return np.full(chains.shape[2], np.inf)
    parts = np.concatenate([chains[:half], chains[-half:]], axis=1)
    within = np.mean(np.var(parts, axis=0, ddof=1), axis=0)
    between = np.var(np.mean(parts, axis=0), axis=0, ddof=1)
    stuck = within <= 0.0
    ratio = (half - 1) / half + between / np.where(stuck, 1.0, within)
    return np.where(stuck, np.inf, np.sqrt(ratio))
