"""Verdicts, grades and sentences."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """Verdict of a diagnosis."""

    # share of the excess misfit: effects that take less may be all of it beside a channel that breaks off; chosen
    main_share: float = 0.5
    least_samples: int = 24  # samples in all: with fewer nothing is said; chosen


@dataclass(frozen=True, kw_only=True)
class Grades:
    """Grades of an answer."""

    # share of a load's peak: effects that change no load by more are of no consequence; chosen
    immaterial: float = 0.01
    load_quantile: float = 0.99  # quantile of a load's change; jumps beyond it depend on a clock; chosen
    half_share: float = 0.5  # share of the mismatch: the least that is called a part of it; chosen
    # share of the mismatch: low end above which an effect is surely half of what it leaves, s/(1 - s) > 1/2
    sure_share: float = 1.0 / 3.0
    # share of the mismatch that the true effects explain at least; what resembles an unlisted effect leaves more;
    # chosen
    nearly_all: float = 0.95
    one_sided_confidence: float = 0.975  # probability: one side of a 95 % interval; definition


@dataclass(frozen=True, kw_only=True)
class Invariants:
    """Checks of an answer against itself."""

    at_noise: float = 1.05  # misfit over the noise: below it a sentence gives 1.0; rounding to one decimal
    halvings: int = 6  # bisections of the way to an effect's zero; known to a 64th of the way
    rival_share: float = 0.5  # share of the best effect's gain that a rival must have; chosen


@dataclass(frozen=True, kw_only=True)
class Power:
    """What a test could have shown."""

    # share of the effects that would not have shown: above it nothing can be concluded; chosen
    blind_share: float = 0.6


@dataclass(frozen=True, kw_only=True)
class Probabilities:
    """Probabilities over names."""

    nothing: float = 0.4  # probability before any recording that nothing is missing; as likely as that one of all is
    not_listed: float = 0.2  # the same of what no table holds: half as likely as what one does; chosen
    # share of unlisted effects that a listed one meets down to noise; three of twenty in the proof
    met_by_chance: float = 0.15
    # shares of a channel's range: 5 % and 95 % quantiles of what an effect worth a name moves it by; chosen
    effect_range: tuple[float, ...] = (0.01, 1.0)
    credible: float = 0.95  # probability of the names that are offered together to hold the right one; usual level
    every: int = 8  # of the scales that are tried one in so many where two are tried at once; steps of 10 %


@dataclass(frozen=True, kw_only=True)
class SensorsFirst:
    """Faults of sensors."""

    spelt_out: int = 3  # findings of one kind and channel that are spelt out; chosen


@dataclass(frozen=True, kw_only=True)
class Statements:
    """Sentences."""

    notable_change: float = 0.1  # share of an interval: change with the time step that is reported; chosen
    # standard deviations of a recording's clock: up to it one channel may be late, or all others early; chosen
    clock_errors: float = 3.0
    # share of a strength: the end of a logarithmic interval is lowered by it in the comparison with none; chosen
    near_zero: float = 0.2
    spelt_out_scales: int = 6  # scales of a background that a sentence spells out; chosen


@dataclass(frozen=True, kw_only=True)
class LateClocks:
    """Late clocks."""

    most_channels: int = 3  # channels that may be late each by itself; chosen


@dataclass(frozen=True, kw_only=True)
class Report:
    """Verdicts, grades and sentences."""

    conclusion: Conclusion = Conclusion()  # verdict of a diagnosis
    grades: Grades = Grades()  # grades of an answer
    invariants: Invariants = Invariants()  # checks of an answer against itself
    power: Power = Power()  # what a test could have shown
    probabilities: Probabilities = Probabilities()  # probabilities over names
    sensors_first: SensorsFirst = SensorsFirst()  # faults of sensors
    statements: Statements = Statements()  # sentences
    late_clocks: LateClocks = LateClocks()  # late clocks
