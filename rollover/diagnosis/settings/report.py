"""Verdicts, grades and sentences; tests that are planned."""

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
    hard_by: float = 1e-4  # of a range, from either end: a number anywhere in it alike is there once in 5,000; chosen


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
    least_p_value: float = 1e-12  # below it a tail of chi-square says nothing of recordings; chosen


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


@dataclass(frozen=True, kw_only=True)
class Planning:
    """Planned tests."""

    power: float = 0.9  # probability: what is seen less often is not called detectable; usual in the design of tests
    false_alarm: float = 0.05  # probability that noise alone shows any effect; usual in the design of tests
    distinguishable: float = 0.95  # probability: from it on a test separates two effects; chosen
    rate: float = 1000.0  # Hz: sampling rate; that of `synthesize`
    noise: float = 0.005  # share of a channel's range, standard deviation; that of `synthesize`
    # share, standard deviation: error of a channel's gain; typical errors of gains are 1 to 5 %
    gain: float = 0.01
    memory: float = 0.1  # share of the record: time over which a discrepancy is one error; of the order of a contact
    # samples: memory of the autoregression that stands for noise and discrepancy; chosen
    order: int = 8
    rounds: int = 8  # rounds of a rival's fit to another effect's traces; chosen
    starts: int = 2  # places at which a rival's fit begins; chosen
    # places of a jump within a sampling step, evenly: promises spread over 0.05 among them, means of four within 0.02
    phases: int = 4
    # noncentrality at one of them, from which on the others are not looked at: 0.5 erfc(sqrt(60/8)) = 5e-5
    beyond_doubt: float = 60.0
    quasi_draws: int = 8192  # of the noise in a choice: 0.001 of a probability; a power of two, as Sobol' points need
    # noncentrality beyond which a pair is told apart whatever a better fit leaves: 0.5 erfc(sqrt(400/8)) = 3e-23
    certain_noncentrality: float = 400.0
    # ratio to the noncentrality that is just detectable, at which effects are held against each other: twice as strong
    clearly: float = 4.0
    approaches: int = 12  # steps towards the least strength that shows; a step is exact where the response is linear
    nothing: float = 1e-3  # noncentrality: an effect below it does not act in a test at all; chosen
    # share: a noncentrality that exceeds by more what is asked for is met at an end of a range; far beyond `close`
    at_an_end: float = 0.2
    close: float = 0.02  # share: a noncentrality this near to the one that is asked for is it; chosen
    # ratios of a next condition to the scenario's: from 3 m/s down to the gentlest drop that soils are identified by,
    # and up to twice the speed; chosen
    ratios: tuple[float, ...] = (0.33, 0.5, 0.67, 1.0, 1.2, 1.5, 2.0)
    faster: float = 4.0  # ratio: a higher sampling rate that is tried last; chosen
    few: int = 3  # pairs for which a next test is looked for where none are named; chosen
