"""What a diagnosis says (data only)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rollover.calibration.posterior import Posterior
from rollover.diagnosis.settings import SETTINGS
from rollover.recording.time_stamps import Zero
from rollover.system.notebook import card

Verdict = Literal["no-mismatch", "parameter", "sensor", "missing-physics", "unexplained", "cannot-tell"]

# whether how far a model misses is estimated: "unexplained" says in place of that verdict alone
Estimate = bool | Literal["unexplained"]

Answer = Literal["nothing", "immaterial", "whole", "part", "likeness", "unexplained", "cannot-tell"]
LEAST_P_VALUE = SETTINGS.report.statements.least_p_value


def chance(p_value: float) -> str:
    """A p-value as a sentence states it: one that underflows is not 0."""
    return f"p < {LEAST_P_VALUE:g}" if p_value < LEAST_P_VALUE else f"p = {p_value:.2g}"


@dataclass(frozen=True, kw_only=True)
class Location:
    """Where: a recording, channel, phase and interval (s), its share of the misfit, and what it depends on there."""

    recording: str
    channel: str
    phase: str
    start: float
    end: float
    share: float
    depends_on: str | None


@dataclass(frozen=True, kw_only=True)
class Degree:
    """A degree of freedom of a body: residual force (N) or moment (N m), rms over all recordings, share of the misfit.

    `axis` is "along y" or "about x", body axes; shares of all degrees add up to 1.
    """

    body: str
    axis: str
    unit: str
    rms: float
    share: float


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A fitted parameter with its 95 % interval, in SI; `at_bound` where the search ended at an end of its range.

    `as_simulated` is the value that the scenario's own steps ask for, where shorter ones ask for another.
    """

    value: float
    low: float
    high: float
    unit: str
    at_bound: bool = False
    as_simulated: float | None = None


@dataclass(frozen=True, kw_only=True)
class Share:
    """Share of a held-out mismatch with its 95 % interval over recordings; at most 1, below 0 where it adds to it."""

    share: float
    low: float
    high: float

    def message(self, of: str = "the held-out mismatch", *, alone: bool = True) -> str:
        """In per cent with its interval, none below nought; nearly all is not said to be all, nor a little nothing.

        Of one of several effects, not `alone`, it is what it explains beyond the others: these need not add up to all.
        """
        share, low, high = (_percent(v) for v in (self.share, self.low, self.high))
        return f"{share} ({low} to {high}) of {of}{'' if alone else ', beyond the others'}"


def _percent(share: float) -> str:
    share = max(share, 0.0)
    if 0.0 < share < 0.005:
        return "below 0.5%"
    return f"{math.floor(1e3 * share) / 10.0:.1f}%" if 0.995 <= share < 1.0 else f"{share:.0%}"


@dataclass(frozen=True, kw_only=True)
class Scale:
    """What a model misses of a channel beside what it lacks: 1 sigma (SI), and the time over which it is one error."""

    scale: float
    unit: str
    correlation_time: float | None


@dataclass(frozen=True, kw_only=True)
class NextTest:
    """One more test: a value of the scenario by path, its channels, rate (Hz), probability of telling two apart."""

    path: str
    value: float
    unit: str
    channels: tuple[str, ...]
    rate: float
    probability: float

    def message(self) -> str:
        """The sentence."""
        value = f"{self.value:g} {self.unit}".rstrip()
        return (
            f"a test with {self.path} {value}, recorded at {self.rate:.4g} Hz ({', '.join(self.channels)}), would "
            f"distinguish them with a probability of {self.probability:.0%}"
        )


@dataclass(frozen=True, kw_only=True)
class Named:
    """An effect that was found, with what it cannot be distinguished from and how it could.

    `explains` is its share of the held-out mismatch, `moves` the most by which it moves a load, of its peak; None where
    it moves none. `next_test` is what would tell it from the only other one in the set, by these recordings.
    """

    id: str
    kind: str
    statement: str
    parameters: Mapping[str, Interval]
    settings: Mapping[str, Any]
    channel: str | None
    p_value: float
    indistinguishable_from: tuple[str, ...]
    discriminating_test: str
    answer: Answer = "whole"
    explains: Share | None = None
    moves: float | None = None
    next_test: NextTest | None = None


@dataclass(frozen=True, kw_only=True)
class Score:
    """How well some recordings are met: misfit over the noise, ISO/TS 18571 (mean), error of the peak force."""

    nrmse: float
    iso18571: float | None
    peak_force_error: float | None


@dataclass(frozen=True, kw_only=True)
class Considered:
    """A candidate, its held-out gain ln(E_before/E_after) over the best explanation without it, and why (not)."""

    id: str
    channel: str | None
    held_out_gain: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class LawTerm:
    """One term of a law found by regression: its shape, what that depends on, and its force (N at the scales)."""

    term: str
    depends_on: str
    force: Interval


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law without a name that predicts held-out recordings: gain ln(E_before/E_after) with its standard error."""

    terms: tuple[LawTerm, ...]
    law: str
    held_out_gain: float
    standard_error: float
    before: float
    after: float
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class Draws:
    """Draws (n, p) of what is fitted of the effects that are named, SI, with what was fitted and their convergence."""

    names: tuple[str, ...]  # effect, its channel if it has one, parameter
    units: tuple[str, ...]
    values: NDArray[np.float64]
    fitted: tuple[float, ...]
    convergence: Posterior


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The whole answer."""

    verdict: Verdict
    sentence: str
    p_value: float
    noise: Mapping[str, float]
    where: tuple[Location, ...]
    effects: tuple[Named, ...]
    remaining_significant: bool
    remaining_p_value: float
    remaining_where: tuple[Location, ...]
    depends_on: str | None
    dependencies: tuple[tuple[str, float], ...]
    smallest_detectable: Mapping[str, float]
    training: tuple[str, ...]
    held_out: tuple[str, ...]
    before: Mapping[str, Score]  # "training" and "held_out"
    after: Mapping[str, Score]
    per_recording: tuple[tuple[str, float, float], ...]  # name, held-out misfit over the noise before and after
    candidates: tuple[Considered, ...]
    simulations: int
    seconds: float
    degrees: tuple[Degree, ...] = ()
    notes: tuple[str, ...] = ()
    clocks: Mapping[str, Zero] = field(default_factory=dict)  # zeros that were found, of clocks in doubt
    grids: Mapping[str, tuple[float, ...]] = field(default_factory=dict)  # of full runs: centre of the elements, m
    empirical: Law | None = None  # where no effect explains the mismatch
    answer: Answer = "cannot-tell"
    discrepancy: Mapping[str, Scale] = field(default_factory=dict)  # by channel, where it was estimated or stated
    by_itself: bool = False  # whether the verdict is on what recordings show without any simulation
    checked: tuple[str, ...] = ()  # invariants that were checked
    broken: tuple[str, ...] = ()  # those of them that do not hold
    posterior: Draws | None = None  # where it was asked for and something is named
    probabilities: Mapping[str, float] = field(default_factory=dict)  # of each name to be what is missing, of drops
    baseline: Mapping[str, Interval] = field(default_factory=dict)  # what a model of one's own is always fitted by

    def _repr_html_(self) -> str:
        """What a notebook shows: the sentence, the effects that are named with their intervals, what the fit gains."""
        rows = [
            (e.id, e.channel or "", name, f"{i.value:.5g}", f"{i.low:.5g}", f"{i.high:.5g}", i.unit)
            for e in self.effects
            for name, i in e.parameters.items()
        ]
        said = [self.sentence]
        for which in ("training", "held_out"):
            if which in self.before and which in self.after:
                was, now = self.before[which].nrmse, self.after[which].nrmse
                said.append(f"{which.replace('_', ' ')}: misfit over noise {was:.3g} -> {now:.3g}")
        for e in self.effects:
            if e.indistinguishable_from:
                others = ", ".join(e.indistinguishable_from)
                said.append(f"{e.id} or {others}? Measure next: {e.discriminating_test}")
        headings = ("effect", "channel", "parameter", "value", "95 % from", "to", "unit")
        return card(self.verdict, [*said, *self.notes], headings, rows, words=(0, 1, 2, 6))
